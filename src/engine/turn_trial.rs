//! Fit to the turns between the stored rests: the gyroscope's sensitivity, and with it the accelerometer's off-diagonal
//! entries.

use nalgebra::{DVector, Vector3};

use super::fit_inputs::FitInputs;
use super::model_trial::{ModelTrial, Trial, assumptions};
use super::observations;
use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use super::solution::Solution;
use super::turn_outcome::TurnOutcome;
use crate::Stamp;
use crate::fit::accelerometer::{Observation, fit_with};
use crate::fit::turn_fit::{self, RestSeen, Told, TooLittle, TurnEstimate, TurnFit, TurnSeen, TurnSession};
use crate::fit::{Calibration, Estimate, Estimator, Loss, Model, Parameterisation};
use crate::still::TriadMean;
use crate::turns::Unusable;

/// Fits the turns beside an accelerometer; `None` if there are no turns.
pub(super) fn fit(
    entries: &[JudgedRest],
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
    accelerometer: &Estimate,
) -> Option<TurnOutcome> {
    let noise = observations::gyroscope_noise(judge.segmenter);
    let (first, mut session, unusable) = session(inputs, entries, noise);
    if session.turns.is_empty() && unusable.is_empty() {
        return None;
    }
    session.declare(&accelerometer.calibration(), judge.fit.whole_turns);
    let scatter = accelerometer.placement_std.first().copied().unwrap_or(judge.fit.placement_std);
    let TurnFit { estimate, bias_courses } = turn_fit::fit(&session, accelerometer, scatter.max(MIN_SCATTER));
    let within = |found: &TurnEstimate| {
        let bounds = &judge.fit.bounds;
        (0..9).all(|k| {
            let (row, column) = (k / 3, k % 3);
            let bound = if row == column { &bounds.gyro_scale } else { &bounds.gyro_cross_axis };
            bound.contains(row, found.sensitivity[(row, column)])
        })
    };
    let found = estimate.and_then(|found| if within(&found) { Ok(found) } else { Err(TooLittle::Unsolved) });
    let courses = bias_courses.map(|courses| (first, courses));
    Some(TurnOutcome { found, unusable, courses, completed: false })
}

/// Rests and the turns between them, with what is known of their rotations about the vertical.
pub(super) fn declared_session(
    entries: &[JudgedRest],
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
    accelerometer: &Calibration,
) -> TurnSession {
    let (_, mut session, _) = session(inputs, entries, observations::gyroscope_noise(judge.segmenter));
    session.declare(accelerometer, judge.fit.whole_turns);
    session
}

/// Least scatter of placements, m/s².
const MIN_SCATTER: f64 = 5e-4;

/// Gyroscope estimate with the results of the turns.
pub(super) fn of_gyroscope(solution: Solution, turning: Option<TurnOutcome>) -> Solution {
    let at_rest = solution.gyroscope.clone();
    let found = turning.as_ref().and_then(|turning| turning.found.as_ref().ok());
    let gyroscope = match (&at_rest, found) {
        (Some(bias), Some(found)) if bias.shape == Parameterisation::BIAS => Some(found.with_bias(bias)),
        _ => at_rest.clone(),
    };
    Solution { gyroscope, gyro_at_rest: at_rest, turning, ..solution }
}

/// Improves the accelerometer by the turns if that reduces its error: one on the faces becomes triangular.
pub(super) fn complete(trial: &mut ModelTrial, turning: &mut TurnOutcome, judge: &Judge<'_>, inputs: &FitInputs<'_>) {
    let config = judge.fit;
    let (Ok(found), Ok(fit)) = (&turning.found, &trial.fit) else { return };
    let wanted = match config.model {
        Model::Auto => true,
        // What is asked for by name is that of the rests, if they determine it.
        Model::Triangular => fit.shape == Parameterisation::DIAGONAL,
        _ => false,
    };
    if !wanted || config.estimator != Estimator::Magnitude || config.loss != Loss::Square {
        return;
    }
    let richer = match (fit.shape, trial.poses) {
        (Parameterisation::TRIANGULAR, _) => richer(trial, fit, found, judge, inputs),
        (Parameterisation::DIAGONAL, Poses::OnFaces) if found.completes() => richer(trial, fit, found, judge, inputs),
        _ => None,
    };
    let gravity = inputs.gravity.value;
    let richer = richer.filter(|richer| richer.agrees());
    if let Some(richer) = richer.filter(|richer| richer.reading_error(gravity) < fit.reading_error(gravity)) {
        trial.fit = Ok(richer);
        turning.completed = true;
    }
}

/// Triangular accelerometer from placements in these poses and the turns.
pub(super) fn triangular(
    placements: &[Observation],
    poses: Poses,
    found: &TurnEstimate,
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
) -> Option<Estimate> {
    let shape = Parameterisation::TRIANGULAR;
    let start = shape.calibration(&DVector::from_iterator(9, found.accelerometer.iter().copied()));
    let given = assumptions(judge, &Trial { shape, inputs }, start);
    let checked = fit_with(placements, &given, Some(&found.told)).ok()?;
    if poses == Poses::Any {
        return Some(checked);
    }
    // Bias and scale are those of the rests, which the turns check.
    let mut richer = fit_with(placements, &given, Some(&Told::from(&found.off_diagonals))).ok()?;
    if let (Some(own), Some(more)) = (&mut richer.reliability, &checked.reliability) {
        own.checked_by(more);
    }
    Some(richer)
}

/// Triangular accelerometer from the placements of a trial and the turns, with the doubts about the trial.
fn richer(
    trial: &ModelTrial,
    fit: &Estimate,
    found: &TurnEstimate,
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
) -> Option<Estimate> {
    let observations: Vec<_> = trial.seen.iter().map(|placed| placed.observation).collect();
    let mut richer = triangular(&observations, trial.poses, found, judge, inputs)?;
    for doubt in trial.doubts.iter().map(|doubt| &doubt.moved).chain(trial.drift.iter().map(|drift| &drift.moved)) {
        // Doubts about bias and scale on the faces; the entries below the diagonal come from the turns.
        let mut moved = DVector::zeros(richer.parameters.len());
        for (from, doubt) in doubt.iter().enumerate().take(fit.parameters.len()) {
            let to = if fit.shape == Parameterisation::TRIANGULAR { from } else { [0, 1, 2, 3, 5, 8][from] };
            moved[to] = *doubt;
        }
        richer.widen(&moved);
    }
    Some(richer)
}

/// Start of the first rest, usable turns between accepted rests, and the numbers of unusable ones by reason.
fn session(inputs: &FitInputs<'_>, entries: &[JudgedRest], noise: f64) -> (Stamp, TurnSession, Vec<(Unusable, usize)>) {
    let told = entries.iter().enumerate().filter(|(_, entry)| observations::tells_of_rates(entry, noise));
    let (places, told): (Vec<_>, Vec<_>) = told.unzip();
    let place = |start: Stamp| told.iter().position(|entry| entry.rest.start == start);
    let first = told.first().map_or(Stamp::default(), |entry| entry.rest.start);
    let rests = told.iter().filter_map(|entry| seen(entry, first)).collect();
    let (mut turns, mut unusable) = (Vec::new(), Vec::<(Unusable, usize)>::new());
    let between = inputs.turns.turns(|start| place(start).is_some());
    for turn in &between {
        if let Some(why) = turn.unusable(inputs.gyro_range) {
            match unusable.iter_mut().find(|(known, _)| *known == why) {
                Some((_, count)) => *count += 1,
                None => unusable.push((why, 1)),
            }
            continue;
        }
        let (Some(from), Some(to), true) = (place(turn.from), place(turn.to), turn.resolves(1.0)) else { continue };
        turns.push(TurnSeen {
            rests: [from, to],
            pieces: turn.pieces(),
            seconds: turn.seconds(),
            path: turn.path(),
            roughness: turn.roughness(),
            known: inputs.rotations.of(turn, || &between),
        });
    }
    for turn in inputs.past_turns {
        let [from, to] = turn.rests.map(|rest| places.binary_search(&rest));
        if let (Ok(from), Ok(to)) = (from, to) {
            turns.push(TurnSeen { rests: [from, to], ..turn.clone() });
        }
    }
    let walks = told.iter().filter_map(|entry| {
        let gyroscope = entry.rest.gyroscope.as_ref()?;
        Some(gyroscope.mean_variance().mean() * entry.rest.seconds())
    });
    let random_walk = walks.sum::<f64>() / told.len().max(1) as f64;
    (first, TurnSession { rests, turns, random_walk }, unusable)
}

fn seen(entry: &JudgedRest, first: Stamp) -> Option<RestSeen> {
    let rest = &entry.rest;
    let gyroscope = rest.gyroscope.as_ref()?;
    let TriadMean { mean, trend, trend_noise, .. } = &rest.accelerometer;
    // A rest that settles, or is held by a hand, ends elsewhere than it began.
    let shown = (1.0 - (3.0 * trend_noise).powi(2) / trend.norm_squared().max(f64::MIN_POSITIVE)).max(0.0);
    let half: Vector3<f64> = trend * (shown / 2.0);
    Some(RestSeen {
        force: [mean - half, mean + half],
        force_noise: rest.accelerometer.mean_variance() + half.component_mul(&half) / 4.0,
        rate: gyroscope.mean + entry.rate_taken_off,
        rate_taken_off: entry.rate_taken_off,
        rate_noise: gyroscope.mean_variance(),
        time: rest.start.seconds_since(first),
        placement: rest.placement,
    })
}
