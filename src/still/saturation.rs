//! Lowest and highest readings of a triad with their counts, which show readings pinned to the end of the range.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Range of the readings of a triad, per axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReadingRange {
    /// Lowest readings.
    pub low: Vector3<f64>,
    /// Highest readings.
    pub high: Vector3<f64>,
    /// Number of times the lowest was read.
    pub at_low: [u64; 3],
    /// Number of times the highest was read.
    pub at_high: [u64; 3],
}

impl ReadingRange {
    /// Creates the range of one reading.
    pub fn of(value: &Vector3<f64>) -> Self {
        Self { low: *value, high: *value, at_low: [1; 3], at_high: [1; 3] }
    }

    /// Adds a reading.
    pub fn push(&mut self, value: &Vector3<f64>) {
        for axis in 0..3 {
            let value = value[axis];
            if value >= self.high[axis] {
                self.at_high[axis] = if value > self.high[axis] { 1 } else { self.at_high[axis] + 1 };
                self.high[axis] = value;
            }
            if value <= self.low[axis] {
                self.at_low[axis] = if value < self.low[axis] { 1 } else { self.at_low[axis] + 1 };
                self.low[axis] = value;
            }
        }
    }

    /// Combines the ranges of two sets of readings.
    pub fn merged(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            let (mine, theirs) = (self.high[axis], other.high[axis]);
            self.at_high[axis] = if theirs < mine { 0 } else { other.at_high[axis] }
                + if mine < theirs { 0 } else { self.at_high[axis] };
            let (mine, theirs) = (self.low[axis], other.low[axis]);
            self.at_low[axis] =
                if theirs > mine { 0 } else { other.at_low[axis] } + if mine > theirs { 0 } else { self.at_low[axis] };
        }
        self.low = self.low.inf(&other.low);
        self.high = self.high.sup(&other.high);
        self
    }

    /// Whether an axis never changed.
    pub fn is_constant(&self, axis: usize) -> bool {
        self.low[axis] == self.high[axis]
    }

    /// Largest magnitude on any axis.
    pub fn peak(&self) -> f64 {
        self.low.amax().max(self.high.amax())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn extremes(values: &[Vector3<f64>]) -> Option<ReadingRange> {
        let (first, rest) = values.split_first()?;
        let mut extremes = ReadingRange::of(first);
        rest.iter().for_each(|value| extremes.push(value));
        Some(extremes)
    }

    proptest! {
        #[test]
        fn the_extremes_of_two_parts_are_those_of_the_whole(
            rows in proptest::collection::vec((0_i8..4, 0_i8..2, -3_i8..3), 2..40),
            cut in 1_usize..39,
        ) {
            let row = |(x, y, z): (i8, i8, i8)| Vector3::new(f64::from(x), f64::from(y), f64::from(z));
            let values: Vec<_> = rows.into_iter().map(row).collect();
            let (first, second) = values.split_at(cut.min(values.len() - 1));
            let whole = extremes(&values).unwrap();
            prop_assert_eq!(extremes(first).unwrap().merged(&extremes(second).unwrap()), whole);
            for axis in 0..3 {
                let at = |edge: f64| values.iter().filter(|value| value[axis] == edge).count() as u64;
                prop_assert_eq!((whole.at_low[axis], whole.at_high[axis]), (at(whole.low[axis]), at(whole.high[axis])));
                prop_assert!(values.iter().all(|v| (whole.low[axis]..=whole.high[axis]).contains(&v[axis])));
            }
        }
    }
}
