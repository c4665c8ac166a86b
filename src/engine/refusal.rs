//! Reasons why a triad is not calibrated.

use super::drift::Drift;
use crate::fit::{self, Estimate};

/// Reason why a triad is not calibrated; its text says what was seen and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum Refusal {
    /// Too few directions for a model that needs no faces.
    #[error("{needed} placements in spread directions are needed, {seen} seen")]
    TooFewPlacements {
        /// Unknowns of the model.
        needed: usize,
        /// Placements seen.
        seen: usize,
    },
    /// Missing faces of the fixture, by name.
    #[error("not seen at rest: {}", .0.join(", "))]
    FacesMissing(Vec<String>),
    /// Equations without a solution.
    #[error(transparent)]
    Unsolved(#[from] fit::Error),
    /// Too large residuals on an accurate fixture, m/s².
    #[error(
        "the faces of the fixture do not point where they should: what is left over has an rms of {rms:.3} m/s², more than \
         {limit:.3}. Is the fixture accurate, level, and of this kind? bias-scale does not need it to be{}",
        also(at_bounds)
    )]
    InaccurateFixture { rms: f64, limit: f64, at_bounds: Vec<String> },
    /// Too large residuals of ‖a‖ − g, m/s².
    #[error(
        "the rests contradict each other: ‖a‖ − g has an rms of {rms:.3} m/s², more than {limit:.3}{}",
        also(at_bounds)
    )]
    Contradicting { rms: f64, limit: f64, at_bounds: Vec<String> },
    /// Direction that the placements hardly determine; errors in m/s².
    #[error(
        "a corrected reading could err by {worst:.2} m/s² in some direction, more than {limit:.2} (condition number \
         {condition:.0}): rests between the faces would tell"
    )]
    Weak { worst: f64, limit: f64, condition: f64 },
    /// Rests that do not check each other, and a simpler model that errs by less, both in m/s².
    #[error(
        "its rests do not check each other yet: a corrected reading could err by {worst:.2} m/s², and by {simpler:.2} without it"
    )]
    Unchecked { worst: f64, simpler: f64 },
    /// Refusal that may be due to a drift.
    #[error("{why}; {}", drift.explanation())]
    Drifting { why: Box<Self>, drift: Box<Drift> },
    /// Parameters beyond the configured bounds, as texts.
    #[error("{}: set fit.bounds, or the preset, to what the sensor is", .0.join(", "))]
    BeyondBounds(Vec<String>),
    /// Rests at different constant rates.
    #[error(
        "{turning} of {rests} rests turn at a constant rate that the others do not have, and which of them stood still cannot be \
         told: let it rest where nothing turns"
    )]
    Turning { turning: usize, rests: usize },
    /// Rate about the vertical in the rests of a single pose, rad/s.
    #[error(
        "reads {rate:.4} rad/s about the vertical in the one pose that it rested in: that may be a steady turn as well as a bias. \
         Let it rest in another pose"
    )]
    OneRun { rate: f64 },
    /// Fault of the stream, as text.
    #[error("{0}")]
    Fault(String),
    /// Reference that never overlaps with the readings.
    #[error("no reading lies between samples of the reference: check its topic and its time stamps")]
    NoReference,
    /// Motion that does not determine the parameters.
    #[error(
        "the motion beside the reference does not tell the parameters apart: turn the sensor about every axis, both ways, in \
         several attitudes"
    )]
    TooLittleMotion,
    /// Too large residuals beside a reference, in the unit of the triad.
    #[error(
        "the reference does not explain the readings: what is left over has an rms of {rms:.3} {unit}, more than {limit:.3}. Check \
         its axes, units and time stamps"
    )]
    ReferenceContradicts { rms: f64, limit: f64, unit: &'static str },
    /// Secondary accelerometer without a calibrated primary to compare it with.
    #[error("waits for the calibration of the primary accelerometer")]
    WaitsForPrimary,
    /// Triad without a reading in any rest.
    #[error("was silent during every rest: check its topic and its time stamps")]
    Silent,
    /// Too large residuals of a secondary accelerometer, m/s²; `turned` if a full matrix would explain them.
    #[error(
        "does not follow the primary accelerometer: the residuals have an rms of {rms:.3} m/s², more than {limit:.3}. {}{}",
        if *turned {
            "It is turned beside it, or its axes are skewed: set its model = \"cross-axis\""
        } else {
            "Check its axes, unit and time stamps"
        },
        also(at_bounds)
    )]
    DoesNotFollow { rms: f64, limit: f64, turned: bool, at_bounds: Vec<String> },
}

impl Refusal {
    /// Whether the data are sound, but too few for all parameters.
    pub(super) fn is_of_too_little(&self) -> bool {
        matches!(
            self,
            Self::FacesMissing(_)
                | Self::TooFewPlacements { .. }
                | Self::Weak { .. }
                | Self::Unsolved(_)
                | Self::TooLittleMotion
                | Self::NoReference
        )
    }

    /// Whether further rests could make up for it.
    pub(super) fn asks_for_rests(&self) -> bool {
        match self {
            Self::BeyondBounds(_) => false,
            Self::Drifting { why, .. } => why.asks_for_rests(),
            _ => true,
        }
    }
}

/// Notes on parameters that the configured bounds hold back.
pub(super) fn held_back(fit: &Estimate) -> Vec<String> {
    let terms = fit.active.iter().filter_map(|&i| fit.shape.terms().get(i));
    terms.map(|term| format!("{} is held back by its bound: check fit.bounds and the preset", term.name())).collect()
}

/// Appends further remarks to a sentence.
fn also(remarks: &[String]) -> String {
    remarks.iter().map(|remark| format!("; {remark}")).collect()
}
