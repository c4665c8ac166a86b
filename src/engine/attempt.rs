//! One model of the primary accelerometer tried: which rests are good depends on the calibration, and the calibration on
//! the rests. Which models are tried is left to `solve`.

use nalgebra::Vector3;

use super::book::Entry;
use super::drift::{Drift, drift};
use super::judge::{Judge, Poses};
use super::observe::{self, Placed};
use super::outlier::{self, Doubt, LeftOut, Sound};
use super::reference::Reference;
use super::solve::{Known, per_axis};
use super::words;
use crate::fit::accelerometer::Assumptions;
use crate::fit::{Calibration, Estimate, Loss, Shape, accelerometer, posed};
use crate::messages::segment::Reason;

/// What to try.
pub(super) struct Trial<'a> {
    pub(super) shape: Shape,
    pub(super) known: &'a Known<'a>,
}

/// One model of the primary accelerometer tried.
pub(super) struct Attempt {
    pub(super) fit: Result<Estimate, String>,
    pub(super) seen: Vec<Placed>,
    /// Directions of true specific force, as far as is known.
    pub(super) ups: Vec<Vector3<f64>>,
    pub(super) poses: Poses,
    pub(super) doubts: Vec<Doubt>,
    pub(super) drift: Option<Drift>,
}

impl Attempt {
    pub(super) fn new(poses: Poses) -> Self {
        let fit = Err(String::new());
        Self { fit, seen: Vec::new(), ups: Vec::new(), poses, doubts: Vec::new(), drift: None }
    }
}

/// A model tried on a reference; the rests are only told their faces.
pub(super) fn on_reference(
    entries: &mut [Entry],
    judge: &Judge<'_>,
    &Trial { shape, known }: &Trial<'_>,
    reference: &Reference,
    start: Calibration,
) -> Attempt {
    let (poses, floor) = (Poses::Any, judge.segmenter.status().accel_floor.map(per_axis));
    let fit = reference.accelerometer(shape, judge.fit, floor);
    let calibration = fit.as_ref().map_or(start, Estimate::calibration);
    judge.assign_faces(entries, &calibration, poses);
    let seen = observe::placements(entries, judge, poses, known.step);
    Attempt { fit, seen, ..Attempt::new(poses) }
}

/// The faces depend on the calibration and the calibration on the faces, so this goes round until neither changes; a few
/// rounds suffice.
pub(super) fn on_rests(entries: &mut [Entry], judge: &Judge<'_>, trial: &Trial<'_>, start: Calibration) -> Attempt {
    const ROUNDS: usize = 4;
    let poses = if trial.shape == Shape::TRIANGULAR { Poses::Any } else { Poses::OnFaces };
    let mut attempt = Attempt::new(poses);
    let mut calibration = start;
    let mut before = Vec::new();
    for _ in 0..ROUNDS {
        judge.assign_faces(entries, &calibration, poses);
        let verdicts: Vec<_> = entries.iter().map(|entry| (entry.verdict.reason, entry.verdict.face())).collect();
        if verdicts == before {
            break;
        }
        before = verdicts;
        attempt.seen = observe::placements(entries, judge, poses, trial.known.step);
        let sound = fit_accelerometer(&mut attempt.seen, judge, trial, calibration);
        attempt.fit = sound.map(|Sound { fit, left_out, doubts }| {
            leave_out(entries, &left_out);
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
    if poses == Poses::OnFaces {
        attempt.drift = drift(&attempt.seen, judge.fixture, &calibration, judge.fit.placement_std);
        // What contradicts itself may do so for this reason.
        if let (Err(why), Some(drift)) = (&mut attempt.fit, &attempt.drift) {
            *why += &format!("; {}", drift.explanation());
        }
    }
    attempt
}

/// The rests of placements that contradict the others.
fn leave_out(entries: &mut [Entry], left_out: &[LeftOut]) {
    for LeftOut { placement, face, explanation } in left_out {
        let is_it = |entry: &&mut Entry| entry.rest.placement == *placement && entry.verdict.face() == Some(*face);
        for entry in entries.iter_mut().filter(is_it).filter(|entry| entry.verdict.is_accepted()) {
            entry.verdict.reason = Reason::Outlier;
            entry.verdict.explanation.clone_from(explanation);
        }
    }
}

fn fit_accelerometer(
    seen: &mut Vec<Placed>,
    judge: &Judge<'_>,
    &Trial { shape, known }: &Trial<'_>,
    start: Calibration,
) -> Result<Sound, String> {
    let (config, gravity, kept) = (judge.fit, known.gravity, known.kept == Some(shape));
    match shape {
        Shape::TRIANGULAR if seen.len() < shape.unknowns() => {
            return Err(format!(
                "{} placements in spread directions are needed, {} seen",
                shape.unknowns(),
                seen.len()
            ));
        }
        Shape::TRIANGULAR => {}
        _ => {
            let faces = judge.fixture.faces().iter().enumerate();
            let missing = faces.filter(|(i, _)| seen.iter().all(|placed| placed.face != *i));
            let missing: Vec<_> = missing.map(|(_, face)| face.name.as_str()).collect();
            if !missing.is_empty() {
                return Err(format!("not seen at rest: {}", missing.join(", ")));
            }
        }
    }
    let given = Assumptions {
        shape,
        estimator: config.estimator,
        gravity,
        placement_std: config.placement_std,
        loss: config.loss,
        bounds: &config.bounds,
        start,
    };
    let observations = || seen.iter().map(|placed| placed.observation).collect::<Vec<_>>();
    let alone = |fit| Sound { fit, left_out: Vec::new(), doubts: Vec::new() };
    let sound = match (shape, config.loss) {
        (Shape::MATRIX, _) => posed::fit(&observations(), &given, config.fixture.accuracy_deg.to_radians()).map(alone),
        // Under Huber's loss what contradicts is kept, and counts little.
        (_, Loss::Huber) => accelerometer::fit(&observations(), &given).map(alone),
        (_, Loss::Square) => outlier::fit_without(seen, &given, judge.fixture),
    };
    let sound = sound.map_err(|error| error.to_string())?;
    let fit = &sound.fit;
    if shape == Shape::MATRIX && !fit.agrees() {
        return Err(format!(
            "the faces of the fixture do not point where they should: what is left over has an rms of {:.3} m/s², more than \
             {:.3}. Is the fixture accurate, level, and of this kind? bias-scale does not need it to be{}",
            fit.residual_rms,
            fit.residual_limit,
            words::also(&words::active_bounds(fit))
        ));
    }
    if !fit.agrees() {
        return Err(format!(
            "the rests contradict each other: ‖a‖ − g has an rms of {:.3} m/s², more than {:.3}{}",
            fit.residual_rms,
            fit.residual_limit,
            words::also(&words::active_bounds(fit))
        ));
    }
    let limit = config.max_error * if kept { HYSTERESIS } else { 1.0 };
    let worst = fit.worst_case_error(gravity.value);
    let credible = worst <= limit;
    if shape == Shape::TRIANGULAR && !credible {
        return Err(format!(
            "a corrected reading could err by {worst:.2} m/s² in some direction, more than {limit:.2} (condition number \
             {:.0}): rests between the faces would tell",
            fit.condition
        ));
    }
    Ok(sound)
}

/// A model that was published stays until its worst-case error exceeds the limit by this factor.
const HYSTERESIS: f64 = 1.5;
