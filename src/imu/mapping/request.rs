//! Request for a vector in the messages of one topic.

use super::known_types::KnownVector;
use crate::imu::config::{AxesConfig, VectorPath};
use crate::imu::sample::Sensor;
use crate::imu::schema::path::FieldPath;

/// Request to read a vector from the messages of one topic.
pub(in crate::imu) struct Request<'a> {
    pub(in crate::imu) sensor: Sensor,
    /// Configuration key of its path.
    pub(in crate::imu) key: &'static str,
    pub(in crate::imu) name: &'a str,
    pub(in crate::imu) path: Option<&'a VectorPath>,
    /// Default place in a message of this type.
    pub(in crate::imu) known: Option<&'a KnownVector>,
    /// Path of a vector that is added to it.
    pub(in crate::imu) plus: Option<&'a FieldPath>,
    /// Its axes that are the sensor's.
    pub(in crate::imu) axes: AxesConfig,
    /// Whether it is used although its `covariance[0]` is −1.
    pub(in crate::imu) ignores_covariance: bool,
    pub(in crate::imu) factor: f64,
    /// Whether it shares the topic of the accelerometer, and so the `frame_id`.
    pub(in crate::imu) with_accel: bool,
}

impl<'a> Request<'a> {
    /// Request for the gyroscope of an IMU whose accelerometer is on another topic.
    pub(in crate::imu) fn other_half(known: &'a KnownVector) -> Self {
        Self {
            sensor: Sensor::Gyroscope,
            key: "gyro",
            name: "gyroscope",
            path: None,
            known: Some(known),
            plus: None,
            axes: AxesConfig::default(),
            ignores_covariance: false,
            factor: 1.0,
            with_accel: false,
        }
    }
}
