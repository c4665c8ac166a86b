//! Estimates of every triad that the rests determine, with what speaks for and against them.

use super::drift::Drift;
use super::fault::Fault;
use super::refusal::Refusal;
use super::turn_outcome::Turning;
use crate::fit::{Calibration, Estimate, Gravity, Parameterisation};
use crate::turns::Explanation;

/// Estimates that the rests determine, and the reasons for those that they do not.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) gravity: Gravity,
    /// Or why not.
    pub(super) accelerometer: Result<Estimate, Refusal>,
    /// Richer models than that of the accelerometer, and why each is none.
    pub(super) refused: Vec<(Parameterisation, Refusal)>,
    pub(super) gyroscope: Option<Estimate>,
    /// The gyroscope by its rests alone.
    pub(super) gyro_at_rest: Option<Estimate>,
    pub(super) turning: Option<Turning>,
    pub(super) secondary: Vec<Result<Estimate, Refusal>>,
    /// Accepted placements, all faces together.
    pub(super) placements: usize,
    /// Placements that nothing else checks well enough, the least checked first, each by the name of its face.
    pub(super) unchecked: Vec<String>,
    /// The accelerometer's quantisation step, if it is so coarse beside the noise that rounding biases the means, m/s².
    pub(super) coarse_step: Option<f64>,
    /// Of the gyroscope's bias.
    pub(super) gyro_placements: usize,
    /// Rests that were rejected as turns at a constant rate.
    pub(super) gyro_turned: usize,
    /// Whether it lay in more than one pose, or more than once.
    pub(super) gyro_posed: bool,
    /// Why the gyroscope has no bias although it was read at rest.
    pub(super) gyro_refusal: Option<Refusal>,
    /// Mean rates at the ends of a rest in which the gyroscope went to zero, rad/s, if there was one.
    pub(super) gyro_relaxed: Option<(f64, f64)>,
    /// The accelerometer's calibration as it was guessed before anything was fitted.
    pub(super) guessed: Calibration,
    /// What speaks against the readings.
    pub(super) faults: Vec<Fault>,
    /// What the turns say of how the gyroscope reads.
    pub(super) turned: Explanation,
    /// Whether the gyroscope's unit is set, or the turns confirm it.
    pub(super) unit_confirmed: bool,
    /// What contradicts itself and cannot be decided, in words.
    pub(super) doubts: Vec<String>,
    pub(super) drift: Option<Drift>,
    /// What would determine the accelerometer if it is not.
    pub(super) missing: Missing,
}

/// What a model of the accelerometer needs more of.
#[derive(Clone, Debug)]
pub(super) enum Missing {
    /// The faces of the fixture.
    Faces,
    /// Any directions; the one furthest from those seen, by name.
    Direction(String),
    /// Motion beside the reference.
    Motion,
}
