//! Content of a message, whatever its encoding.

use nalgebra::Vector3;

use crate::Stamp;

/// Stamp and frame of a message.
#[derive(Clone, Copy, Debug)]
pub(in crate::simulate) struct Header<'a> {
    /// Number of the message on its topic, for ROS 1.
    pub sequence: u32,
    pub stamp: Stamp,
    pub frame_id: &'a str,
}

/// Content of a message.
#[derive(Clone, Copy, Debug)]
pub(in crate::simulate) enum Body {
    /// Message of an IMU: specific force and angular rate, one of which may be measured elsewhere, and temperature, °C.
    Imu { accel: Option<Vector3<f64>>, gyro: Option<Vector3<f64>>, celsius: Option<f64> },
    /// Message of a secondary accelerometer.
    Vector(Vector3<f64>),
    /// Message of a thermometer, °C.
    Temperature(f64),
}
