//! Turns of a recording, stored in bounded memory.

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

/// Motion of the gyroscope between the rests.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct History {
    preintegrator: Preintegrator,
    limit: Limit,
    /// Stretches since the last rest, or the beginning.
    stretches: VecDeque<Stretch>,
    /// Start of the last rest, if the stretches begin there; otherwise they start from no rest.
    left: Option<Stamp>,
    legs: Vec<Leg>,
    /// Whether a stretch was added since the last look at them.
    news: bool,
}

/// Rotation of the sensor from one rest to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Duration, s.
    pub seconds: f64,
    /// Path of the rotation, including its noise, rad.
    pub path: f64,
    /// Angle between the attitudes before and after, rad; `None` if the motion was too long, or readings are missing.
    pub turned: Option<f64>,
    /// Largest angle between gravity and its direction before, rad.
    pub furthest: Option<f64>,
}

/// Largest number of stretches between two rests; with more they become longer.
const MOST_STRETCHES: usize = 128;
/// Largest number of pieces stored over all turns: a quarter turn takes about 25, or half of that once coarsened.
const MOST_REMEMBERED: usize = 700;
/// Largest number of legs from rest to rest.
const MOST_LEGS: usize = 64;

impl History {
    /// Takes a reading of the gyroscope.
    pub fn push(&mut self, sample: &Sample) {
        if let Some(stretch) = self.preintegrator.push(sample.stamp, &sample.value, &self.limit) {
            self.stretches.push_back(stretch);
            self.forget_old_clocks();
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

    /// Counts a reading as clipped about now, as reported by the driver.
    pub fn clip(&mut self) {
        self.preintegrator.clip();
    }

    /// Merges stretches while the sensor is at rest since `since`: those that end by `until` need no detail.
    pub fn at_rest(&mut self, since: Stamp, until: Stamp) {
        if !std::mem::take(&mut self.news) {
            return;
        }
        let inside = |stretch: &Stretch| stretch.start >= since && stretch.end <= until;
        let Some(newest) = self.stretches.iter().rposition(inside).filter(|newest| *newest > 0) else { return };
        // Only the one before it can be inside, too, whatever was merged already.
        if let (Some(first), Some(second)) = (self.stretches.get(newest - 1), self.stretches.get(newest))
            && inside(first)
            && !self.is_set_back(newest)
            // The first stretch of a rest stays, so that there is a boundary near its start.
            && newest > 1 && self.stretches.get(newest - 2).is_some_and(inside)
        {
            let both = first.then(second);
            self.stretches.remove(newest);
            if let Some(first) = self.stretches.get_mut(newest - 1) {
                *first = both;
            }
        }
    }

    /// Takes a finished rest; rests come in order.
    pub fn rest(&mut self, rest: &Rest) {
        let Some((arrival, departure)) = self.place(rest) else { return };
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

    /// Separates the readings so far from those that follow.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// Turns between accepted rests, which are identified by their start.
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

    /// Passage from one rest to a later one, identified by their starts; `None` if the gyroscope did not follow. At
    /// both ends, `rate` is the mean rate at rest, rad/s, and `up` the direction of specific force.
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
        // The oldest legs lose detail first, and then all but their summary.
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

    /// Number of stretches before a rest, and with those in it; `None` where they are too few to locate its beginning
    /// and end. After a clock was set back, its times may have been met before, and the latest count.
    fn place(&self, rest: &Rest) -> Option<(usize, usize)> {
        let mut end = self.stretches.len();
        while end > 0 {
            let begin = (1..end).rev().find(|&i| self.is_set_back(i)).unwrap_or(0);
            let arrival = self.stretches.range(begin..end).position(|stretch| stretch.start >= rest.start);
            let departure = self.stretches.range(begin..end).take_while(|stretch| stretch.end <= rest.end).count();
            if let Some(arrival) = arrival.filter(|arrival| departure >= *arrival) {
                return Some((begin + arrival, begin + departure));
            }
            end = begin;
        }
        None
    }

    /// Whether the clock was set back before a stretch.
    fn is_set_back(&self, stretch: usize) -> bool {
        let before = stretch.checked_sub(1).and_then(|before| self.stretches.get(before));
        before.zip(self.stretches.get(stretch)).is_some_and(|(before, after)| after.start < before.end)
    }

    /// Drops stretches from before the clock was set back twice: no rest to come is among them.
    fn forget_old_clocks(&mut self) {
        let last = self.stretches.len().saturating_sub(1);
        if self.is_set_back(last)
            && let Some(first) = (1..last).find(|&i| self.is_set_back(i))
        {
            self.stretches.drain(..first);
            self.left = None;
        }
    }

    /// Merges stretches in pairs, and makes those to come as long.
    fn coarsen(&mut self) {
        let mut single = false;
        let mut coarser: VecDeque<Stretch> = VecDeque::with_capacity(self.stretches.len());
        for stretch in self.stretches.drain(..) {
            match coarser.back_mut().filter(|last| single && stretch.start >= last.end) {
                Some(last) => {
                    *last = last.then(&stretch);
                    single = false;
                }
                None => {
                    coarser.push_back(stretch);
                    single = true;
                }
            }
        }
        self.stretches = coarser;
        self.limit = Limit { path: 2.0 * self.limit.path, seconds: 2.0 * self.limit.seconds };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_history_takes_no_more_than_64_kib_of_a_checkpoint() {
        let mut history = History::default();
        let mut samples = (0_u32..).map(|i| {
            let stamp = Stamp::from_nanos(1_000_000_000_000_000_000 + 10_000_000 * i64::from(i));
            let value = Vector3::new(1.0, 0.5, 0.25) * libm::sin(0.01 * f64::from(i));
            Sample { stamp, log_time: stamp.nanos() as u64, value }
        });
        let mut turn = |history: &mut History| {
            while history.stretches.len() < MOST_STRETCHES {
                let sample = samples.next().unwrap();
                history.feel(&sample);
                history.push(&sample);
            }
        };
        for _ in 0..=MOST_LEGS {
            turn(&mut history);
            let stretches: Vec<_> = history.stretches.drain(..).collect();
            let sum = stretches.iter().copied().reduce(|one, next| one.then(&next)).unwrap();
            let pieces = stretches.iter().map(|stretch| stretch.integrals).collect();
            history.remember(Leg { from: sum.start, to: sum.end, pieces, rest: Some(sum.integrals), sum });
        }
        turn(&mut history);
        let bytes = rmp_serde::to_vec_named(&history).unwrap();
        assert!((40_000..=65_536).contains(&bytes.len()), "{} bytes", bytes.len());
        let again: History = rmp_serde::from_slice(&bytes).unwrap();
        assert_eq!(rmp_serde::to_vec_named(&again).unwrap(), bytes);
    }
}
