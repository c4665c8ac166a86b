//! Rests of one sensor from any number of recordings, in bounded memory.
//!
//! Up to [`MOST_RESTS`] every rest is kept. Beyond, time is divided into spans of 2^k ns and poses into cells of about
//! 11°, with the least k that leaves no more occupied cells than that. The rest with the most samples stands for its
//! cell, like the merging of near rests in an engine, which counts them as one placement. The kept rests are a function
//! of the set of rests alone.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use serde::{Deserialize, Serialize};

use crate::still::{Rest, TriadMean};

/// Most rests that are kept of one sensor.
pub const MOST_RESTS: usize = 2048;

/// Cells per unit of the direction vector.
const CELLS: f64 = 5.0;

/// A rest and the recording that it was found in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PastRest {
    /// Start of the first rest of its recording, ns.
    pub recording: i64,
    /// The rest without its secondary accelerometers.
    pub rest: Rest,
    /// Readings of the secondary accelerometers, by their names.
    pub secondary: BTreeMap<String, TriadMean>,
    /// Mean temperature over the rest, °C.
    pub temperature: Option<f64>,
}

/// Span of time and cell of pose.
type Cell = (i64, [i8; 3]);

/// The rests that are kept.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RestSet {
    /// Spans are 2^level ns long.
    level: u32,
    cells: BTreeMap<Cell, PastRest>,
}

impl RestSet {
    /// Adds a rest; one that is already there changes nothing.
    pub fn insert(&mut self, rest: PastRest) {
        self.put(rest);
        while self.cells.len() > MOST_RESTS && self.level < 63 {
            self.level += 1;
            let cells = std::mem::take(&mut self.cells);
            cells.into_values().for_each(|rest| self.put(rest));
        }
    }

    /// Adds the rests of another set.
    pub fn join(&mut self, other: Self) {
        // Rests that the other set could not keep apart cannot be kept apart here.
        if self.level < other.level {
            self.level = other.level;
            let cells = std::mem::take(&mut self.cells);
            cells.into_values().for_each(|rest| self.put(rest));
        }
        other.cells.into_values().for_each(|rest| self.insert(rest));
    }

    /// The rests ordered by their start.
    pub fn in_time(&self) -> Vec<&PastRest> {
        let mut rests: Vec<_> = self.cells.values().collect();
        rests.sort_by(|a, b| (a.rest.start, a.rest.end).cmp(&(b.rest.start, b.rest.end)).then_with(|| a.rank(b)));
        rests
    }

    /// Number of rests that are kept.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether no rest is kept.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Whether some rests stand for others.
    pub fn is_thinned(&self) -> bool {
        self.level > 0
    }

    fn put(&mut self, rest: PastRest) {
        match self.cells.entry(rest.cell(self.level)) {
            Entry::Vacant(place) => drop(place.insert(rest)),
            Entry::Occupied(mut place) => {
                if rest.rank(place.get()) == Ordering::Greater {
                    place.insert(rest);
                }
            }
        }
    }
}

impl PastRest {
    fn cell(&self, level: u32) -> Cell {
        let mean = self.rest.accelerometer.mean;
        let up = mean / mean.norm().max(f64::MIN_POSITIVE);
        let part = |axis: usize| libm::round(up[axis] * CELLS) as i8;
        (self.rest.start.nanos() >> level, [part(0), part(1), part(2)])
    }

    /// Order of rests by which the greater one stands for both: by samples of the accelerometer, then by all other
    /// fields.
    fn rank(&self, other: &Self) -> Ordering {
        let means = |rest: &Self| {
            let of = |mean: &TriadMean| {
                let numbers = mean.mean.iter().chain(&mean.covariance).copied().chain([mean.effective]);
                (mean.samples, numbers.collect::<Vec<_>>())
            };
            let Rest { accelerometer, gyroscope, .. } = &rest.rest;
            [accelerometer].into_iter().chain(gyroscope).chain(rest.secondary.values()).map(of).collect::<Vec<_>>()
        };
        let one_by_one = || {
            let (mine, theirs) = (means(self), means(other));
            let pairs = mine.iter().zip(&theirs).map(|((samples, numbers), (others, theirs))| {
                let numbers = numbers.iter().zip(theirs).map(|(a, b)| a.total_cmp(b));
                samples.cmp(others).then_with(|| numbers.fold(Ordering::Equal, Ordering::then))
            });
            pairs.fold(mine.len().cmp(&theirs.len()), Ordering::then)
        };
        let key = |rest: &Self| (rest.rest.accelerometer.samples, rest.rest.start, rest.rest.end);
        let place = |rest: &Self| (rest.rest.placement, rest.recording);
        let warmth = |rest: &Self| rest.temperature.unwrap_or(f64::NEG_INFINITY);
        key(self)
            .cmp(&key(other))
            .then_with(one_by_one)
            .then_with(|| place(self).cmp(&place(other)))
            .then_with(|| warmth(self).total_cmp(&warmth(other)))
            .then_with(|| self.secondary.keys().cmp(other.secondary.keys()))
    }
}
