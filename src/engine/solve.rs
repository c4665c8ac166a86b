//! From the remembered rests to what they determine of each triad. How one model of the primary accelerometer is tried is
//! left to `model_trial`, how rests become observations to `observations`.

use nalgebra::Vector3;

use super::config::Config;
use super::model_trial::{self, ModelTrial, Trial};
use super::observations::{self, Placed};
use super::preset::secondary_bounds;
use super::refusal::{Refusal, held_back};
use super::rest_history::{JudgedRest, Verdict};
use super::rest_judge::{Judge, Poses};
use super::solution::{Givens, Missing, Solution, per_axis};
use super::turning;
use crate::fit::{
    self, Calibration, Estimate, Gravity, Model, Parameterisation, Place, Reading, Source, directions, guess,
    gyroscope, secondary,
};
use crate::imu::SecondaryModel;

/// A slow turn may pass for a rest until a quieter one is seen: so many times the least rest that is fitted must have been
/// seen before a gyroscope's bias is believed.
const LEAST_RESTS: f64 = 3.0;

/// The gravity to fit with.
pub(super) fn gravity(config: &fit::Config, fix: Option<Place>) -> Gravity {
    match (config.gravity, config.place(), fix) {
        (Some(value), place, fix) => Gravity { place: place.or(fix), ..Gravity::configured(value) },
        (None, Some(place), _) => Gravity::at(&place, Source::Latitude),
        (None, None, Some(place)) => Gravity::at(&place, Source::FixTopic),
        (None, None, None) => Gravity::standard(),
    }
}

/// Judges every rest anew and fits what the good ones, or a reference, determine.
pub(super) fn solve(entries: &mut [JudgedRest], judge: &Judge<'_>, config: &Config, givens: &Givens<'_>) -> Solution {
    judge.sort_out(entries);
    let faultless = entries.iter().filter(|entry| entry.verdict.is_accepted());
    let means: Vec<_> = faultless.map(|entry| entry.rest.accelerometer.mean).collect();
    let start = guess(means.iter(), judge.gravity);
    let verdicts: Vec<Verdict> = entries.iter().map(|entry| entry.verdict.clone()).collect();

    let mut refused = Vec::new();
    let mut attempt = ModelTrial::new(Poses::OnFaces);
    for &shape in candidates(config.fit.model, givens.reference.is_some()) {
        entries.iter_mut().zip(&verdicts).for_each(|(entry, verdict)| entry.verdict = verdict.clone());
        attempt = match givens.reference {
            Some(reference) if beside_reference(shape) => {
                model_trial::on_reference(entries, judge, &Trial { shape, givens }, reference, start)
            }
            _ => model_trial::on_rests(entries, judge, &Trial { shape, givens }, start),
        };
        match &attempt.fit {
            Ok(_) => break,
            Err(why) => refused.push((shape, why.clone())),
        }
    }
    if attempt.fit.is_err() {
        refused.pop();
    }
    let mut turning = attempt.fit.as_ref().ok().and_then(|fit| turning::fit(entries, judge, givens, fit));
    if let Some(turning) = &mut turning {
        turning::complete(&mut attempt, turning, judge, givens);
        refused.retain(|(shape, _)| !(turning.completed && *shape == Parameterisation::TRIANGULAR));
    }
    let solution = others(entries, judge, config, givens, refused, attempt);
    Solution { guessed: start, ..turning::of_gyroscope(solution, turning) }
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

/// Whether a model of the accelerometer is fitted on a reference where there is one.
fn beside_reference(shape: Parameterisation) -> bool {
    shape == Parameterisation::FULL_ACCELEROMETER || shape == Parameterisation::MATRIX
}

/// Fits the other triads that the rests determine, beside an attempt at the primary accelerometer.
fn others(
    entries: &[JudgedRest],
    judge: &Judge<'_>,
    Config { fit: config, secondary, still, .. }: &Config,
    givens: &Givens<'_>,
    refused: Vec<(Parameterisation, Refusal)>,
    ModelTrial { fit: accelerometer, seen, ups, poses, doubts, drift }: ModelTrial,
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
    if let Some(place) = givens.gravity.place {
        rates.iter_mut().for_each(|reading| turn_with_the_earth(reading, &place));
    }
    let at_rest = entries.iter().filter(|entry| observations::tells_of_rates(entry, noise));
    let believed = at_rest.map(|entry| entry.seconds).sum::<f64>() >= LEAST_RESTS * still.min_fit_s;
    let gyroscope = |shape| gyroscope::fit(shape, &rates, config.rate_std, &config.bounds, config.loss);
    let floor = judge.segmenter.status().gyro_floor.map(per_axis);
    let rich = match (primary.map(|fit| fit.shape), givens.reference) {
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
        gravity: givens.gravity,
        placements: seen.len(),
        missing: match poses {
            _ if config.model == Model::Full => Missing::Motion,
            Poses::Any => Missing::Direction(unseen(&ups)),
            Poses::OnFaces => Missing::Faces,
        },
        repeats: primary.map_or(0, |_| repeats(&seen, &ups, poses)),
        coarse_step: givens.step.filter(|&step| observations::is_coarse(entries, step)),
        accelerometer,
        refused,
        doubts: doubts.into_iter().map(|doubt| doubt.text).collect(),
        drift,
        gyro_placements: rates.len(),
        gyro_relaxed: entries
            .iter()
            .filter(|entry| entry.verdict.is_at_rest())
            .find_map(|entry| observations::relaxed(entry, noise)),
        gyroscope: rich.or_else(|| gyroscope(Parameterisation::BIAS).ok().filter(|_| believed)),
        gyro_at_rest: None,
        turning: None,
        secondary,
        guessed: Calibration::default(),
        faults: Vec::new(),
    }
}

/// At rest a gyroscope turns with the Earth. About the vertical, that is; where north is, nobody knows.
fn turn_with_the_earth(reading: &mut Reading, place: &Place) {
    if let Some(up) = reading.truth.other.try_normalize(f64::MIN_POSITIVE) {
        reading.truth.own = up * place.vertical_rate();
    }
}

/// The face, edge or corner of a cube that is furthest from every direction seen, by the axes between which it lies.
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

/// Placements beyond those that the model needs. No more than three in one direction count, since a bump of the table is
/// easily taken for a placement.
fn repeats(seen: &[Placed], ups: &[Vector3<f64>], poses: Poses) -> usize {
    const MOST: usize = 3;
    /// Cosine of 15°.
    const SAME: f64 = 0.966;
    let mut directions: Vec<(Vector3<f64>, usize)> = Vec::new();
    for (placed, up) in seen.iter().zip(ups) {
        let up = if poses == Poses::OnFaces { placed.observation.normal } else { *up };
        match directions.iter_mut().find(|(known, _)| known.dot(&up) > SAME) {
            Some((_, count)) => *count += 1,
            None => directions.push((up, 1)),
        }
    }
    let counted: usize = directions.iter().map(|(_, count)| (*count).min(MOST)).sum();
    let needed = if poses == Poses::OnFaces { directions.len() } else { Parameterisation::TRIANGULAR.unknowns() };
    counted.saturating_sub(needed)
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
