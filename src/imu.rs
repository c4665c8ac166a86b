//! What a sample is, and how the bytes of a message become one: the schema of a channel is compiled once to a flat
//! plan, which walks its messages without building values. What the samples say is left to [`engine`](crate::engine).
//!
//! [`Intake`] is the door: channels and messages go in, samples come out.

mod clock;
mod config;
mod decoder;
mod descriptor;
mod fix;
mod idl;
mod intake;
mod json;
mod jsonschema;
mod known;
mod layout;
mod lookup;
mod path;
mod peek;
mod plan;
mod preset;
mod rosmsg;
mod route;
mod seen;
mod source;
mod split;
mod suggestion;
mod tagged;
mod verdict;
mod walk;

pub use clock::header_stamp;
pub use config::{AccelUnit, ImuConfig, RateUnit, ReferenceConfig, SecondaryConfig, VectorConfig, VectorPath};
pub use decoder::Decoder;
pub use fix::Fix;
pub use intake::{Intake, MissingTopic};
pub use layout::{Layout, Place, SchemaError};
pub use lookup::PathError;
pub use path::{FieldPath, PathSyntaxError};
pub use peek::{Looks, Peek, Relation};
pub use preset::{Datasheet, Preset, Promise};
pub use seen::{Imu, Triad};
pub use suggestion::Suggestion;
pub use verdict::{Cause, Fault, Notice, Use, Verdict};
pub use walk::Malformed;

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

/// What a message says of one triad.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Which triad of an IMU a sample belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Sensor {
    /// The primary accelerometer.
    Accelerometer,
    /// The gyroscope.
    Gyroscope,
    /// A further accelerometer that moves with the primary one, by its place in the configuration.
    Secondary(usize),
    /// What there was to read, by a reference that knows.
    Reference(Quantity),
}

/// What a reference knows.
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

/// Which IMU of a recording, in the order in which they were seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ImuId(usize);

impl ImuId {
    /// Its place in [`Intake::imus`].
    pub fn index(self) -> usize {
        self.0
    }
}
