//! Reading of one triad of an IMU.

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

/// Message's word on one triad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reading {
    /// It measured.
    Sample(Sample),
    /// The sample of this stamp, which follows, is clipped: a sensor reached the end of its range.
    Clipped(Stamp),
    /// From this stamp on, the driver applies another calibration.
    NewRound {
        /// Of the sample that follows.
        stamp: Stamp,
        /// Of the sample that follows.
        log_time: u64,
    },
}

/// Triad of an IMU that a sample belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Sensor {
    /// The primary accelerometer.
    Accelerometer,
    /// The gyroscope.
    Gyroscope,
    /// A further accelerometer that moves with the primary one, by its place in the configuration.
    Secondary(usize),
    /// Truth that there was to read, by a reference that knows.
    Reference(Quantity),
}

/// Quantity that a reference knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Quantity {
    /// True specific force, m/s².
    Force,
    /// True angular rate, rad/s.
    Rate,
}

impl Sensor {
    /// A number of its own: 0 for the accelerometer, 1 for the gyroscope, then the reference, secondaries from 4 on.
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

/// IMU of a recording, by the order in which they were seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ImuId(usize);

impl ImuId {
    /// The IMU at a place of [`Intake::imus`](super::Intake::imus).
    pub fn of(index: usize) -> Self {
        Self(index)
    }

    /// Its place in [`Intake::imus`](super::Intake::imus).
    pub fn index(self) -> usize {
        self.0
    }
}
