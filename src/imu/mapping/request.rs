//! A vector that is asked for, of the messages of one topic.

use super::known_types::KnownVector;
use crate::imu::config::VectorPath;
use crate::imu::sample::Sensor;
use crate::imu::schema::path::FieldPath;

/// A vector to be read from the messages of one topic.
pub(in crate::imu) struct Request<'a> {
    pub(in crate::imu) sensor: Sensor,
    /// Key of the configuration that says where it stands.
    pub(in crate::imu) key: &'static str,
    pub(in crate::imu) name: &'a str,
    pub(in crate::imu) path: Option<&'a VectorPath>,
    /// Where it stands in a message of this type, if nothing else is said.
    pub(in crate::imu) known: Option<&'a KnownVector>,
    /// A vector that is added to it.
    pub(in crate::imu) plus: Option<&'a FieldPath>,
    /// Whether it counts although its `covariance[0]` is −1.
    pub(in crate::imu) ignores_covariance: bool,
    pub(in crate::imu) factor: f64,
    /// Whether it shares the topic of the accelerometer, and with it the `frame_id`.
    pub(in crate::imu) with_accel: bool,
}

impl<'a> Request<'a> {
    /// For the gyroscope of an IMU whose accelerometer is on another topic.
    pub(in crate::imu) fn other_half(known: &'a KnownVector) -> Self {
        Self {
            sensor: Sensor::Gyroscope,
            key: "gyro",
            name: "gyroscope",
            path: None,
            known: Some(known),
            plus: None,
            ignores_covariance: false,
            factor: 1.0,
            with_accel: false,
        }
    }
}
