//! What became of a sensor over its recordings, as types.

use crate::Stamp;
use crate::messages::{Calibration, Coverage};

/// What became of a sensor over its recordings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Recordings that rests were taken from.
    pub recordings: usize,
    /// Rests that were taken.
    pub rests: usize,
    /// Whether some of them stand for others that there was no room for.
    pub is_thinned: bool,
    /// From change to change, oldest first.
    pub epochs: Vec<Epoch>,
    /// What changed between two recordings, oldest first.
    pub changes: Vec<Change>,
    /// The parameters at each recording.
    pub curve: Vec<Point>,
    /// Whether the accelerometer walks between the changes, and whether the gyroscope does.
    pub drifts: [bool; 2],
}

/// A time in which the sensor stayed the same, drift apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Epoch {
    /// First rest.
    pub begin: Stamp,
    /// End of the last one.
    pub end: Stamp,
    /// Recordings in it.
    pub recordings: usize,
    /// What its rests come to.
    pub calibration: Option<Calibration>,
    /// The faces that they show.
    pub coverage: Coverage,
}

/// What a sensor may have suffered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeKind {
    /// The biases jumped, and no sensitivity did.
    Shock,
    /// A sensitivity jumped too: another sensor, or another range.
    Replaced,
}

impl ChangeKind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shock => "shock",
            Self::Replaced => "replaced",
        }
    }
}

/// Something changed between two recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// What it looks like.
    pub kind: ChangeKind,
    /// End of the last rest before it.
    pub after: Stamp,
    /// Start of the first rest behind it.
    pub before: Stamp,
    /// How sure it is, as a normal score.
    pub score: f64,
    /// By how much the accelerometer's bias jumped, m/s², and one standard deviation.
    pub bias: [[f64; 3]; 2],
    /// The diagonal of its sensitivity.
    pub scale: [[f64; 3]; 2],
    /// The gyroscope's bias, rad/s; absent without one.
    pub gyro_bias: Option<[[f64; 3]; 2]>,
    /// How far the attitude at rest turned, rad, where it has one.
    pub turned: Option<f64>,
}

/// The parameters at one recording, each with one standard deviation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// First rest of the recording.
    pub time: Stamp,
    /// Accelerometer, m/s².
    pub bias: [[f64; 3]; 2],
    /// Diagonal of its sensitivity.
    pub scale: [[f64; 3]; 2],
    /// Gyroscope, rad/s.
    pub gyro_bias: Option<[[f64; 3]; 2]>,
    /// Mean over the rests, °C.
    pub temperature: Option<f64>,
}
