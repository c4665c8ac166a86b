//! Scale of a gyroscope about the vertical, beside a solution that lacks its sensitivity.

use nalgebra::SVector;

use super::fit_inputs::FitInputs;
use super::rest_history::JudgedRest;
use super::rest_judge::Judge;
use super::solution::Solution;
use super::turn_trial;
use crate::fit::Parameterisation;
use crate::fit::turn_fit::{VerticalScale, vertical_scales};
use crate::messages::Combination;

/// Half the width of a 95 % interval, in standard deviations.
const HALF: f64 = 1.96;

/// Learns from turns whose rotation about the vertical is known.
pub(super) fn learn(
    entries: &[JudgedRest],
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
    solution: &Solution,
) -> Vec<Combination> {
    /// Error of directions of gravity by an accelerometer that is calibrated, or not, rad.
    const TILTS: [f64; 2] = [0.002, 0.02];
    let is_open = solution.gyroscope.as_ref().is_some_and(|fit| fit.shape == Parameterisation::BIAS);
    let is_known = !inputs.rotations.declared.is_empty() || judge.fit.whole_turns || inputs.rotations.heading.is_some();
    if !is_open || !(is_known || inputs.past_turns.iter().any(|turn| turn.known.is_some())) {
        return Vec::new();
    }
    let (accelerometer, tilt) = match &solution.accelerometer {
        Ok(fit) => (fit.calibration(), TILTS[0]),
        Err(_) => (solution.guessed, TILTS[1]),
    };
    let session = turn_trial::declared_session(entries, judge, inputs, &accelerometer);
    vertical_scales(&session, &accelerometer, tilt).iter().map(combination).collect()
}

/// Sum of the entries of S that the scale about the vertical u is, uᵀ S u.
fn combination(found: &VerticalScale) -> Combination {
    /// Steps to which a direction is rounded, so that it is the same from rest to rest.
    const STEPS: f64 = 50.0;
    let rounded = found.up.map(|part| (part * STEPS).round() / STEPS);
    let up = rounded.try_normalize(f64::MIN_POSITIVE).unwrap_or(found.up);
    let mut coefficients = SVector::<f64, 12>::zeros();
    for (entry, coefficient) in coefficients.iter_mut().skip(3).enumerate() {
        *coefficient = up[entry / 3] * up[entry % 3];
    }
    Combination {
        coefficients: coefficients.as_slice().to_vec(),
        value: found.value,
        std: found.std,
        explanation: format!(
            "scale about the vertical ({:.2} {:.2} {:.2} in its axes) = {:.4} ± {:.4}, by {} turns",
            up.x,
            up.y,
            up.z,
            found.value,
            HALF * found.std,
            found.turns
        ),
    }
}
