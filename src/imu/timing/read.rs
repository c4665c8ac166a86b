//! A reading, and whose it is.

use crate::imu::sample::{ImuId, Reading, Sensor};

/// A reading, and whose it is.
pub type Read = (ImuId, Sensor, Reading);
