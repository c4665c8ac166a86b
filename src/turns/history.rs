//! The turns of a recording, remembered within bounds.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::leg::{Leg, Turn};
use super::piece::Candidate;
use super::prediction::{Ends, furthest, motion};
use super::preintegrator::{Limit, Preintegrator, Stretch};
use crate::Stamp;
use crate::imu::Sample;
use crate::still::Rest;

/// What the gyroscope did between the rests.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct History {
    preintegrator: Preintegrator,
    limit: Limit,
    /// Since the last rest, or the beginning.
    stretches: VecDeque<Stretch>,
    /// Whether the last rest lies at their beginning; without it they lead from nowhere.
    left: Option<Stamp>,
    legs: Vec<Leg>,
    /// Whether a stretch was added since they were last looked through.
    news: bool,
}

/// How the sensor came from one rest to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// How long that took.
    pub seconds: f64,
    /// All that it turned on the way, rad; its noise is in it.
    pub path: f64,
    /// What is left of that: the angle between the attitudes before and after, rad; `None` where the way was too long, or
    /// readings are missing.
    pub turned: Option<f64>,
    /// The furthest that gravity came from where it was before, rad.
    pub furthest: Option<f64>,
}

/// So many stretches lie between two rests at most: where there would be more they become longer.
const MOST_STRETCHES: usize = 128;
/// So many pieces are remembered of all turns: a quarter turn takes about 25, or half of that.
const MOST_REMEMBERED: usize = 900;
/// So many ways from rest to rest.
const MOST_LEGS: usize = 64;

impl History {
    /// Takes a reading of the gyroscope.
    pub fn push(&mut self, sample: &Sample) {
        if let Some(stretch) = self.preintegrator.push(sample.stamp, &sample.value, &self.limit) {
            self.stretches.push_back(stretch);
            self.news = true;
            if self.stretches.len() > MOST_STRETCHES {
                self.coarsen();
            }
        }
    }

    /// Takes a reading of the accelerometer.
    pub fn feel(&mut self, sample: &Sample) {
        self.preintegrator.feel(&sample.value);
    }

    /// The driver says that a reading was clipped, about now.
    pub fn clip(&mut self) {
        self.preintegrator.clip();
    }

    /// The sensor is at rest since then: what is older than `until` can be kept as one.
    pub fn at_rest(&mut self, since: Stamp, until: Stamp) {
        if !std::mem::take(&mut self.news) {
            return;
        }
        let inside = |stretch: &Stretch| stretch.start >= since && stretch.end <= until;
        let Some(newest) = self.stretches.iter().rposition(inside).filter(|newest| *newest > 0) else { return };
        // Only the one before it can be inside, too: that holds whatever was already put together.
        if let (Some(first), Some(second)) = (self.stretches.get(newest - 1), self.stretches.get(newest))
            && inside(first)
            // The first of a rest stays, so that there is a boundary near its start.
            && newest > 1 && self.stretches.get(newest - 2).is_some_and(inside)
        {
            let both = first.then(second);
            self.stretches.remove(newest);
            if let Some(first) = self.stretches.get_mut(newest - 1) {
                *first = both;
            }
        }
    }

    /// A rest has ended; they come in order.
    pub fn rest(&mut self, rest: &Rest) {
        let Some(arrival) = self.stretches.iter().position(|stretch| stretch.start >= rest.start) else { return };
        let departure = self.stretches.iter().take_while(|stretch| stretch.end <= rest.end).count();
        if departure < arrival {
            // Too short to tell where it begins and ends.
            return;
        }
        let mut inside = self.stretches.drain(..departure);
        let before: Vec<_> = inside.by_ref().take(arrival).collect();
        let resting = inside.reduce(|one, next| one.then(&next)).map(|resting| resting.integrals);
        if let (Some(from), Some(sum)) = (self.left, before.iter().copied().reduce(|one, next| one.then(&next))) {
            let pieces = before.iter().map(|stretch| stretch.integrals).collect();
            self.remember(Leg { from, to: rest.start, pieces, rest: resting, sum });
        }
        self.left = Some(rest.start);
        self.limit = Limit::default();
    }

    /// What was read so far is not to be compared with what follows.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The turns between the rests that are believed, each called by when it began.
    pub fn turns(&self, believed: impl Fn(Stamp) -> bool) -> Vec<Turn<'_>> {
        let legs = self.legs.as_slice();
        let mut turns = Vec::new();
        let mut start = None;
        for (i, leg) in legs.iter().enumerate() {
            let connected = i > 0 && legs[i - 1].to == leg.from;
            if believed(leg.from) {
                start = Some(i);
            } else if !connected {
                start = None;
            }
            if let Some(first) = start.filter(|_| believed(leg.to)) {
                turns.extend(Turn::of(&legs[first..=i], self.preintegrator.peak()));
            }
        }
        turns
    }

    /// How the sensor came from one rest to a later one; `None` if the gyroscope did not follow. Both are called by when they
    /// began; at both ends, `rate` is what the gyroscope read at rest, rad/s, and `up` the direction of specific force.
    pub fn passage(&self, [from, to]: [Stamp; 2], rate: [Vector3<f64>; 2], up: [Vector3<f64>; 2]) -> Option<Passage> {
        let legs = self.legs.as_slice();
        let first = legs.iter().position(|leg| leg.from == from)?;
        let last = first + legs[first..].iter().position(|leg| leg.to == to)?;
        let legs = &legs[first..=last];
        if legs.windows(2).any(|pair| pair[0].to != pair[1].from) {
            return None;
        }
        let turn = Turn::of(legs, self.preintegrator.peak())?;
        let whole = turn.unusable(None).is_none() && turn.resolves(1.0);
        let followed = whole.then(|| {
            let pieces = turn.pieces();
            let ends = Ends { up, rate, by_up: Matrix3::zeros() };
            let perfect = Candidate::default();
            (motion(pieces.iter(), &perfect, &ends).angle, furthest(pieces.iter(), &perfect, &ends))
        });
        Some(Passage {
            seconds: turn.seconds(),
            path: turn.path(),
            turned: followed.map(|(turned, _)| turned),
            furthest: followed.map(|(_, furthest)| furthest),
        })
    }

    fn remember(&mut self, leg: Leg) {
        if self.legs.len() == MOST_LEGS {
            self.legs.remove(0);
        }
        self.legs.push(leg);
        // The oldest ways lose detail first, and then all but what they were like.
        for shrink in [Leg::coarsen as fn(&mut Leg), Leg::forget] {
            let mut total: usize = self.legs.iter().map(|leg| leg.pieces.len()).sum();
            for leg in &mut self.legs {
                if total <= MOST_REMEMBERED {
                    return;
                }
                total -= leg.pieces.len();
                shrink(leg);
                total += leg.pieces.len();
            }
        }
    }

    /// Puts pairs together until half are left, and makes those to come as long.
    fn coarsen(&mut self) {
        let pairs: Vec<_> = self.stretches.drain(..).collect();
        let both = |pair: &[Stretch]| pair.iter().copied().reduce(|one, next| one.then(&next));
        self.stretches.extend(pairs.chunks(2).filter_map(both));
        self.limit = Limit { path: 2.0 * self.limit.path, seconds: 2.0 * self.limit.seconds };
    }
}
