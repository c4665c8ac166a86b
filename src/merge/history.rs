//! History of a sensor over its recordings, as types.

use crate::Stamp;
use crate::messages::{Calibration, Coverage};

/// History of a sensor over its recordings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Number of recordings that contributed rests.
    pub recordings: usize,
    /// Number of rests used.
    pub rests: usize,
    /// Rests that began before another had ended, which one sensor cannot do.
    pub overlapping: usize,
    /// Starts of rests of which one is a wrong placement: it alone contradicts all others, so the sensor did not change.
    pub strays: Vec<Vec<Stamp>>,
    /// Number of turns used, of which each lies between two of the rests.
    pub turns: usize,
    /// Whether some of the rests or turns stand for others that had no room.
    pub is_thinned: bool,
    /// Epochs between changes, oldest first.
    pub epochs: Vec<Epoch>,
    /// Changes between two recordings, oldest first.
    pub changes: Vec<Change>,
    /// The parameters at each recording.
    pub curve: Vec<Point>,
    /// Whether accelerometer and gyroscope drift between the changes.
    pub drifts: [bool; 2],
}

/// A time in which the sensor stayed the same, apart from drift.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Epoch {
    /// Start of the first rest.
    pub begin: Stamp,
    /// End of the last rest.
    pub end: Stamp,
    /// Number of its recordings.
    pub recordings: usize,
    /// Calibration fitted to its rests.
    pub calibration: Option<Calibration>,
    /// Faces that its rests show.
    pub coverage: Coverage,
}

/// Kind of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeKind {
    /// The biases jumped, but no sensitivity.
    Shock,
    /// A sensitivity jumped too: another sensor, or another range.
    Replaced,
    /// The sensor lies another way at rest, and reads as it did.
    Remounted,
}

impl ChangeKind {
    /// Name of the kind.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shock => "shock",
            Self::Replaced => "replaced",
            Self::Remounted => "remounted",
        }
    }
}

/// A change between two recordings.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Apparent kind.
    pub kind: ChangeKind,
    /// End of the last rest before it.
    pub after: Stamp,
    /// Start of the first rest behind it.
    pub before: Stamp,
    /// Significance, as a normal score.
    pub score: f64,
    /// Jump of the accelerometer's bias, m/s², and its standard deviation.
    pub bias: [[f64; 3]; 2],
    /// Jump of the diagonal of its sensitivity, and its standard deviation.
    pub scale: [[f64; 3]; 2],
    /// Jump of the gyroscope's bias, rad/s, and its standard deviation; absent without a gyroscope.
    pub gyro_bias: Option<[[f64; 3]; 2]>,
    /// Change of the attitude at rest, rad, if it always was one before and always another afterwards.
    pub turned: Option<f64>,
}

/// The parameters at one recording, each with one standard deviation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// Start of the recording's first rest.
    pub time: Stamp,
    /// Bias of the accelerometer, m/s².
    pub bias: [[f64; 3]; 2],
    /// Diagonal of its sensitivity.
    pub scale: [[f64; 3]; 2],
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias: Option<[[f64; 3]; 2]>,
    /// Mean temperature over the rests, °C.
    pub temperature: Option<f64>,
}
