//! Advice on the next poses: which of them reduce the accelerometer's worst-case error, and what it will be then.

use nalgebra::Vector3;

use super::fit_inputs::FitInputs;
use super::model_trial::{ModelTrial, Trial, assumptions, is_precise};
use super::observations;
use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use super::solution::Advice;
use super::turn_outcome::TurnOutcome;
use super::turn_trial;
use crate::fit::accelerometer::{Observation, fit, fit_with};
use crate::fit::turn_fit::TurnEstimate;
use crate::fit::{Estimate, Estimator, Loss, Model, Parameterisation, PosePlan, PoseSearch};
use crate::messages::segment::Reason;

/// Numbers of further poses that are tried, in order.
const COUNTS: [usize; 4] = [1, 3, 6, 12];
/// Share of the worst-case error that poses must leave at most to be worth the effort.
const WORTHWHILE: f64 = 0.75;
/// Share of the uncertainty of lengths that poses must leave at most before a fit with them is tried: the worst-case error
/// falls with it.
const HOPEFUL: f64 = 0.85;
/// Number of poses in a round whose effect is told where nothing is worthwhile.
const ROUND: usize = 6;

/// Session as it is solved.
pub(super) struct PoseAdviser<'a> {
    pub(super) entries: &'a [JudgedRest],
    pub(super) judge: &'a Judge<'a>,
    pub(super) inputs: &'a FitInputs<'a>,
    pub(super) trial: &'a ModelTrial,
    pub(super) turning: Option<&'a TurnOutcome>,
}

impl PoseAdviser<'_> {
    /// Advice for a session whose faces named here are not checked; `None` where poses are not what it lacks.
    pub(super) fn advise(&self, unchecked: &[String]) -> Option<Advice> {
        let config = self.judge.fit;
        let now = self.trial.fit.as_ref().ok()?;
        let sound = self.trial.doubts.is_empty() && self.trial.drift.is_none() && now.active.is_empty();
        let simple = config.estimator == Estimator::Magnitude && config.loss == Loss::Square;
        if !sound || !simple || self.inputs.reference.is_some() || config.half_life_s.is_some() {
            return None;
        }
        match (now.shape, self.trial.poses) {
            (Parameterisation::DIAGONAL, _) if !unchecked.is_empty() => self.repeats(now, unchecked),
            (Parameterisation::DIAGONAL | Parameterisation::TRIANGULAR, _) => self.further(now, unchecked),
            _ => None,
        }
    }

    /// Repeats of the faces that are not checked.
    fn repeats(&self, now: &Estimate, unchecked: &[String]) -> Option<Advice> {
        let poses = self.poses(now);
        let up = |name: &String| poses.iter().find(|(known, _)| known == name).map(|(_, up)| *up);
        let ups: Vec<_> = unchecked.iter().filter_map(up).collect();
        let after = self.on_faces(now, &ups)?;
        Some(self.advice(now, unchecked.first()?.clone(), ups.len(), &after))
    }

    /// Poses of any kind, the most telling first.
    fn further(&self, now: &Estimate, unchecked: &[String]) -> Option<Advice> {
        if !matches!(self.judge.fit.model, Model::Auto | Model::Triangular) {
            return None;
        }
        let poses = self.poses(now);
        let candidates: Vec<Vector3<f64>> = poses.iter().map(|(_, up)| *up).collect();
        let seen = self.in_any_pose(now);
        let trial = Trial { shape: Parameterisation::TRIANGULAR, inputs: self.inputs };
        let given = assumptions(self.judge, &trial, now.calibration());
        let told = self.turns().map(|found| &found.told);
        let search = PoseSearch { seen: &seen, given: &given, told, scatter: scatter(now, self.judge) };
        // One more than is tried, to know what that many leave.
        let most = COUNTS[COUNTS.len() - 1] + 1;
        // Where turns tell what edges would, poses on faces stay those of the simpler fit.
        let by_turns = self.turning.is_some_and(|turning| turning.completed);
        let mut plans = Vec::new();
        if !by_turns || self.trial.poses == Poses::Any {
            plans.push(search.best(&candidates, most));
        }
        if self.trial.poses == Poses::OnFaces {
            plans.push(search.best(&candidates[..self.judge.fixture.faces().len()], most));
        }
        // A richer model may gain more than the uncertainty of lengths tells, but poses on faces do not lead to it.
        let is_hopeful = |plan: &PosePlan, count| {
            let left = plan.left_after(count).unwrap_or(0.0);
            let on_faces = plan.poses.iter().all(|pose| *pose < self.judge.fixture.faces().len());
            let richer = now.shape != Parameterisation::TRIANGULAR && !on_faces;
            richer || !unchecked.is_empty() || count == ROUND || left <= HOPEFUL
        };
        let mut round = None;
        for count in COUNTS {
            let tried = plans.iter().filter(|plan| plan.poses.len() >= count && is_hopeful(plan, count));
            let after = tried.filter_map(|plan| {
                let ups: Vec<_> = plan.poses.iter().take(count).map(|pose| candidates[*pose]).collect();
                let after = self.in_poses(now, &search, &ups).filter(Estimate::is_checked)?;
                Some(self.advice(now, poses[*plan.poses.first()?].0.clone(), count, &after))
            });
            let Some(advice) = after.min_by(|a, b| a.error[1].total_cmp(&b.error[1])) else { continue };
            if advice.worthwhile || !unchecked.is_empty() {
                return Some(advice);
            }
            if count == ROUND {
                round = Some(advice);
            }
        }
        round
    }

    fn advice(&self, now: &Estimate, first: String, poses: usize, after: &Estimate) -> Advice {
        let error = [now, after].map(|fit| fit.worst_case_error(self.inputs.gravity.value));
        Advice { first, poses, error, worthwhile: error[1] <= WORTHWHILE * error[0] }
    }

    /// Poses with their names and directions; a face lies as it did before.
    fn poses(&self, now: &Estimate) -> Vec<(String, Vector3<f64>)> {
        let mut poses = self.judge.fixture.poses();
        let calibration = now.calibration();
        for placed in &self.trial.seen {
            let lay = calibration.correct(&placed.observation.mean).try_normalize(f64::MIN_POSITIVE);
            let limit = self.judge.fit.max_tilt_deg.to_radians();
            if let (Some((_, up)), Some(lay)) = (poses.get_mut(placed.face), lay)
                && libm::atan2(up.cross(&lay).norm(), up.dot(&lay)) <= limit
            {
                *up = lay;
            }
        }
        poses
    }

    fn turns(&self) -> Option<&TurnEstimate> {
        self.turning.and_then(|turning| turning.found.as_ref().ok())
    }

    /// Fit with further placements on faces, by the model of now.
    fn on_faces(&self, now: &Estimate, ups: &[Vector3<f64>]) -> Option<Estimate> {
        let trial = Trial { shape: now.shape, inputs: self.inputs };
        let given = assumptions(self.judge, &trial, now.calibration());
        let seen: Vec<_> = self.trial.seen.iter().map(|placed| placed.observation).collect();
        let search = PoseSearch { seen: &seen, given: &given, told: None, scatter: scatter(now, self.judge) };
        let seen = search.after(ups);
        match (now.shape, self.turns().filter(|_| self.turning.is_some_and(|turning| turning.completed))) {
            (Parameterisation::TRIANGULAR, Some(found)) => {
                turn_trial::triangular(&seen, self.trial.poses, found, self.judge, self.inputs)
            }
            _ => fit(&seen, &given).ok(),
        }
    }

    /// Fit with further placements in any pose, by the model that they determine.
    fn in_poses(&self, now: &Estimate, search: &PoseSearch<'_>, ups: &[Vector3<f64>]) -> Option<Estimate> {
        let seen = search.after(ups);
        let spread = (seen.len() >= Parameterisation::TRIANGULAR.unknowns()).then(|| fit(&seen, search.given).ok());
        match spread.flatten().filter(|fit| fit.agrees() && is_precise(fit, self.judge, self.inputs)) {
            Some(spread) => match search.told {
                Some(told) => fit_with(&seen, search.given, Some(told)).ok(),
                None => Some(spread),
            },
            // Only those on faces count.
            None if self.trial.poses == Poses::OnFaces => {
                let limit = self.judge.fit.max_tilt_deg;
                let is_on_face =
                    |up: &&Vector3<f64>| self.judge.fixture.nearest(up).is_some_and(|(_, tilt)| tilt <= limit);
                let ups: Vec<_> = ups.iter().filter(is_on_face).copied().collect();
                self.on_faces(now, &ups)
            }
            None => None,
        }
    }

    /// Placements in any pose, with those that were too far from a face.
    fn in_any_pose(&self, now: &Estimate) -> Vec<Observation> {
        let mut entries = self.entries.to_vec();
        for entry in entries.iter_mut().filter(|entry| entry.verdict.reason == Reason::Tilted) {
            entry.verdict.reason = Reason::Accepted;
        }
        self.judge.assign_faces(&mut entries, &now.calibration(), Poses::Any);
        let placed = observations::placements(&entries, self.judge, Poses::Any, self.inputs.step);
        placed.into_iter().map(|placed| placed.observation).collect()
    }
}

/// Scatter of placements of a fit, m/s².
fn scatter(fit: &Estimate, judge: &Judge<'_>) -> f64 {
    fit.placement_std.first().copied().unwrap_or(judge.fit.placement_std)
}
