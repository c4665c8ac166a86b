//! Solves for what the stored rests determine of each triad.

use nalgebra::{DVector, Vector3};

use super::advice;
use super::config::Config;
use super::fit_inputs::{FitInputs, per_axis};
use super::model_trial::{self, ModelTrial, Trial};
use super::observations::{self, Placed};
use super::partial::Partial;
use super::preset::secondary_bounds;
use super::refusal::{Refusal, held_back};
use super::rest_history::{JudgedRest, Verdict};
use super::rest_judge::{Judge, Poses};
use super::solution::{Missing, Solution};
use super::turn_trial;
use crate::fit::{
    self, Calibration, Check, EarthLocation, Estimate, Fixture, Gravity, Model, Parameterisation, Reading, Source,
    Term, directions, guess, gyroscope, secondary,
};
use crate::imu::{SecondaryModel, Sensor};
use crate::messages::segment::Reason;
use crate::turns::{Explanation, angle_between};

/// Least duration of rests before a gyroscope's bias is accepted, in multiples of the shortest rest that is fitted: a
/// slow turn may pass for a rest until a quieter one is seen.
const LEAST_RESTS: f64 = 3.0;

/// Gravity for the fit.
pub(super) fn gravity(config: &fit::Config, fix: Option<EarthLocation>) -> Gravity {
    match (config.gravity, config.place(), fix) {
        (Some(value), place, fix) => Gravity { place: place.or(fix), ..Gravity::configured(value) },
        (None, Some(place), _) => Gravity::at(&place, Source::Latitude),
        (None, None, Some(place)) => Gravity::at(&place, Source::FixTopic),
        (None, None, None) => Gravity::standard(),
    }
}

/// Judges every rest anew and fits what the accepted ones, or a reference, determine.
pub(super) fn solve(
    entries: &mut [JudgedRest],
    judge: &Judge<'_>,
    config: &Config,
    inputs: &FitInputs<'_>,
) -> Solution {
    let models = candidates(config.fit.model, inputs.reference.is_some());
    let solution = solve_by(models, entries, judge, config, inputs);
    if config.fit.model != Model::Triangular || solution.accelerometer.is_ok() {
        return solution;
    }
    // The turns may add to six faces what spread poses would tell.
    let beside_turns = solve_by(&[Parameterisation::DIAGONAL], entries, judge, config, inputs);
    match &beside_turns.accelerometer {
        Ok(fit) if fit.shape == Parameterisation::TRIANGULAR => beside_turns,
        _ => solve_by(models, entries, judge, config, inputs),
    }
}

/// Fits the first of these models that is determined and checked.
fn solve_by(
    candidates: &[Parameterisation],
    entries: &mut [JudgedRest],
    judge: &Judge<'_>,
    config: &Config,
    inputs: &FitInputs<'_>,
) -> Solution {
    judge.sort_out(entries);
    let faultless = entries.iter().filter(|entry| entry.verdict.is_accepted());
    let means: Vec<_> = faultless.map(|entry| entry.rest.accelerometer.mean).collect();
    let start = guess(means.iter(), judge.gravity);
    let verdicts: Vec<Verdict> = entries.iter().map(|entry| entry.verdict.clone()).collect();

    let mut refused = Vec::new();
    let mut trial = ModelTrial::new(Poses::OnFaces);
    let mut unchecked_richer: Option<(ModelTrial, Vec<Verdict>, usize)> = None;
    for &shape in candidates {
        entries.iter_mut().zip(&verdicts).for_each(|(entry, verdict)| entry.verdict = verdict.clone());
        trial = match inputs.reference {
            Some(reference) if beside_reference(shape) => {
                model_trial::on_reference(entries, judge, &Trial { shape, inputs }, reference, start)
            }
            _ => model_trial::on_rests(entries, judge, &Trial { shape, inputs }, start),
        };
        match &trial.fit {
            // A simpler model may err by less than what a wrong rest could hide here.
            Ok(fit) if candidates.last() != Some(&shape) && !fit.is_checked() => {
                let verdicts = entries.iter().map(|entry| entry.verdict.clone()).collect();
                let richer = std::mem::replace(&mut trial, ModelTrial::new(Poses::OnFaces));
                unchecked_richer = Some((richer, verdicts, refused.len()));
            }
            Ok(_) => break,
            Err(why) => refused.push((shape, why.clone())),
        }
    }
    if let Some((richer, verdicts, refused_before)) = unchecked_richer {
        let error = |trial: &ModelTrial| trial.fit.as_ref().ok().map(|fit| fit.worst_case_error(inputs.gravity.value));
        match (error(&richer), error(&trial)) {
            (Some(worst), Some(simpler)) if simpler < worst => {
                refused.extend(richer.fit.iter().map(|fit| (fit.shape, Refusal::Unchecked { worst, simpler })));
            }
            _ => {
                refused.truncate(refused_before);
                entries.iter_mut().zip(verdicts).for_each(|(entry, verdict)| entry.verdict = verdict);
                trial = richer;
            }
        }
    }
    if trial.fit.is_err() {
        refused.pop();
    }
    let mut turning = trial.fit.as_ref().ok().and_then(|fit| turn_trial::fit(entries, judge, inputs, fit));
    let shape = trial.fit.as_ref().ok().map(|fit| fit.shape);
    if let Some(shape) = shape.filter(|shape| inputs.reference.is_none() || !beside_reference(*shape)) {
        trial.look_for_drift(entries, judge, &Trial { shape, inputs }, start, turning.as_ref());
    }
    if let Some(turning) = &mut turning {
        turn_trial::complete(&mut trial, turning, judge, inputs);
        refused.retain(|(shape, _)| !(turning.completed && *shape == Parameterisation::TRIANGULAR));
    }
    let primary = trial.fit.as_ref().ok();
    let unchecked = primary.map_or(Vec::new(), |fit| unchecked(fit, &trial.seen, judge.fixture));
    let advice =
        advice::PoseAdviser { entries, judge, inputs, trial: &trial, turning: turning.as_ref() }.advise(&unchecked);
    let solution = others(entries, judge, config, inputs, refused, trial);
    Solution { guessed: start, unchecked, advice, ..turn_trial::of_gyroscope(solution, turning) }
}

/// Models to try, the richest first.
fn candidates(model: Model, reference: bool) -> &'static [Parameterisation] {
    match model {
        Model::Full => &[Parameterisation::FULL_ACCELEROMETER],
        Model::Auto if reference => {
            &[Parameterisation::FULL_ACCELEROMETER, Parameterisation::TRIANGULAR, Parameterisation::DIAGONAL]
        }
        Model::Auto => &[Parameterisation::TRIANGULAR, Parameterisation::DIAGONAL],
        Model::BiasScale => &[Parameterisation::DIAGONAL],
        Model::Triangular => &[Parameterisation::TRIANGULAR],
        Model::CrossAxis => &[Parameterisation::MATRIX],
    }
}

/// Whether a model of the accelerometer is fitted to a reference if there is one.
fn beside_reference(shape: Parameterisation) -> bool {
    shape == Parameterisation::FULL_ACCELEROMETER || shape == Parameterisation::MATRIX
}

/// Fits the other triads, beside a trial of the primary accelerometer.
fn others(
    entries: &[JudgedRest],
    judge: &Judge<'_>,
    Config { fit: config, secondary, still, .. }: &Config,
    inputs: &FitInputs<'_>,
    refused: Vec<(Parameterisation, Refusal)>,
    ModelTrial { fit: accelerometer, seen, ups, poses, doubts, drift, .. }: ModelTrial,
) -> Solution {
    let primary = accelerometer.as_ref().ok();
    let secondary = secondary.iter().enumerate().map(|(i, secondary)| {
        let mut bounds = config.bounds.clone();
        let mut placement_std = config.placement_std;
        if let Some(preset) = secondary.preset {
            bounds = secondary_bounds(bounds, preset);
            placement_std = preset.datasheet().accelerometer.placement.unwrap_or(placement_std);
        }
        fit_secondary(entries, (i, secondary.model), &fit::Config { bounds, placement_std, ..config.clone() }, primary)
    });
    let secondary = secondary.collect();
    let calibration = primary.map(Estimate::calibration);
    let noise = observations::gyroscope_noise(judge.segmenter);
    let mut rates = observations::rates(entries, noise, config, calibration.as_ref());
    if let Some(place) = inputs.gravity.place {
        rates.iter_mut().for_each(|reading| turn_with_the_earth(reading, &place));
    }
    let at_rest = entries.iter().filter(|entry| observations::tells_of_rates(entry, noise));
    let believed = at_rest.map(|entry| entry.seconds).sum::<f64>() >= LEAST_RESTS * still.min_fit_s;
    let gyroscope = |shape| gyroscope::fit(shape, &rates, config.rate_std, &config.bounds, config.loss);
    let credible = entries.iter().filter(|entry| observations::tells_of_rates(entry, noise)).count();
    // Until the accelerometer is calibrated its raw reading is vertical enough.
    let vertical = observations::rates(entries, noise, config, Some(&calibration.unwrap_or_default()));
    let tells_bias = tells_bias_from_turn(&vertical);
    let refusal = steady_turn(entries, &vertical, credible, tells_bias, still.max_turn / 2.0);
    let floor = judge.segmenter.status().gyro_floor.map(per_axis);
    let rich = match (primary.map(|fit| fit.shape), inputs.reference) {
        (Some(Parameterisation::FULL_ACCELEROMETER), Some(reference)) => {
            reference.gyroscope(Parameterisation::FULL_GYROSCOPE, config, floor).ok()
        }
        (Some(Parameterisation::MATRIX), Some(reference)) => {
            reference.gyroscope(Parameterisation::GYROSCOPE_AT_REST, config, floor).ok()
        }
        (Some(Parameterisation::MATRIX), None) => gyroscope(Parameterisation::GYROSCOPE_AT_REST).ok(),
        _ => None,
    };
    Solution {
        gravity: inputs.gravity,
        placements: seen.len(),
        missing: match poses {
            _ if config.model == Model::Full => Missing::Motion,
            Poses::Any => Missing::Direction(unseen(&ups)),
            Poses::OnFaces => Missing::Faces,
        },
        unchecked: Vec::new(),
        advice: None,
        coarse_step: inputs.step.filter(|&step| observations::is_coarse(entries, step)),
        accelerometer,
        refused,
        doubts: doubts.into_iter().map(|doubt| doubt.text).collect(),
        drift,
        temperature: None,
        partial: Partial::nothing(),
        heading_doubt: None,
        gyro_placements: rates.len(),
        gyro_relaxed: entries
            .iter()
            .filter(|entry| entry.verdict.is_at_rest())
            .find_map(|entry| observations::relaxed(entry, noise)),
        gyro_turned: entries.iter().filter(|entry| entry.verdict.reason == Reason::Turning).count(),
        gyro_posed: tells_bias,
        gyroscope: rich
            .or_else(|| gyroscope(Parameterisation::BIAS).ok().filter(|_| believed && refusal.is_none()))
            .map(|mut fit| {
                if !tells_bias && fit.shape == Parameterisation::BIAS {
                    doubt_vertical(&mut fit, &vertical);
                }
                let step = judge.segmenter.signal(Sensor::Gyroscope).and_then(|signal| signal.step);
                doubt_rounding(&mut fit, &observations::rate_rounding(entries, step.unwrap_or(0.0)));
                fit
            }),
        gyro_at_rest: None,
        turning: None,
        gyro_refusal: refusal.filter(|_| believed),
        secondary,
        guessed: Calibration::default(),
        faults: Vec::new(),
        turned: Explanation::Unknown,
        unit_confirmed: false,
        hold_s: judge.segmenter.hold_s(),
    }
}

/// Adds the Earth's rotation to the true rate at rest: only its vertical component, since north is unknown.
fn turn_with_the_earth(reading: &mut Reading, place: &EarthLocation) {
    if let Some(up) = reading.truth.other.try_normalize(f64::MIN_POSITIVE) {
        reading.truth.own = up * place.vertical_rate();
    }
}

/// Names the face, edge or corner of a cube that is furthest from every direction seen, by its axes.
fn unseen(ups: &[Vector3<f64>]) -> String {
    let nearness = |direction: &Vector3<f64>| ups.iter().map(|up| up.dot(direction)).fold(-1.0, f64::max);
    let furthest = directions().min_by(|a, b| nearness(a).total_cmp(&nearness(b))).unwrap_or_default();
    let axes = ["X", "Y", "Z"].into_iter().zip(&furthest).filter(|(_, part)| **part != 0.0);
    let axes: Vec<_> = axes.map(|(axis, part)| format!("{}{axis}", if *part > 0.0 { "+" } else { "-" })).collect();
    match axes.as_slice() {
        [axis] => axis.clone(),
        axes => format!("the direction between {}", axes.join(" and ")),
    }
}

/// Names of the faces whose placements are not checked well enough, the least checked first.
fn unchecked(fit: &Estimate, seen: &[Placed], fixture: &Fixture) -> Vec<String> {
    let Some(reliability) = &fit.reliability else { return Vec::new() };
    // An accurate fixture gives an equation for each axis.
    let per_placement = (reliability.checks.len() / seen.len().max(1)).max(1);
    let mut weak: Vec<_> = reliability.checks.chunks(per_placement).zip(seen).collect();
    weak.retain(|(checks, _)| !checks.iter().all(Check::is_enough));
    let least = |checks: &[Check]| checks.iter().map(|check| check.redundancy).fold(1.0, f64::min);
    let mut weak: Vec<_> = weak.into_iter().map(|(checks, placed)| (least(checks), placed)).collect();
    weak.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut names: Vec<String> = Vec::new();
    for (_, placed) in weak {
        let name = fixture.faces().get(placed.face).map_or("?", |face| face.name.as_str());
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    names
}

/// Whether rests tell a bias from a steady turn about the vertical, as on a turntable: in poses with different verticals,
/// or in so many placements that they would not all have turned at one rate.
fn tells_bias_from_turn(rates: &[Reading]) -> bool {
    /// Least angle between two verticals, rad.
    const OTHER_POSE: f64 = 0.35;
    const MANY: usize = 4;
    let first = rates.first().map_or(Vector3::zeros(), |reading| reading.truth.other);
    let turned = |reading: &Reading| angle_between(&reading.truth.other, &first) > OTHER_POSE;
    rates.len() >= MANY || rates.iter().any(turned)
}

/// Refusal of a gyroscope's bias: too many rests that turned, or a rate about the vertical in a single pose.
fn steady_turn(
    entries: &[JudgedRest],
    rates: &[Reading],
    at_rest: usize,
    tells_bias: bool,
    most: f64,
) -> Option<Refusal> {
    let turning = entries.iter().filter(|entry| entry.verdict.reason == Reason::Turning).count();
    // Most rests must agree before the others count as turning.
    if 2 * turning > at_rest {
        return Some(Refusal::Turning { turning, rests: turning + at_rest });
    }
    let rate = rates.iter().map(about_vertical).fold(0.0, |most: f64, rate| most.max(rate.abs()));
    (!tells_bias && rate > most).then_some(Refusal::OneRun { rate })
}

/// Widens the bias for a single pose, where the rate about the vertical may be a turn as well as a bias.
fn doubt_vertical(fit: &mut Estimate, rates: &[Reading]) {
    let Some(reading) = rates.iter().max_by(|a, b| about_vertical(a).abs().total_cmp(&about_vertical(b).abs())) else {
        return;
    };
    let Some(up) = reading.truth.other.try_normalize(f64::MIN_POSITIVE) else { return };
    let turn = up * about_vertical(reading);
    fit.widen(&DVector::from_iterator(3, turn.iter().copied()));
}

/// Widens the bias of a gyroscope by the error of rounding on each axis, rad/s.
fn doubt_rounding(fit: &mut Estimate, error: &Vector3<f64>) {
    for (axis, error) in error.iter().enumerate().filter(|(_, error)| **error > 0.0) {
        let moved = fit.shape.terms().iter().map(|term| if *term == Term::Bias(axis) { *error } else { 0.0 });
        fit.widen(&DVector::from_iterator(fit.shape.unknowns(), moved));
    }
}

/// Rate about the vertical, rad/s.
fn about_vertical(reading: &Reading) -> f64 {
    reading.truth.other.try_normalize(f64::MIN_POSITIVE).map_or(0.0, |up| reading.mean.dot(&up))
}

fn fit_secondary(
    entries: &[JudgedRest],
    (index, model): (usize, SecondaryModel),
    config: &fit::Config,
    primary: Option<&Estimate>,
) -> Result<Estimate, Refusal> {
    let primary = primary.ok_or(Refusal::WaitsForPrimary)?;
    let pairs = observations::pairs(entries, config, index);
    if pairs.is_empty() {
        return Err(Refusal::Silent);
    }
    let fit = |shape| secondary::fit(shape, &pairs, primary, config.placement_std, &config.bounds, config.loss);
    let shape = match model {
        SecondaryModel::BiasScale => Parameterisation::DIAGONAL,
        SecondaryModel::CrossAxis => Parameterisation::MATRIX,
    };
    let (fit, with) = (fit(shape)?, fit);
    if !fit.agrees() {
        return Err(Refusal::DoesNotFollow {
            rms: fit.residual_rms,
            limit: fit.residual_limit,
            turned: shape == Parameterisation::DIAGONAL
                && with(Parameterisation::MATRIX).is_ok_and(|other| other.agrees()),
            at_bounds: held_back(&fit),
        });
    }
    Ok(fit)
}
