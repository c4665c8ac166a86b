//! Inputs of a solution beside the rests.

use super::reference::Reference;
use super::rotations::Rotations;
use crate::fit::turn_fit::TurnSeen;
use crate::fit::{Gravity, Parameterisation};
use crate::turns::History;

/// Inputs beside the rests.
pub(super) struct FitInputs<'a> {
    pub(super) gravity: Gravity,
    /// Quantisation step of the accelerometer, m/s².
    pub(super) step: Option<f64>,
    /// Model that was published last.
    pub(super) kept: Option<Parameterisation>,
    pub(super) reference: Option<&'a Reference>,
    pub(super) turns: &'a History,
    /// Turns of other recordings, between entries of the history of rests.
    pub(super) past_turns: &'a [TurnSeen],
    /// Rotations that are declared by their times.
    pub(super) rotations: Rotations<'a>,
    /// Range of the gyroscope by its datasheet, rad/s.
    pub(super) gyro_range: Option<f64>,
}

/// Noise of one axis from √(Σ variance) of three.
pub(super) fn per_axis(floor: f64) -> f64 {
    floor / 3_f64.sqrt()
}
