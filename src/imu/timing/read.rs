//! A reading with its IMU and sensor.

use crate::imu::sample::{ImuId, Reading, Sensor};

/// A reading with its IMU and sensor.
pub type Read = (ImuId, Sensor, Reading);
