//! History of an engine's rests, with the verdict on each.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::imu::Sensor;
use crate::messages::segment::Reason;
use crate::still::{Rest, TriadMean};

/// Largest number of rests of one kind (accepted on one face, or rejected) that are stored separately.
const MAX_KEPT: usize = 64;

/// Rests in the order of their ends.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct RestHistory {
    entries: Vec<JudgedRest>,
    forgotten: u64,
}

/// Rest with its verdict.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct JudgedRest {
    pub(super) rest: Rest,
    pub(super) verdict: Verdict,
    /// Verdict that was last published.
    pub(super) told: Option<Verdict>,
    /// Number of rests that it stands for.
    pub(super) count: u64,
    /// Total duration of these rests, s.
    pub(super) seconds: f64,
    /// Amount taken off its mean rate for its temperature, rad/s.
    #[serde(skip)]
    pub(super) rate_taken_off: Vector3<f64>,
}

/// Verdict on a rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Verdict {
    pub(super) reason: Reason,
    /// Nearest face of the fixture, and the angle to it in degrees, once the orientation is known.
    pub(super) face: Option<(usize, f64)>,
    pub(super) explanation: String,
    /// Whether it is laid to the unit of the gyroscope.
    #[serde(default)]
    pub(super) misread: bool,
}

impl Verdict {
    pub(super) fn is_accepted(&self) -> bool {
        self.reason == Reason::Accepted
    }

    /// Whether the IMU was at rest, on a face or not.
    pub(super) fn is_at_rest(&self) -> bool {
        matches!(self.reason, Reason::Accepted | Reason::Tilted)
    }

    /// Whether the verdict differs enough from the published one to be published again.
    pub(super) fn differs_from(&self, told: &Self) -> bool {
        /// Least change of tilt, degrees.
        const TILT: f64 = 1.0;
        let tilts = (self.face, told.face);
        let moved = matches!(tilts, (Some((_, now)), Some((_, then))) if (now - then).abs() > TILT);
        self.reason != told.reason
            || self.face() != told.face()
            || self.misread != told.misread
            || moved && !self.is_accepted()
    }

    /// Explains a turn at a constant rate by the unit of the gyroscope, if that is wrong.
    pub(super) fn lay_to_unit(&mut self, rate: f64, fault: &str) {
        if self.reason == Reason::Turning {
            self.misread = true;
            self.explanation = format!("mean rate of {rate:.3} as it is read: {fault}");
        }
    }

    /// Nearest face of the fixture.
    pub(super) fn face(&self) -> Option<usize> {
        self.face.map(|(face, _)| face)
    }

    fn kind(&self) -> Option<usize> {
        self.face().filter(|_| self.is_accepted())
    }
}

impl RestHistory {
    pub(super) fn add(&mut self, rest: Rest) {
        let verdict = Verdict { reason: Reason::TooShort, face: None, explanation: String::new(), misread: false };
        let seconds = rest.seconds();
        let rate_taken_off = Vector3::zeros();
        self.entries.push(JudgedRest { rest, verdict, told: None, count: 1, seconds, rate_taken_off });
    }

    /// Removes the readings of a triad from every rest; for the primary accelerometer, the rests themselves.
    pub(super) fn forget(&mut self, sensor: Sensor) {
        for entry in std::mem::take(&mut self.entries) {
            let JudgedRest { rest, count, .. } = entry;
            match rest.without(sensor) {
                Some(rest) => self.entries.push(JudgedRest { rest, ..entry }),
                None => self.forgotten += count,
            }
        }
    }

    pub(super) fn entries(&self) -> &[JudgedRest] {
        &self.entries
    }

    pub(super) fn entries_mut(&mut self) -> &mut [JudgedRest] {
        &mut self.entries
    }

    /// Number of rests found, including those no longer stored.
    pub(super) fn found(&self) -> u64 {
        self.forgotten + self.entries.iter().map(|entry| entry.count).sum::<u64>()
    }

    /// Number of accepted rests.
    pub(super) fn accepted(&self) -> u64 {
        self.entries.iter().filter(|entry| entry.verdict.is_accepted()).map(|entry| entry.count).sum()
    }

    /// Keeps memory constant. Of too many accepted rests on one face, the two nearest in time with like readings are
    /// merged; if there are no such two, or the rests are rejected ones, the oldest is dropped. Returns whether there were
    /// too many.
    pub(super) fn shrink(&mut self) -> bool {
        let before = self.entries.len();
        while let Some((kind, same)) = self.crowd() {
            let entries = &self.entries;
            let gap = |pair: &&[usize]| entries[pair[1]].rest.start.since(entries[pair[0]].rest.end);
            let alike = same.windows(2).filter(|pair| kind.is_some() && entries[pair[0]].reads_like(&entries[pair[1]]));
            match alike.min_by_key(gap) {
                Some(&[first, second]) => {
                    let later = self.entries.remove(second);
                    self.entries[first].absorb(&later);
                }
                _ => self.forgotten += self.entries.remove(same[0]).count,
            }
        }
        self.entries.len() < before
    }

    /// Kind of rests of which there are too many, and their indices.
    fn crowd(&self) -> Option<(Option<usize>, Vec<usize>)> {
        let mut kinds: BTreeMap<_, Vec<usize>> = BTreeMap::new();
        for (i, entry) in self.entries.iter().enumerate() {
            kinds.entry(entry.verdict.kind()).or_default().push(i);
        }
        kinds.into_iter().find(|(_, same)| same.len() > MAX_KEPT)
    }
}

impl JudgedRest {
    /// Whether the mean of both is as long as either: that of directions an angle δ apart is shorter by δ²/8.
    fn reads_like(&self, other: &Self) -> bool {
        /// Largest difference, m/s²: it shortens the mean by a ten thousandth of g at most.
        const APART: f64 = 0.25;
        (self.rest.accelerometer.mean - other.rest.accelerometer.mean).norm() <= APART
    }

    fn absorb(&mut self, later: &Self) {
        let rest = &mut self.rest;
        rest.end = later.rest.end;
        rest.crept = later.rest.crept;
        rest.accelerometer = merged(&rest.accelerometer, &later.rest.accelerometer);
        rest.gyroscope = both(rest.gyroscope.as_ref(), later.rest.gyroscope.as_ref());
        for (mine, theirs) in rest.secondary.iter_mut().zip(&later.rest.secondary) {
            *mine = both(mine.as_ref(), theirs.as_ref());
        }
        rest.temperature = match (rest.temperature, later.rest.temperature) {
            (Some(mine), Some(theirs)) => {
                let share = later.seconds / (self.seconds + later.seconds).max(f64::MIN_POSITIVE);
                Some(mine + (theirs - mine) * share)
            }
            (one, other) => one.or(other),
        };
        self.count += later.count;
        self.seconds += later.seconds;
    }
}

fn both(a: Option<&TriadMean>, b: Option<&TriadMean>) -> Option<TriadMean> {
    match (a, b) {
        (Some(a), Some(b)) => Some(merged(a, b)),
        (one, other) => one.or(other).cloned(),
    }
}

/// Merges two means as if of one rest; their difference is placement scatter, not noise.
fn merged(a: &TriadMean, b: &TriadMean) -> TriadMean {
    let share = b.effective / (a.effective + b.effective).max(f64::MIN_POSITIVE);
    TriadMean {
        samples: a.samples + b.samples,
        effective: a.effective + b.effective,
        mean: a.mean + (b.mean - a.mean) * share,
        covariance: a.covariance + (b.covariance - a.covariance) * share,
        trend: a.trend,
        trend_noise: a.trend_noise,
        ends: [a.ends[0], b.ends[1]],
        extremes: a.extremes.merged(&b.extremes),
        clipped: a.clipped + b.clipped,
        sketch: a.sketch.merged(&b.sketch),
    }
}
