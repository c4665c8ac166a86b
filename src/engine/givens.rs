//! What is known beside the rests when a calibration is solved for.

use super::reference::Reference;
use crate::fit::{Gravity, Parameterisation};
use crate::turns::History;

/// Knowledge beside the rests.
pub(super) struct Givens<'a> {
    pub(super) gravity: Gravity,
    /// The accelerometer's quantisation step, m/s².
    pub(super) step: Option<f64>,
    /// The model that was published last.
    pub(super) kept: Option<Parameterisation>,
    pub(super) reference: Option<&'a Reference>,
    pub(super) turns: &'a History,
    /// What the gyroscope reads at most, rad/s, by its datasheet.
    pub(super) gyro_range: Option<f64>,
}

/// Of one axis, what is √(Σ variance) of three.
pub(super) fn per_axis(floor: f64) -> f64 {
    floor / 3_f64.sqrt()
}
