//! Verdict on each turn between two rests, as it is published.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::declaration::Declaration;
use super::observations;
use super::publication::vector;
use super::rest_history::JudgedRest;
use super::rotations::Rotations;
use super::solution::Solution;
use crate::Stamp;
use crate::fit::Calibration;
use crate::messages::{self, turn::Reason};
use crate::still::Rest;
use crate::turns::{Candidate, Ends, History, Motion, Piece, Turn, Unusable, level_axis, motion, predict};

/// Verdict on a turn, identified by the rests at its ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TurnVerdict {
    /// Start of the rest after it.
    pub(super) to: Stamp,
    pub(super) used: bool,
    pub(super) reason: Reason,
    pub(super) explanation: String,
    /// Whether its heading counts.
    pub(super) heading: bool,
}

/// Verdicts last published, by the start of the rest before the turn.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct TurnsTold(BTreeMap<Stamp, TurnVerdict>);

impl TurnsTold {
    /// Messages on the turns whose verdict differs from the published one.
    pub(super) fn news(&mut self, header: &messages::Header, view: &View<'_>) -> Vec<messages::Turn> {
        let verdicts = view.verdicts();
        self.0.retain(|from, _| verdicts.contains_key(from));
        let mut news = Vec::new();
        for (from, (turn, verdict)) in verdicts {
            let told = self.0.get(&from);
            let same = |told: &TurnVerdict| {
                told.to == verdict.to
                    && told.used == verdict.used
                    && told.reason == verdict.reason
                    && told.heading == verdict.heading
            };
            // The loss of its pieces is no verdict on a turn.
            let forgotten =
                |told: &TurnVerdict| told.to == verdict.to && turn.unusable(None) == Some(Unusable::Forgotten);
            if told.is_some_and(|told| same(told) || forgotten(told)) {
                continue;
            }
            news.push(view.message(header.clone(), &turn, &verdict));
            self.0.insert(from, verdict);
        }
        news
    }
}

/// Data that the verdicts are based on.
pub(super) struct View<'a> {
    pub(super) turns: &'a History,
    pub(super) entries: &'a [JudgedRest],
    pub(super) solution: &'a Solution,
    /// Noise of one sample of a gyroscope axis, rad/s.
    pub(super) noise: f64,
    /// Range of the gyroscope, rad/s.
    pub(super) range: Option<f64>,
    /// Whether whole turns of a table are declared to be such.
    pub(super) whole_turns: bool,
    /// Rotations that are declared by their times.
    pub(super) rotations: Rotations<'a>,
}

impl<'a> View<'a> {
    /// Verdicts on the turns between neighbouring rests, and between neighbouring accepted ones.
    pub(super) fn verdicts(&self) -> BTreeMap<Stamp, (Turn<'a>, TurnVerdict)> {
        let mut verdicts = BTreeMap::new();
        for turn in self.turns.turns(|_| true) {
            let explanation = "a rest at one of its ends was not accepted".to_owned();
            let (to, heading) = (turn.to, false);
            let unrest = TurnVerdict { to, used: false, reason: Reason::Unrest, explanation, heading };
            verdicts.insert(turn.from, (turn, unrest));
        }
        let mut place = 0;
        for turn in self.believed() {
            let heading = self.rotations.heading.is_some_and(|heading| heading.of(&turn).is_some());
            let verdict = TurnVerdict { heading, ..self.verdict(&turn, &mut place) };
            verdicts.insert(turn.from, (turn, verdict));
        }
        verdicts
    }

    /// Statement on the rotation of a turn between accepted rests about the vertical, and the axis of the body that is
    /// vertical while it is level.
    pub(super) fn declaration(&self, turn: &Turn<'_>, pieces: &[Piece], ends: &Ends) -> (Declaration, Vector3<f64>) {
        let known = self.rotations.of(turn, || self.believed());
        let level = match known {
            Some(known) if known.heading_std.is_some() => {
                level_axis(&ends.up[0], self.entries.iter().map(|entry| self.up(&entry.rest)))
            }
            _ => ends.up[0],
        };
        (Declaration::of(pieces, ends, known, &level, self.whole_turns), level)
    }

    /// Turns between neighbouring accepted rests.
    pub(super) fn believed(&self) -> Vec<Turn<'a>> {
        let tells = |entry: &&JudgedRest| observations::tells_of_rates(entry, self.noise);
        // After a clock was set back they are not in order.
        let believed: BTreeSet<Stamp> = self.entries.iter().filter(tells).map(|entry| entry.rest.start).collect();
        self.turns.turns(|start| believed.contains(&start))
    }

    /// Verdict on a turn between accepted rests; `place` counts those that were fitted.
    fn verdict(&self, turn: &Turn<'_>, place: &mut usize) -> TurnVerdict {
        let not = |reason, explanation: &str| TurnVerdict {
            to: turn.to,
            used: false,
            reason,
            explanation: explanation.to_owned(),
            heading: false,
        };
        if let Some(why) = turn.unusable(self.range) {
            let reason = match why {
                Unusable::Gap => Reason::Interrupted,
                Unusable::Stamps => Reason::Jittery,
                Unusable::Clipped => Reason::Clipped,
                Unusable::TooLong | Unusable::Forgotten => Reason::Prolonged,
            };
            return not(reason, &why.to_string());
        }
        if !turn.resolves(1.0) {
            return not(Reason::Prolonged, "too much of a way between two rests to be followed: rest in between");
        }
        let at = *place;
        *place += 1;
        if self.solution.accelerometer.is_err() {
            return not(Reason::Unreferenced, "the accelerometer is not calibrated, so nothing says where gravity was");
        }
        match self.solution.turning.as_ref().map(|turning| &turning.found) {
            Some(Ok(found)) if found.left_out == Some(at) => {
                not(Reason::Outlier, "contradicts the other turns: was the sensor held in the hand at one of its ends?")
            }
            Some(Ok(_)) => TurnVerdict { used: true, ..not(Reason::Used, "") },
            Some(Err(why)) => not(Reason::Used, &format!("nothing speaks against it, but {why}")),
            None => not(Reason::Used, "nothing speaks against it, but the gyroscope is not calibrated"),
        }
    }

    fn message(&self, header: messages::Header, turn: &Turn<'_>, verdict: &TurnVerdict) -> messages::Turn {
        let gyroscope = self.solution.gyroscope.as_ref().map(|fit| fit.calibration());
        let pieces = turn.pieces();
        let whole = turn.unusable(None).is_none() && turn.resolves(1.0);
        let ends = self.ends(turn).filter(|_| whole);
        let followed = ends.as_ref().map(|ends| follow(&pieces, gyroscope.as_ref(), ends));
        let (declaration, level) = match ends.filter(|_| verdict.reason != Reason::Unrest) {
            Some(ends) => self.declaration(turn, &pieces, &ends),
            None => (Declaration::Nothing, Vector3::z()),
        };
        let known = declaration.known();
        let about_vertical = known.zip(ends).map(|(known, ends)| known.about_vertical(&pieces, &ends, &level).angle);
        let (start, end) = turn.span();
        let motion = followed.as_ref().map(|(motion, _)| motion);
        let placement = |start| self.rest(start).map_or(0, |rest| rest.placement);
        let judged = !matches!(verdict.reason, Reason::Unrest | Reason::Unreferenced);
        messages::Turn {
            header: Some(header),
            start: Some(start.into()),
            end: Some(end.into()),
            angle: motion.map_or(0.0, |motion| motion.angle),
            residual: followed.as_ref().filter(|_| judged).map(|(_, residual)| *residual),
            used: verdict.used,
            reason: verdict.reason.into(),
            explanation: declaration.explain(
                &verdict.explanation,
                motion.map_or(0.0, |motion| motion.vertical),
                self.rotations.times(turn),
            ),
            axis: motion.map(|motion| vector(&motion.axis)),
            path: turn.path(),
            vertical: motion.map(|motion| motion.vertical),
            declared: known.map(|known| known.angle),
            declared_residual: about_vertical.zip(motion).map(|(known, motion)| motion.vertical - known),
            declared_std: known.filter(|known| known.heading_std.is_some()).map(|known| known.std()),
            before: placement(turn.from),
            after: placement(turn.to),
            seconds: turn.seconds(),
            roughness: turn.roughness(),
            integrals: if whole { pieces.iter().flat_map(integrals).collect() } else { Vec::new() },
        }
    }

    /// The rests at the ends of a turn, as the calibration in force, or the guess, sees them.
    pub(super) fn ends(&self, turn: &Turn<'_>) -> Option<Ends> {
        let rests = [self.rest(turn.from)?, self.rest(turn.to)?];
        let up = rests.map(|rest| self.up(rest));
        let rate = rests.map(|rest| rest.gyroscope.as_ref().map_or(Vector3::zeros(), |mean| mean.mean));
        Some(Ends { up, rate, by_up: Matrix3::zeros() })
    }

    /// Direction of specific force at a rest, unit vector, as the calibration in force, or the guess, sees it.
    fn up(&self, rest: &Rest) -> Vector3<f64> {
        let accelerometer = match &self.solution.accelerometer {
            Ok(fit) => fit.calibration(),
            Err(_) => self.solution.guessed,
        };
        let courses = self.solution.temperature.as_ref();
        let courses = courses.map_or(Vector3::zeros(), |courses| courses.force(rest.temperature));
        let force = accelerometer.correct(&(rest.accelerometer.mean - courses));
        force.try_normalize(f64::MIN_POSITIVE).unwrap_or(Vector3::z())
    }

    /// Rest that starts then.
    fn rest(&self, start: Stamp) -> Option<&Rest> {
        self.entries.iter().find(|entry| entry.rest.start == start).map(|entry| &entry.rest)
    }
}

/// Motion of a turn, and the angle between gravity as predicted and as measured after it.
fn follow(pieces: &[Piece], gyroscope: Option<&Calibration>, ends: &Ends) -> (Motion, f64) {
    let candidate = gyroscope.map_or(Candidate::default(), |known| Candidate::of_inverse(known.inverse()));
    let there = predict(pieces.iter(), &candidate, ends).up;
    let residual = libm::atan2(there.cross(&ends.up[1]).norm(), there.dot(&ends.up[1]));
    (motion(pieces.iter(), &candidate, ends), residual)
}

/// Integrals of a piece, in the order of the message.
fn integrals(piece: &Piece) -> [f64; 10] {
    let Piece { angle: a, coning: c, moment: m, seconds } = piece;
    [a.x, a.y, a.z, c.x, c.y, c.z, m.x, m.y, m.z, *seconds]
}
