//! Whether the gyroscope explains how gravity turned from one rest to the next: flipped axes and a wrong unit show there.
//! What becomes of a sensor that is found out is left to `faults`.
//!
//! A vector that is fixed in the world obeys a′ = −ω × a in the sensor's frame. If the readings are sign changes of both,
//! m = s∘a and w = g∘ω, then m′ = −(h∘w) × m with h = g∘(s_y s_z, s_z s_x, s_x s_y): of the 64 ways to flip axes eight
//! can be told apart. A flip of one accelerometer axis makes two signs of h negative, one of a gyroscope axis one, and
//! a flip of all accelerometer axes none.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::imu::Sample;
use crate::still::Rest;

/// What was integrated between rests.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Turns {
    /// The latest rates, oldest first.
    bins: VecDeque<Bin>,
    open: Option<Bin>,
    /// The last rest.
    before: Option<Departure>,
    /// When the sensor came to rest again, and the turn until then, as each hypothesis has it.
    arrived: Option<(Stamp, Vec<UnitQuaternion<f64>>)>,
    turns: Vec<Turn>,
}

/// The integral of the rates over some milliseconds.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Bin {
    start: Stamp,
    end: Stamp,
    /// ∫ rate dt, rad.
    angle: Vector3<f64>,
}

/// The rest that a turn begins at.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Departure {
    end: Stamp,
    /// Raw specific force, m/s².
    force: Vector3<f64>,
    /// Raw rate, rad/s.
    rate: Vector3<f64>,
}

/// From one rest to the next.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Turn {
    /// Raw specific force before and after, m/s².
    before: Vector3<f64>,
    after: Vector3<f64>,
    /// The attitude after in the frame before, by [`HYPOTHESES`].
    rotations: Vec<UnitQuaternion<f64>>,
}

/// A way in which the gyroscope may read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hypothesis {
    /// The sign of each axis against the accelerometer.
    pub(super) signs: [f64; 3],
    /// Whether it is in deg/s.
    pub(super) degrees: bool,
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

const HYPOTHESES: usize = 16;
/// Nanoseconds of a bin.
const BIN: i64 = 10_000_000;
/// So many bins are kept: ten seconds.
const BINS: usize = 1024;
/// Samples further apart than this say nothing of the time between them, in nanoseconds.
const GAP: i64 = 100_000_000;
/// So many turns suffice.
const MOST_TURNS: usize = 12;
const LEAST_TURNS: usize = 3;
/// Gravity must have turned by this to say anything, in degrees.
const TURNED: f64 = 30.0;

impl Hypothesis {
    fn of(index: usize) -> Self {
        let sign = |bit: usize| if index >> bit & 1 == 0 { 1.0 } else { -1.0 };
        Self { signs: [sign(0), sign(1), sign(2)], degrees: index >= HYPOTHESES / 2 }
    }

    /// The angle in rad that a reading integrated to.
    fn turn(self, reading: &Vector3<f64>) -> Vector3<f64> {
        let unit = if self.degrees { 1_f64.to_radians() } else { 1.0 };
        Vector3::from(self.signs).component_mul(reading) * unit
    }
}

impl Turns {
    /// Takes a reading of the gyroscope.
    pub(super) fn push(&mut self, sample: &Sample) {
        if self.turns.len() >= MOST_TURNS {
            return;
        }
        let Sample { stamp, value, .. } = sample;
        let Some(open) = self.open.as_mut().filter(|open| (0..GAP).contains(&stamp.since(open.end))) else {
            self.bins.clear();
            self.open = Some(Bin { start: *stamp, end: *stamp, angle: Vector3::zeros() });
            return;
        };
        open.angle += value * stamp.seconds_since(open.end);
        open.end = *stamp;
        if stamp.since(open.start) >= BIN {
            if self.bins.len() == BINS {
                self.bins.pop_front();
            }
            self.bins.push_back(*open);
            *open = Bin { start: *stamp, end: *stamp, angle: Vector3::zeros() };
        }
    }

    /// The sensor has come to rest.
    pub(super) fn arrive(&mut self, now: Stamp) {
        self.arrived = self.before.as_ref().and_then(|before| self.rotations(before)).map(|rotations| (now, rotations));
    }

    /// A rest has ended.
    pub(super) fn rest(&mut self, rest: &Rest) {
        if self.turns.len() >= MOST_TURNS {
            // What was learned stays; nothing more is.
            (self.bins, self.open, self.before, self.arrived) = Default::default();
            return;
        }
        let force = rest.accelerometer.mean;
        if let (Some(before), Some((at, rotations))) = (&self.before, self.arrived.take())
            && at >= rest.start
            && at <= rest.end
        {
            self.turns.push(Turn { before: before.force, after: force, rotations });
        }
        let rate = rest.gyroscope.as_ref().map(|mean| mean.mean);
        self.before = rate.map(|rate| Departure { end: rest.end, force, rate });
    }

    /// What the turns say, given how the accelerometer's readings are corrected.
    pub(super) fn verdict(&self, correct: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Axes {
        /// Degrees within which a hypothesis explains what was seen …
        const EXPLAINED: f64 = 20.0;
        /// … and beyond which it does not.
        const REFUTED: f64 = 35.0;
        let seen = self.turns.iter().map(|turn| (correct(&turn.before), correct(&turn.after), turn));
        let seen: Vec<_> = seen.filter(|(before, after, _)| degrees_between(before, after) > TURNED).collect();
        if seen.len() < LEAST_TURNS {
            return Axes::Unknown;
        }
        let error = |index: usize| {
            let errors = seen.iter().filter_map(|(before, after, turn)| {
                let rotation = turn.rotations.get(index)?;
                Some(degrees_between(&rotation.inverse_transform_vector(before), after).powi(2))
            });
            (errors.sum::<f64>() / seen.len() as f64).sqrt()
        };
        let as_it_is = error(0);
        if as_it_is < EXPLAINED {
            return Axes::Agree;
        }
        if as_it_is < REFUTED {
            return Axes::Unknown;
        }
        let possible: Vec<_> = (1..HYPOTHESES).filter(|index| error(*index) < REFUTED).collect();
        match possible.as_slice() {
            [only] if error(*only) < EXPLAINED => Axes::Otherwise(Hypothesis::of(*only)),
            _ => Axes::Disagree(as_it_is),
        }
    }

    /// The turn since a rest, if every moment of it was seen.
    fn rotations(&self, before: &Departure) -> Option<Vec<UnitQuaternion<f64>>> {
        self.bins.front().filter(|bin| bin.start <= before.end)?;
        let since = self.bins.iter().chain(&self.open).filter(|bin| bin.start >= before.end);
        let angles = since.map(|bin| bin.angle - before.rate * bin.end.seconds_since(bin.start));
        let angles: Vec<_> = angles.collect();
        let integrate = |index: usize| {
            let hypothesis = Hypothesis::of(index);
            let turn = |attitude: UnitQuaternion<f64>, angle| {
                attitude * UnitQuaternion::from_scaled_axis(hypothesis.turn(angle))
            };
            UnitQuaternion::new_normalize(angles.iter().fold(UnitQuaternion::identity(), turn).into_inner())
        };
        Some((0..HYPOTHESES).map(integrate).collect())
    }
}

fn degrees_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b)).to_degrees()
}
