//! Placements as partial knowledge comes from them, and their disagreement.

use crate::fit::accelerometer::Observation;

/// Placement of an accelerometer, on a face of the fixture or on none.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// Readings of the placement.
    pub observation: Observation,
    /// Face that it lies on, if it does.
    pub face: Option<usize>,
}

/// Placements on one face that read differently.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disagreement {
    /// Root mean square of the differences from their mean, m/s².
    pub rms: f64,
    /// Largest rms that is believed.
    pub limit: f64,
}
