//! Estimates of all triads that the rests determine, with the evidence for and against them.

use super::drift::Drift;
use super::fault::Fault;
use super::heading_doubt::HeadingDoubt;
use super::partial::Partial;
use super::refusal::Refusal;
use super::temperature_courses::TemperatureCourses;
use super::turn_outcome::TurnOutcome;
use crate::fit::{Calibration, Estimate, Gravity, Parameterisation};
use crate::turns::Explanation;

/// Estimates that the rests determine, and the reasons for those that they do not.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) gravity: Gravity,
    /// Estimate of the accelerometer, or the reason why not.
    pub(super) accelerometer: Result<Estimate, Refusal>,
    /// Richer models than that of the accelerometer, and the reason against each.
    pub(super) refused: Vec<(Parameterisation, Refusal)>,
    pub(super) gyroscope: Option<Estimate>,
    /// Estimate of the gyroscope from its rests alone.
    pub(super) gyro_at_rest: Option<Estimate>,
    pub(super) turning: Option<TurnOutcome>,
    pub(super) secondary: Vec<Result<Estimate, Refusal>>,
    /// Number of accepted placements, on all faces.
    pub(super) placements: usize,
    /// Names of the faces whose placements are not checked well enough, the least checked first.
    pub(super) unchecked: Vec<String>,
    /// Poses to show next, where they are what is lacking.
    pub(super) advice: Option<Advice>,
    /// Quantisation step of the accelerometer, m/s², if it is so coarse relative to the noise that rounding biases the
    /// means.
    pub(super) coarse_step: Option<f64>,
    /// Number of placements in the gyroscope's bias.
    pub(super) gyro_placements: usize,
    /// Number of rests that were rejected as turns at a constant rate.
    pub(super) gyro_turned: usize,
    /// Whether the gyroscope was at rest in poses that tell its bias from a steady turn.
    pub(super) gyro_posed: bool,
    /// Reason why the gyroscope has no bias although there are readings at rest.
    pub(super) gyro_refusal: Option<Refusal>,
    /// Mean rates at the ends of a rest in which the gyroscope went to zero, rad/s, if there was one.
    pub(super) gyro_relaxed: Option<(f64, f64)>,
    /// Initial guess of the accelerometer's calibration.
    pub(super) guessed: Calibration,
    /// Faults of the streams.
    pub(super) faults: Vec<Fault>,
    /// Explanation of the turns by the gyroscope's readings.
    pub(super) turned: Explanation,
    /// Whether the gyroscope's unit is set, or confirmed by the turns.
    pub(super) unit_confirmed: bool,
    /// Contradictions that cannot be resolved, as texts.
    pub(super) doubts: Vec<String>,
    pub(super) drift: Option<Drift>,
    /// Dependence of the biases on the temperature, if the rests have one.
    pub(super) temperature: Option<TemperatureCourses>,
    /// Partial knowledge of triads that are not determined.
    pub(super) partial: Partial,
    /// Reason why no turn uses the heading reference.
    pub(super) heading_doubt: Option<HeadingDoubt>,
    /// Missing data of the accelerometer, if it is not determined.
    pub(super) missing: Missing,
    /// Time for which the sensor must be held still for a rest to count, s.
    pub(super) hold_s: u32,
}

/// Missing data of a model of the accelerometer.
#[derive(Clone, Debug)]
pub(super) enum Missing {
    /// Faces of the fixture.
    Faces,
    /// Directions; names the one furthest from those seen.
    Direction(String),
    /// Motion beside the reference.
    Motion,
}

/// Poses to show next.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Advice {
    /// Name of the pose that comes first.
    pub(super) first: String,
    /// Number of poses, with that one.
    pub(super) poses: usize,
    /// Worst-case error now and afterwards, m/s².
    pub(super) error: [f64; 2],
    /// Whether the poses are worth the effort.
    pub(super) worthwhile: bool,
}
