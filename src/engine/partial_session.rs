//! Partial knowledge: what the rests determine of an accelerometer, and turns of a gyroscope, while they do not determine all
//! of it.

use nalgebra::Vector3;

use super::config::{Config, Secondary};
use super::fit_inputs::FitInputs;
use super::model_trial::{Trial, assumptions};
use super::observations;
use super::partial::Partial;
use super::preset::secondary_bounds;
use super::refusal::Refusal;
use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use super::solution::Solution;
use super::vertical_scales;
use crate::fit::accelerometer::{Assumptions, Observation};
use crate::fit::partial::{self, Disagreement, Shown};
use crate::fit::secondary::Pair;
use crate::fit::{Bounds, Calibration, Model, Parameterisation, Term};
use crate::imu::SecondaryModel;
use crate::messages::Combination;
use crate::messages::segment::Reason;

/// Share of the largest tilt by which a sensor that is put down on a face lies off it, one standard deviation: what is
/// rejected beyond that is hardly ever a sensor lying flat.
const USUAL_TILT: f64 = 0.2;
/// Half the width of a 95 % interval, in standard deviations.
const HALF: f64 = 1.96;

/// Standard deviation of the off-diagonal entries of S of a secondary accelerometer: two packages on a board are turned
/// against each other by two degrees.
const MOUNTED: f64 = 0.035;

/// Learns from rests with their verdicts, beside a solution that lacks an accelerometer, or the gyroscope's sensitivity.
pub(super) fn learn(
    entries: &[JudgedRest],
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
    config: &Config,
    solution: &Solution,
) -> Partial {
    let session = PartialSession { entries, judge, inputs, solution };
    let secondary = config.secondary.iter().enumerate().map(|(i, secondary)| session.secondary(i, secondary));
    let gyroscope = vertical_scales::learn(entries, judge, inputs, solution);
    Partial { accelerometer: session.primary(), secondary: secondary.collect(), gyroscope }
}

struct PartialSession<'a> {
    entries: &'a [JudgedRest],
    judge: &'a Judge<'a>,
    inputs: &'a FitInputs<'a>,
    solution: &'a Solution,
}

impl PartialSession<'_> {
    fn primary(&self) -> Result<Vec<Combination>, Refusal> {
        let &Self { judge, inputs, solution, .. } = self;
        let Err(why) = &solution.accelerometer else { return Ok(Vec::new()) };
        if !why.is_of_too_little() || !solution.doubts.is_empty() {
            return Ok(Vec::new());
        }
        let shape = match judge.fit.model {
            Model::CrossAxis => Parameterisation::MATRIX,
            _ => Parameterisation::DIAGONAL,
        };
        let mut entries = self.entries.to_vec();
        let tilt = match shape {
            // An accurate fixture holds the sensor as it says, or not at all.
            Parameterisation::MATRIX => judge.fit.fixture.accuracy_deg,
            _ => {
                let tilted = entries.iter_mut().filter(|entry| entry.verdict.reason == Reason::Tilted);
                tilted.for_each(|entry| entry.verdict.reason = Reason::Accepted);
                USUAL_TILT * judge.fit.max_tilt_deg
            }
        };
        let placed = observations::placements(&entries, judge, Poses::Any, inputs.step);
        let shown = placed.iter().map(|placed| {
            let face = self.face(&placed.observation.mean).filter(|(face, _)| *face == placed.face);
            Shown { observation: placed.observation, face: face.map(|(face, _)| face) }
        });
        let shown: Vec<_> = shown.collect();
        let given = assumptions(judge, &Trial { shape, inputs }, solution.guessed);
        let found = partial::combinations(&shown, &given, tilt.to_radians())
            .map_err(|Disagreement { rms, limit }| Refusal::Contradicting { rms, limit, at_bounds: Vec::new() })?;
        Ok(found.iter().map(message).collect())
    }

    /// Face that a reading of the primary accelerometer is near, and the direction of its normal.
    fn face(&self, measured: &Vector3<f64>) -> Option<(usize, Vector3<f64>)> {
        let Judge { fixture, fit, .. } = self.judge;
        let (face, tilt) = fixture.nearest(&self.solution.guessed.correct(measured))?;
        let normal = fixture.faces().get(face)?.normal;
        (tilt <= fit.max_tilt_deg).then_some((face, normal))
    }

    /// Combinations of a secondary accelerometer that waits for the primary one, whose faces it has.
    fn secondary(&self, index: usize, secondary: &Secondary) -> Vec<Combination> {
        let &Self { entries, judge, inputs, solution } = self;
        let waits = matches!(solution.secondary.get(index), Some(Err(Refusal::WaitsForPrimary)));
        let is_sound = matches!(&solution.accelerometer, Err(why) if why.is_of_too_little());
        if !waits || !is_sound || secondary.model != SecondaryModel::BiasScale {
            return Vec::new();
        }
        let (mut bounds, mut placement_std) = (judge.fit.bounds.clone(), judge.fit.placement_std);
        if let Some(preset) = secondary.preset {
            bounds = secondary_bounds(bounds, preset);
            placement_std = preset.datasheet().accelerometer.placement.unwrap_or(placement_std);
        }
        let bounds = Bounds { accel_bias: bounds.secondary_bias, accel_scale: bounds.secondary_scale, ..bounds };
        let shown = observations::pairs(entries, judge.fit, index).into_iter().filter_map(|pair| {
            let (face, normal) = self.face(&pair.primary)?;
            let Pair { placement, secondary: mean, secondary_noise: noise, .. } = pair;
            Some(Shown { observation: Observation { placement, mean, noise, normal }, face: Some(face) })
        });
        let shown: Vec<_> = shown.collect();
        // On the side of its bias where gravity is.
        let off = shown.iter().map(|shown| shown.observation.mean - shown.observation.normal * judge.gravity);
        let bias = off.sum::<Vector3<f64>>() / shown.len().max(1) as f64;
        let shape = Parameterisation::DIAGONAL;
        let given = Assumptions {
            placement_std,
            cross_axis_std: libm::hypot(judge.fit.cross_axis_std, MOUNTED),
            nonlinearity: 0.0,
            bounds: &bounds,
            ..assumptions(judge, &Trial { shape, inputs }, Calibration { bias, ..Calibration::default() })
        };
        let tilt = USUAL_TILT * judge.fit.max_tilt_deg.to_radians();
        let found = partial::combinations(&shown, &given, tilt).unwrap_or_default();
        found.iter().map(message).collect()
    }
}

fn message(found: &partial::Combination) -> Combination {
    Combination {
        coefficients: found.coefficients.as_slice().to_vec(),
        value: found.value,
        std: found.std,
        explanation: text(found.coefficients.as_slice(), found.value, found.std),
    }
}

/// A sum as people write it, with half of its 95 % interval: coefficients of the biases, then of S row by row.
pub(super) fn text(coefficients: &[f64], value: f64, std: f64) -> String {
    let mut text = String::new();
    let mut has_bias = false;
    for (term, coefficient) in Parameterisation::MATRIX.terms().iter().zip(coefficients) {
        if *coefficient == 0.0 {
            continue;
        }
        let name = match *term {
            Term::Own(row, column) if row == column => format!("scale {}", ["x", "y", "z"][row]),
            term => term.name(),
        };
        has_bias |= matches!(term, Term::Bias(_));
        text += match (text.is_empty(), *coefficient < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        text += &match coefficient.abs() {
            1.0 => name,
            factor => format!("{factor:.3} · {name}"),
        };
    }
    let half = HALF * std;
    // The decimals of the half's first two digits.
    let decimals = (1.0 - libm::floor(libm::log10(half.max(1e-9)))).clamp(0.0, 9.0) as usize;
    let value = format!("{value:.decimals$}");
    let unit = if has_bias { " m/s²" } else { "" };
    format!("{text} = {value} ± {half:.decimals$}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_reads_as_people_write_it() {
        let mut found = partial::Combination { coefficients: nalgebra::SVector::zeros(), value: 9.8731, std: 0.0102 };
        (found.coefficients[0], found.coefficients[3]) = (1.0, 9.80665);
        assert_eq!(
            text(found.coefficients.as_slice(), found.value, found.std),
            "bias x + 9.807 · scale x = 9.873 ± 0.020 m/s²"
        );
        (found.coefficients[3], found.value) = (-9.80665, -9.7);
        assert_eq!(
            text(found.coefficients.as_slice(), found.value, found.std),
            "bias x - 9.807 · scale x = -9.700 ± 0.020 m/s²"
        );
        found.coefficients.fill(0.0);
        (found.coefficients[7], found.value, found.std) = (1.0, 1.00234, 0.000_9);
        assert_eq!(text(found.coefficients.as_slice(), found.value, found.std), "scale y = 1.0023 ± 0.0018");
    }
}
