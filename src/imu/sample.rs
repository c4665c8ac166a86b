//! Reading of one triad of an IMU.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;

/// One reading of one triad: specific force in m/s², or angular rate in rad/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Time of measurement.
    pub stamp: Stamp,
    /// Time of recording, in nanoseconds. Results from this sample are logged at this time.
    pub log_time: u64,
    /// Values of the three axes, finite.
    pub value: Vector3<f64>,
}

impl Sample {
    /// Whether a value can be a reading, in whatever unit: finite, and of a size that a converter's count may have.
    pub fn is_reading(value: &Vector3<f64>) -> bool {
        /// Largest magnitude of an axis.
        const MOST: f64 = 1e12;
        value.iter().all(|axis| axis.abs() <= MOST)
    }
}

/// Information from one message about one triad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reading {
    /// A measurement.
    Sample(Sample),
    /// The sample with this stamp, which follows, is clipped: the sensor reached the end of its range.
    Clipped(Stamp),
    /// From this stamp on, the driver applies another calibration.
    NewRound {
        /// Stamp of the sample that follows.
        stamp: Stamp,
        /// Log time of the sample that follows, in nanoseconds.
        log_time: u64,
    },
}

impl Reading {
    /// Stamp of the sample that it is, or that follows.
    pub fn stamp(&self) -> Stamp {
        match *self {
            Self::Sample(Sample { stamp, .. }) | Self::Clipped(stamp) | Self::NewRound { stamp, .. } => stamp,
        }
    }
}

/// Triad of an IMU that a sample belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Sensor {
    /// The primary accelerometer.
    Accelerometer,
    /// The gyroscope.
    Gyroscope,
    /// A further accelerometer that moves with the primary one, by its index in the configuration.
    Secondary(usize),
    /// True value from a reference.
    Reference(Quantity),
}

/// Quantity that a reference provides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Quantity {
    /// True specific force, m/s².
    Force,
    /// True angular rate, rad/s.
    Rate,
}

impl Sensor {
    /// Unique index: 0 for the accelerometer, 1 for the gyroscope, 2 and 3 for the reference, secondaries from 4 on.
    pub fn index(self) -> usize {
        match self {
            Self::Accelerometer => 0,
            Self::Gyroscope => 1,
            Self::Secondary(i) => i + 4,
            Self::Reference(Quantity::Force) => 2,
            Self::Reference(Quantity::Rate) => 3,
        }
    }
}

/// IMU of a recording, numbered in the order of first appearance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ImuId(usize);

impl ImuId {
    /// IMU at an index of [`Intake::imus`](super::Intake::imus).
    pub fn of(index: usize) -> Self {
        Self(index)
    }

    /// Index in [`Intake::imus`](super::Intake::imus).
    pub fn index(self) -> usize {
        self.0
    }
}
