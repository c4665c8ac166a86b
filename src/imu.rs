//! What a sample is, and how the bytes of a message become one.

mod config;

pub use config::{ImuConfig, SecondaryConfig, VectorConfig, VectorTable};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;

/// One reading of one triad: specific force in m/s², or angular rate in rad/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// When it was measured.
    pub stamp: Stamp,
    /// When it was recorded; what is learned from it is logged at this time.
    pub log_time: u64,
    /// The three axes, finite.
    pub value: Vector3<f64>,
}

/// Which triad of an IMU a sample belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Sensor {
    /// The primary accelerometer.
    Accelerometer,
    /// The gyroscope.
    Gyroscope,
    /// A further accelerometer that moves with the primary one, by its place in the configuration.
    Secondary(usize),
}
