//! Test whether the accelerometer's bias moved during the session: by comparing placements, and by the changes of
//! readings at rest.

use std::collections::BTreeMap;

use nalgebra::{DVector, Vector3};

use super::observations::{self, Placed};
use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use super::turn_outcome::TurnOutcome;
use crate::Stamp;
use crate::fit::accelerometer::{self, Assumptions, Observation};
use crate::fit::{self, Calibration, Estimate, Fixture, Hint, Slope, Wandering, slope, unexcluded, wandering};
use crate::messages::segment::Reason;

/// Bias that moved, or may have.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drift {
    course: Course,
    /// Change of the reading of each face from its first to its last visit, m/s², and the seconds in between.
    faces: Vec<(String, f64, f64)>,
    /// Half-life with which the fit would have followed, by its own rests, s.
    half_life: Option<f64>,
    /// Possible error of the parameters, at the beginning of the session or now: half of a 95 % interval.
    pub(super) moved: DVector<f64>,
    /// Whether a configured half-life keeps that error within its interval.
    pub(super) followed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Course {
    /// Change, m/s², and its duration, s.
    Ramp(Vector3<f64>, f64),
    /// Axis, change, m/s², the two times between which it happened, s since the first rest, and whether no single wrong
    /// rest explains it.
    Step(usize, f64, [f64; 2], bool),
    /// Axis, change, m/s², and time, s since the first rest, of a change within a placement that may also be a tilt.
    Hinted(usize, f64, f64),
}

/// Inputs and result of a fit.
pub(super) struct Fitted<'a> {
    pub(super) entries: &'a [JudgedRest],
    /// Placements in the fit, and those that contradict them.
    pub(super) seen: &'a [Placed],
    pub(super) left_out: &'a [Placed],
    pub(super) given: &'a Assumptions<'a>,
    /// Quantisation step of the accelerometer, m/s².
    pub(super) step: Option<f64>,
    /// Best known calibration.
    pub(super) calibration: Calibration,
    /// Estimate, if the fit has one.
    pub(super) fit: Option<&'a Estimate>,
    /// Turns between the rests.
    pub(super) turning: Option<&'a TurnOutcome>,
}

/// What the placements say of a bias that moved.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Suspicion {
    /// Movement that is found, or hinted at.
    pub(super) drift: Option<Drift>,
    /// Possible error of the parameters by a movement that may be chance: half of a 95 % interval.
    pub(super) doubted: Option<DVector<f64>>,
}

/// Looks for a bias that moved.
pub(super) fn drift(fitted: &Fitted<'_>, judge: &Judge<'_>, poses: Poses) -> Suspicion {
    look(fitted, judge, poses).unwrap_or_default()
}

fn look(fitted: &Fitted<'_>, judge: &Judge<'_>, poses: Poses) -> Option<Suspicion> {
    let Fitted { entries, given, step, calibration, fit, .. } = fitted;
    // Ageing is switched off: it only sets how much a fit trusts old placements.
    let ageless = fit::Config { half_life_s: None, ..judge.fit.clone() };
    let fresh = observations::placements(entries, &Judge { fit: &ageless, ..*judge }, poses, *step);
    let seen = if judge.fit.half_life_s.is_some() { &fresh } else { fitted.seen };
    let first = seen.iter().map(|placed| placed.start).min()?;
    let timed = |placed: &Placed| (placed.start.seconds_since(first), placed.observation);
    let mut all: Vec<_> = seen.iter().map(timed).collect();
    let told = told(entries, first, calibration);
    let turns = fitted.turning.and_then(|turning| turning.bias_courses(first));
    let look = |seen: &[(f64, Observation)]| wandering(seen, given, calibration, told.slope.as_ref(), turns.as_ref());
    let kept = all.clone();
    all.extend(fitted.left_out.iter().map(timed));
    let found = match fitted.left_out.is_empty() {
        true => look(&kept),
        false => look(&all).filter(|found| found.is_beyond_chance() && found.is_certain).or_else(|| look(&kept)),
    };
    let starts: BTreeMap<u32, f64> = kept.iter().map(|(time, seen)| (seen.placement, *time)).collect();
    let forgets = judge.fit.half_life_s.is_some();
    let faces = faces(seen, judge.fixture, calibration, judge.fit.placement_std);
    let stds: Vec<_> = fit.map_or(Vec::new(), |fit| (0..fit.parameters.len()).map(|i| fit.std(i)).collect());
    let last = kept.iter().map(|(time, _)| *time).fold(0.0, f64::max);
    let Some(found) = found.filter(Wandering::is_beyond_chance) else {
        let doubted = found.zip(*fit).map(|(found, fit)| doubted(fit, &found, &starts, forgets));
        let hint = unexcluded(&kept, given, calibration, &told.hints, &stds, turns.as_ref());
        let drift = hint.map(|hint| Drift {
            course: Course::Hinted(hint.axis, hint.change, hint.time),
            faces: Vec::new(),
            half_life: None,
            moved: DVector::zeros(stds.len()),
            followed: false,
        });
        return Some(Suspicion { drift, doubted });
    };
    let course = match found.is_step(0.0, last) {
        true => {
            let axis = found.change.iamax();
            Course::Step(axis, found.change[axis], found.span, found.is_certain)
        }
        false => Course::Ramp(found.change, last),
    };
    let moved = fit.map_or(DVector::zeros(0), |fit| moved(fit, &found, &starts, forgets));
    let within = |moved: &DVector<f64>, stds: &[f64]| {
        !moved.is_empty() && moved.iter().zip(stds).all(|(moved, std)| moved.abs() <= *std)
    };
    let followed = forgets && within(&moved, &stds);
    let half_life = (!forgets && fit.is_some()).then(|| follows(fitted, judge, poses, &found, &starts)).flatten();
    Some(Suspicion { drift: Some(Drift { course, faces, half_life, moved, followed }), doubted: None })
}

/// Longest half-life with which a fit of these rests lags by no more than its intervals.
fn follows(
    Fitted { entries, given, step, fit, .. }: &Fitted<'_>,
    judge: &Judge<'_>,
    poses: Poses,
    found: &Wandering,
    starts: &BTreeMap<u32, f64>,
) -> Option<f64> {
    let span = starts.values().copied().fold(0.0, f64::max);
    [2.0, 4.0, 8.0, 16.0].into_iter().map(|part| (span / part).round().max(1.0)).find(|half_life| {
        let config = fit::Config { half_life_s: Some(*half_life), ..judge.fit.clone() };
        let seen = observations::placements(entries, &Judge { fit: &config, ..*judge }, poses, *step);
        let seen: Vec<_> = seen.iter().map(|placed| placed.observation).collect();
        let start = fit.map_or(given.start, |fit| fit.calibration());
        let Ok(fit) = accelerometer::fit(&seen, &Assumptions { start, ..**given }) else { return false };
        let lag = shifted(&fit, found, starts, 1.0);
        fit.agrees() && (0..lag.len()).all(|i| lag[i].abs() <= fit.std(i))
    })
}

/// Shift of a fit because the bias moved, relative to its value after a share of the change.
fn shifted(fit: &Estimate, found: &Wandering, starts: &BTreeMap<u32, f64>, share: f64) -> DVector<f64> {
    let mut shifted = DVector::zeros(fit.parameters.len());
    for (placement, influence) in fit.origin.iter().flat_map(|origin| &origin.influence) {
        let time = starts.get(placement).copied().unwrap_or(0.0);
        shifted += influence * found.change * (found.share(time) - share);
    }
    shifted
}

/// Largest shift of a fit, relative to the beginning or to now, if the change was as large as it may have been.
fn moved(fit: &Estimate, found: &Wandering, starts: &BTreeMap<u32, f64>, forgets: bool) -> DVector<f64> {
    let beyond = found.change.zip_map(&found.std, |change: f64, std: f64| change + change.signum() * 2.0 * std);
    most_shifted(fit, &Wandering { change: beyond, ..*found }, starts, forgets)
}

/// Shift of a fit by a change that may be chance, less the less it explains.
fn doubted(fit: &Estimate, found: &Wandering, starts: &BTreeMap<u32, f64>, forgets: bool) -> DVector<f64> {
    /// Shares of what chance may explain at which a change begins to count, and from which it counts whole.
    const BEGINS: f64 = 0.5;
    const WHOLE: f64 = 0.9;
    let share = ((found.over - BEGINS) / (WHOLE - BEGINS)).clamp(0.0, 1.0);
    most_shifted(fit, found, starts, forgets) * share
}

/// Largest shift of a fit, relative to the beginning or to now.
fn most_shifted(fit: &Estimate, found: &Wandering, starts: &BTreeMap<u32, f64>, forgets: bool) -> DVector<f64> {
    // A fit that forgets is for the present.
    let ends = if forgets { [1.0, 1.0] } else { [0.0, 1.0] }.map(|share| shifted(fit, found, starts, share));
    ends[0].zip_map(&ends[1], |one: f64, other: f64| if one.abs() > other.abs() { one } else { other })
}

/// Changes of the readings at rest.
struct RestChanges {
    slope: Option<Slope>,
    hints: Vec<Hint>,
}

fn told(entries: &[JudgedRest], first: Stamp, calibration: &Calibration) -> RestChanges {
    /// Least significance of a change, in standard deviations of the noise.
    const CLEAR: f64 = 5.0;
    /// Shortest time between two rests in which something happened to the sensor, s.
    const KNOCKED: f64 = 0.5;
    let still = |entry: &&JudgedRest| {
        matches!(entry.verdict.reason, Reason::Accepted | Reason::Tilted | Reason::Creeping) && entry.count == 1
    };
    let rests: Vec<_> = entries.iter().filter(still).collect();
    let (mut rates, mut hints) = (Vec::new(), Vec::new());
    let mut hint = |time: f64, change: Vector3<f64>, noise: f64, clear: Vector3<f64>| {
        for axis in (0..3).filter(|axis| clear[*axis].abs() > CLEAR) {
            hints.push(Hint { time, axis, change: change[axis], std: noise });
        }
    };
    for entry in &rests {
        let (rest, mean) = (&entry.rest, &entry.rest.accelerometer);
        // The noise of a trend combines three axes.
        let noise = mean.trend_noise / 3_f64.sqrt();
        if noise <= 0.0 || !noise.is_finite() || rest.seconds() <= 0.0 {
            continue;
        }
        if entry.verdict.reason != Reason::Creeping {
            rates.push((mean.trend / rest.seconds(), noise / rest.seconds()));
        }
        let middle = rest.start.seconds_since(first) + rest.seconds() / 2.0;
        // A step in the middle of a rest has a trend of one and a half times its size.
        hint(middle, mean.trend / 1.5, noise, mean.trend / noise);
    }
    for pair in rests.windows(2).filter(|pair| pair[0].rest.placement == pair[1].rest.placement) {
        let [one, next] = [pair[0], pair[1]].map(|entry| &entry.rest.accelerometer);
        let noise = (one.mean_variance() + next.mean_variance()).map(f64::sqrt);
        let mut change = next.mean - one.mean;
        // A knock tilts what it hits; of what it changed only the length is news.
        if pair[1].rest.start.seconds_since(pair[0].rest.end) > KNOCKED {
            let [before, after] = [one, next].map(|mean| calibration.correct(&mean.mean));
            change = after * (1.0 - before.norm() / after.norm().max(f64::MIN_POSITIVE));
        }
        let clear = change.component_div(&noise.map(|noise: f64| noise.max(1e-9)));
        hint(pair[1].rest.start.seconds_since(first) - 1e-3, change, noise.max(), clear);
    }
    RestChanges { slope: slope(&rates), hints }
}

/// Change of the reading of each face from its first to its last visit.
fn faces(seen: &[Placed], fixture: &Fixture, calibration: &Calibration, placement_std: f64) -> Vec<(String, f64, f64)> {
    let mut visits: BTreeMap<usize, Vec<&Placed>> = BTreeMap::new();
    for placed in seen {
        visits.entry(placed.face).or_default().push(placed);
    }
    // Change of length, which does not depend on tilt: it is that of the bias along the face.
    let length = |placed: &Placed| calibration.correct(&placed.observation.mean).norm();
    let change = |(face, visits): (usize, Vec<&Placed>)| {
        let (first, last, face) = (visits.first()?, visits.last()?, fixture.faces().get(face)?);
        let (change, seconds) = (length(last) - length(first), last.start.seconds_since(first.start));
        let clear = seconds > 0.0 && change.abs() > 3.0 * placement_std;
        clear.then(|| (face.name.clone(), change, seconds))
    };
    visits.into_iter().filter_map(change).collect()
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl Drift {
    /// Text on what was seen and what to do.
    pub(super) fn explanation(&self) -> String {
        let faces = self.faces.iter().map(|(name, change, seconds)| {
            format!("{name} by {change:+.3} m/s² in {:.0} min", (seconds / 60.0).max(1.0))
        });
        let faces: Vec<_> = faces.collect();
        let visits = match faces.is_empty() {
            true => String::new(),
            false => format!("; from its first visit to its last changed {}", faces.join(", ")),
        };
        let advice = match self.half_life {
            Some(half_life) => format!(
                "Let the sensor warm up, or let the fit forget with fit.half_life_s = {half_life:.0}, which follows these rests within its \
                 bars"
            ),
            None => "Let the sensor warm up, and show every face again".to_owned(),
        };
        match self.course {
            Course::Ramp(change, seconds) => format!(
                "the readings drift: bias {:+.3} {:+.3} {:+.3} m/s² in {:.1} min{visits}. {advice}",
                change.x,
                change.y,
                change.z,
                seconds / 60.0
            ),
            Course::Step(axis, change, [from, to], false) => format!(
                "the bias of {} may have moved by {change:+.3} m/s² between {from:.0} and {to:.0} s after the first rest, or a rest near that time is \
                 wrong. Show the faces along {} again",
                AXES[axis], AXES[axis]
            ),
            Course::Step(axis, change, [from, to], true) => format!(
                "the readings drift: the bias of {} moved by {change:+.3} m/s² between {from:.0} and {to:.0} s after the first \
                 rest{visits}. {advice}",
                AXES[axis]
            ),
            Course::Hinted(axis, change, time) => format!(
                "{} changed by {change:+.3} m/s² {time:.0} s after the first rest while the sensor lay still: that may be a tilt as \
                 well as a drift of its bias. Show the faces along {} again, on a firm surface",
                AXES[axis], AXES[axis]
            ),
        }
    }
}
