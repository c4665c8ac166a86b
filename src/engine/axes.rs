//! Whether the gyroscope explains how gravity turned from one rest to the next: flipped axes and a wrong unit show there.
//! What becomes of a sensor that is found out is left to `fault_detection`.
//!
//! A vector that is fixed in the world obeys a′ = −ω × a in the sensor's frame. If the readings are sign changes of both,
//! m = s∘a and w = g∘ω, then m′ = −(h∘w) × m with h = g∘(s_y s_z, s_z s_x, s_x s_y): of the 64 ways to flip axes eight
//! can be told apart. A flip of one accelerometer axis makes two signs of h negative, one of a gyroscope axis one, and
//! a flip of all accelerometer axes none.

use nalgebra::{Matrix3, Vector3};

use super::rest_history::JudgedRest;
use crate::Stamp;
use crate::messages::segment::Reason;
use crate::turns::{Candidate, Ends, History, Piece, follow};

/// A way in which the gyroscope may read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hypothesis {
    /// The sign of each axis against the accelerometer.
    pub(super) signs: [f64; 3],
    /// What its readings are in.
    pub(super) unit: Unit,
}

/// Unit of rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Radians,
    Degrees,
}

const UNITS: [Unit; 2] = [Unit::Radians, Unit::Degrees];

impl Unit {
    /// In rad/s.
    fn value(self) -> f64 {
        match self {
            Self::Radians => 1.0,
            Self::Degrees => 1_f64.to_radians(),
        }
    }
}

/// What the turns say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Axes {
    /// Too little.
    Unknown,
    /// The gyroscope explains how gravity turned.
    Agree,
    /// It would, if it read like this.
    Otherwise(Hypothesis),
    /// It does not, by so many degrees (root mean square).
    Disagree(f64),
}

const SIGNS: usize = 8;
const LEAST_TURNS: usize = 3;
/// So many of the latest suffice.
const MOST_TURNS: usize = 12;
/// Longer ones are integrated too coarsely, rad.
const LONGEST_PIECE: f64 = 0.5;
/// Gravity must have turned by this to say anything, in degrees.
const TURNED: f64 = 30.0;

impl Hypothesis {
    fn of(index: usize) -> Self {
        let sign = |bit: usize| if index >> bit & 1 == 0 { 1.0 } else { -1.0 };
        Self { signs: [sign(0), sign(1), sign(2)], unit: UNITS[index / SIGNS % UNITS.len()] }
    }

    /// What maps readings to rates.
    fn candidate(self) -> Candidate {
        Candidate::of_inverse(Matrix3::from_diagonal(&(Vector3::from(self.signs) * self.unit.value())))
    }
}

/// A turn by which gravity turned, too.
struct Seen {
    pieces: Vec<Piece>,
    ends: Ends,
}

impl Seen {
    /// By how many degrees a hypothesis misses the direction after; `None` where the turn does not tell.
    fn miss(&self, hypothesis: Hypothesis) -> Option<f64> {
        let resolved = self.pieces.iter().all(|piece| hypothesis.unit.value() * piece.angle.norm() <= LONGEST_PIECE);
        let up = resolved.then(|| follow(self.pieces.iter(), &hypothesis.candidate(), &self.ends))?;
        Some(degrees_between(&up, &self.ends.up[1]))
    }
}

/// What the turns say, given how the accelerometer's readings are corrected.
pub(super) fn verdict(
    history: &History,
    entries: &[JudgedRest],
    correct: impl Fn(&Vector3<f64>) -> Vector3<f64>,
) -> Axes {
    /// Degrees within which a hypothesis explains what was seen …
    const EXPLAINED: f64 = 20.0;
    /// … and beyond which it does not.
    const REFUTED: f64 = 35.0;
    let seen = seen(history, entries, correct);
    if seen.len() < LEAST_TURNS {
        return Axes::Unknown;
    }
    let error = |index: usize| {
        let misses: Vec<_> = seen.iter().filter_map(|seen| seen.miss(Hypothesis::of(index))).collect();
        let told = misses.len() >= LEAST_TURNS;
        told.then(|| (misses.iter().map(|miss| miss * miss).sum::<f64>() / misses.len() as f64).sqrt())
    };
    let as_it_is = error(0);
    if as_it_is.is_some_and(|error| error < EXPLAINED) {
        return Axes::Agree;
    }
    if as_it_is.is_some_and(|error| error < REFUTED) {
        return Axes::Unknown;
    }
    let others = (1..SIGNS * UNITS.len()).filter_map(|index| Some((index, error(index)?)));
    let possible: Vec<_> = others.filter(|(_, error)| *error < REFUTED).collect();
    match (possible.as_slice(), as_it_is) {
        ([(only, error)], _) if *error < EXPLAINED => Axes::Otherwise(Hypothesis::of(*only)),
        (_, Some(error)) => Axes::Disagree(error),
        // It turned further than can be believed, and no unit explains it.
        (_, None) => Axes::Unknown,
    }
}

/// The turns that say something of the axes.
fn seen(history: &History, entries: &[JudgedRest], correct: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Vec<Seen> {
    // What a wrong unit or a wrong axis makes of a rest is no reason to do without it.
    let stood = |entry: &&JudgedRest| {
        matches!(entry.verdict.reason, Reason::Accepted | Reason::Tilted | Reason::Turning | Reason::Outlier)
    };
    let at = |start: Stamp| entries.iter().find(|entry| entry.rest.start == start).filter(stood);
    let turns = history.turns(|start| at(start).is_some_and(|entry| entry.rest.gyroscope.is_some()));
    let told = turns.into_iter().rev().filter(|turn| turn.unusable(None).is_none());
    let seen = told.filter_map(|turn| {
        let [before, after] = [at(turn.from)?, at(turn.to)?];
        let up = |entry: &JudgedRest| correct(&entry.rest.accelerometer.mean).try_normalize(f64::MIN_POSITIVE);
        let rate = |entry: &JudgedRest| Some(entry.rest.gyroscope.as_ref()?.mean);
        let ends = Ends { up: [up(before)?, up(after)?], rate: [rate(before)?, rate(after)?], by_up: Matrix3::zeros() };
        let turned = degrees_between(&ends.up[0], &ends.up[1]) > TURNED;
        turned.then(|| Seen { pieces: turn.pieces(), ends })
    });
    seen.take(MOST_TURNS).collect()
}

fn degrees_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b)).to_degrees()
}
