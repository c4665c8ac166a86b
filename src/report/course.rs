//! Course of a sensor's parameters over many recordings, as a page shows it.

use crate::Stamp;

/// Course of a sensor's parameters over many recordings.
#[derive(Clone, Debug, Default)]
pub struct Course {
    /// Sources of its values, one sentence each.
    pub notes: Vec<String>,
    /// Changes between two recordings, oldest first.
    pub jumps: Vec<Jump>,
    /// Parameters over time.
    pub curves: Vec<Curve>,
}

/// Change of a sensor between two recordings.
#[derive(Clone, Debug)]
pub struct Jump {
    /// End of the last rest before it.
    pub after: Stamp,
    /// Start of the first rest behind it.
    pub before: Stamp,
    /// Parameter that changed, and by how much.
    pub what: String,
}

/// One parameter, axis by axis.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name and unit.
    pub caption: &'static str,
    /// Time of a recording, value, and standard deviation, oldest first.
    pub points: Vec<(Stamp, [f64; 3], [f64; 3])>,
}
