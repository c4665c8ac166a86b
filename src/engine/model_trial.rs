//! Trial of one model of the primary accelerometer: which rests are good depends on the calibration, and the
//! calibration on the rests.

use nalgebra::Vector3;

use super::drift::{Drift, Fitted, Suspicion, drift};
use super::fit_inputs::{FitInputs, per_axis};
use super::observations::{self, Placed};
use super::outliers::{self, Doubt, LeftOut, Sound};
use super::reference::Reference;
use super::refusal::{Refusal, held_back};
use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use super::turn_outcome::TurnOutcome;
use crate::fit::accelerometer::{Assumptions, Observation};
use crate::fit::{Bounds, Calibration, Estimate, Loss, Parameterisation, accelerometer, known_poses};
use crate::messages::segment::Reason;

/// Model to try.
pub(super) struct Trial<'a> {
    pub(super) shape: Parameterisation,
    pub(super) inputs: &'a FitInputs<'a>,
}

/// Result of a trial of one model of the primary accelerometer.
pub(super) struct ModelTrial {
    pub(super) fit: Result<Estimate, Refusal>,
    pub(super) seen: Vec<Placed>,
    /// Directions of true specific force, as far as they are known.
    pub(super) ups: Vec<Vector3<f64>>,
    pub(super) poses: Poses,
    pub(super) doubts: Vec<Doubt>,
    /// Placements that contradict the others.
    contradicting: Vec<Placed>,
    pub(super) drift: Option<Drift>,
}

impl ModelTrial {
    pub(super) fn new(poses: Poses) -> Self {
        let fit = Err(Refusal::FacesMissing(Vec::new()));
        let (seen, contradicting) = (Vec::new(), Vec::new());
        Self { fit, seen, ups: Vec::new(), poses, doubts: Vec::new(), contradicting, drift: None }
    }

    /// Looks for a bias that moved, by the placements and the turns between them, and widens the bars for it.
    pub(super) fn look_for_drift(
        &mut self,
        entries: &[JudgedRest],
        judge: &Judge<'_>,
        trial: &Trial<'_>,
        start: Calibration,
        turning: Option<&TurnOutcome>,
    ) {
        if trial.shape == Parameterisation::MATRIX || judge.fit.loss != Loss::Square {
            return;
        }
        let calibration = self.fit.as_ref().map_or(start, Estimate::calibration);
        let given = assumptions(judge, trial, calibration);
        let fitted = Fitted {
            entries,
            seen: &self.seen,
            left_out: &self.contradicting,
            given: &given,
            step: trial.inputs.step,
            calibration,
            fit: self.fit.as_ref().ok(),
            turning,
        };
        let Suspicion { drift, doubted } = drift(&fitted, judge, self.poses);
        if let Ok(fit) = &mut self.fit {
            drift.iter().map(|drift| &drift.moved).chain(&doubted).for_each(|moved| fit.widen(moved));
        }
        self.drift = drift;
    }
}

/// Tries a model on a reference; the rests are only assigned their faces.
pub(super) fn on_reference(
    entries: &mut [JudgedRest],
    judge: &Judge<'_>,
    &Trial { shape, inputs }: &Trial<'_>,
    reference: &Reference,
    start: Calibration,
) -> ModelTrial {
    let (poses, floor) = (Poses::Any, judge.segmenter.status().accel_floor.map(per_axis));
    let fit = reference.accelerometer(shape, judge.fit, floor);
    let calibration = fit.as_ref().map_or(start, Estimate::calibration);
    judge.assign_faces(entries, &calibration, poses);
    let seen = observations::placements(entries, judge, poses, inputs.step);
    ModelTrial { fit, seen, ..ModelTrial::new(poses) }
}

/// Tries a model on rests. The faces depend on the calibration and the calibration on the faces, so this iterates until
/// neither changes; a few rounds suffice.
pub(super) fn on_rests(
    entries: &mut [JudgedRest],
    judge: &Judge<'_>,
    trial: &Trial<'_>,
    start: Calibration,
) -> ModelTrial {
    const ROUNDS: usize = 4;
    let poses = if trial.shape == Parameterisation::TRIANGULAR { Poses::Any } else { Poses::OnFaces };
    let mut attempt = ModelTrial::new(poses);
    let mut calibration = start;
    let mut before = Vec::new();
    for _ in 0..ROUNDS {
        judge.assign_faces(entries, &calibration, poses);
        let verdicts: Vec<_> = entries.iter().map(|entry| (entry.verdict.reason, entry.verdict.face())).collect();
        if verdicts == before {
            break;
        }
        before = verdicts;
        attempt.seen = observations::placements(entries, judge, poses, trial.inputs.step);
        let sound = fit_accelerometer(&mut attempt.seen, judge, trial, calibration);
        attempt.fit = sound.map(|Sound { fit, left_out, doubts }| {
            leave_out(entries, &left_out);
            attempt.contradicting.extend(left_out.into_iter().map(|left_out| left_out.placed));
            attempt.doubts.extend(doubts);
            fit
        });
        let Ok(fit) = &attempt.fit else { break };
        calibration = fit.calibration();
    }
    let up = |placed: &Placed| calibration.correct(&placed.observation.mean).try_normalize(f64::MIN_POSITIVE);
    attempt.ups = attempt.seen.iter().filter_map(up).collect();
    if let Ok(fit) = &mut attempt.fit {
        attempt.doubts.iter().for_each(|doubt| fit.widen(&doubt.moved));
    }
    if attempt.fit.is_err() {
        attempt.look_for_drift(entries, judge, trial, calibration, None);
        // The drift may be the cause of the contradiction.
        if let Some(drift) = &attempt.drift {
            attempt.fit =
                attempt.fit.map_err(|why| Refusal::Drifting { why: Box::new(why), drift: Box::new(drift.clone()) });
        }
    }
    attempt
}

/// Rejects the rests of placements that contradict the others.
fn leave_out(entries: &mut [JudgedRest], left_out: &[LeftOut]) {
    for LeftOut { placed, explanation } in left_out {
        let is_it = |entry: &&mut JudgedRest| {
            entry.rest.placement == placed.observation.placement && entry.verdict.face() == Some(placed.face)
        };
        for entry in entries.iter_mut().filter(is_it).filter(|entry| entry.verdict.is_accepted()) {
            entry.verdict.reason = Reason::Outlier;
            entry.verdict.explanation.clone_from(explanation);
        }
    }
}

fn fit_accelerometer(
    seen: &mut Vec<Placed>,
    judge: &Judge<'_>,
    trial: &Trial<'_>,
    start: Calibration,
) -> Result<Sound, Refusal> {
    let &Trial { shape, inputs } = trial;
    let (config, gravity) = (judge.fit, inputs.gravity);
    match shape {
        Parameterisation::TRIANGULAR if seen.len() < shape.unknowns() => {
            return Err(Refusal::TooFewPlacements { needed: shape.unknowns(), seen: seen.len() });
        }
        Parameterisation::TRIANGULAR => {}
        _ => {
            let faces = judge.fixture.faces().iter().enumerate();
            let missing = faces.filter(|(i, _)| seen.iter().all(|placed| placed.face != *i));
            let missing: Vec<_> = missing.map(|(_, face)| face.name.clone()).collect();
            if !missing.is_empty() {
                return Err(Refusal::FacesMissing(missing));
            }
        }
    }
    let given = assumptions(judge, trial, start);
    let alone = |fit| Sound { fit, left_out: Vec::new(), doubts: Vec::new() };
    let sound = match (shape, config.loss) {
        (Parameterisation::MATRIX, _) => {
            known_poses::fit(&observed(seen), &given, config.fixture.accuracy_deg.to_radians()).map(alone)
        }
        // Under Huber's loss contradicting placements stay, with little weight.
        (_, Loss::Huber) => accelerometer::fit(&observed(seen), &given).map(alone),
        (_, Loss::Square) => outliers::fit_without(seen, &given, judge.fixture),
    };
    let sound = sound.map_err(|error| beyond_bounds(&observed(seen), &given).unwrap_or(Refusal::Unsolved(error)))?;
    let fit = &sound.fit;
    if !fit.agrees() {
        if let Some(refusal) = beyond_bounds(&observed(seen), &given) {
            return Err(refusal);
        }
        let (rms, limit, at_bounds) = (fit.residual_rms, fit.residual_limit, held_back(fit));
        return Err(match shape {
            Parameterisation::MATRIX => Refusal::InaccurateFixture { rms, limit, at_bounds },
            _ => Refusal::Contradicting { rms, limit, at_bounds },
        });
    }
    if shape == Parameterisation::TRIANGULAR && !is_precise(fit, judge, inputs) {
        let (worst, limit) = (fit.direction_error(gravity.value), error_limit(fit, judge, inputs));
        return Err(Refusal::Weak { worst, limit, condition: fit.condition });
    }
    Ok(sound)
}

/// Whether spread poses determine a fit well enough to be published.
pub(super) fn is_precise(fit: &Estimate, judge: &Judge<'_>, inputs: &FitInputs<'_>) -> bool {
    fit.direction_error(inputs.gravity.value) <= error_limit(fit, judge, inputs)
}

/// Largest error of a corrected reading in one direction with which a fit is published, m/s².
fn error_limit(fit: &Estimate, judge: &Judge<'_>, inputs: &FitInputs<'_>) -> f64 {
    let kept = inputs.kept == Some(fit.shape);
    judge.fit.max_error * if kept { HYSTERESIS } else { 1.0 }
}

/// Assumptions of a fit beside the placements.
pub(super) fn assumptions<'a>(judge: &Judge<'a>, trial: &Trial<'_>, start: Calibration) -> Assumptions<'a> {
    let config = judge.fit;
    Assumptions {
        shape: trial.shape,
        estimator: config.estimator,
        gravity: trial.inputs.gravity,
        placement_std: config.placement_std,
        cross_axis_std: config.cross_axis_std,
        nonlinearity: config.nonlinearity,
        loss: config.loss,
        bounds: &config.bounds,
        start,
    }
}

fn observed(seen: &[Placed]) -> Vec<Observation> {
    seen.iter().map(|placed| placed.observation).collect()
}

/// Refusal for parameters that explain the placements well, but lie beyond the bounds.
fn beyond_bounds(observations: &[Observation], given: &Assumptions<'_>) -> Option<Refusal> {
    if given.shape == Parameterisation::MATRIX {
        return None;
    }
    let free = Bounds::none();
    let fit =
        accelerometer::fit(observations, &Assumptions { bounds: &free, ..*given }).ok().filter(Estimate::agrees)?;
    let terms = given.shape.terms().iter().zip(&fit.parameters);
    let beyond = terms.filter_map(|(term, value)| {
        let [low, high] = given.bounds.accelerometer(*term);
        let outside = !(low..=high).contains(value);
        outside.then(|| format!("{} would be {value:.3}, beyond its bounds {low} to {high}", term.name()))
    });
    let beyond: Vec<_> = beyond.collect();
    (!beyond.is_empty()).then_some(Refusal::BeyondBounds(beyond))
}

/// Factor by which its error must exceed the limit before a published model is dropped.
const HYSTERESIS: f64 = 1.5;
