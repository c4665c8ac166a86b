//! Alignment of readings with a reference: the reference at the stamp of each reading, interpolated between its
//! samples.

use std::collections::VecDeque;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Largest number of readings that wait for the reference; the oldest are dropped.
const WAITING: usize = 4096;

/// Interpolator of a reference at the readings of the triads beside it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct TimeInterpolation {
    /// Last four samples of the reference, oldest first.
    known: VecDeque<(Stamp, [Vector3<f64>; 2])>,
    /// Force that waits for the rate of the same stamp, or rate that waits for the force: stamp, quantity, value.
    half: Option<(Stamp, usize, Vector3<f64>)>,
    /// Readings that wait for the reference: stamp, triad, value.
    waiting: VecDeque<(Stamp, usize, Vector3<f64>)>,
    /// Longest step between samples of the reference that is interpolated across, ns.
    gap: i64,
}

impl TimeInterpolation {
    /// Creates an interpolator across steps of the reference of at most `gap_s` seconds.
    pub fn new(gap_s: f64) -> Self {
        Self { gap: (gap_s * 1e9) as i64, ..Self::default() }
    }

    /// Takes a reading of a triad.
    pub fn reading(&mut self, triad: usize, stamp: Stamp, value: Vector3<f64>) {
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back((stamp, triad, value));
    }

    /// Takes one quantity of the reference: 0 is the specific force, 1 the angular rate. Both form one sample if their
    /// stamps agree. Readings that can now be interpolated go to `sink`.
    pub fn reference(
        &mut self,
        quantity: usize,
        stamp: Stamp,
        value: Vector3<f64>,
        sink: &mut impl FnMut(usize, Vector3<f64>, [Vector3<f64>; 2]),
    ) {
        let both = match self.half {
            Some((other, of, first)) if other == stamp && of != quantity => {
                if of == 0 {
                    [first, value]
                } else {
                    [value, first]
                }
            }
            _ => {
                self.half = Some((stamp, quantity, value));
                return;
            }
        };
        self.half = None;
        if self.known.back().is_some_and(|&(last, _)| !(1..=self.gap).contains(&stamp.since(last))) {
            self.known.clear();
        }
        if self.known.len() == 4 {
            self.known.pop_front();
        }
        self.known.push_back((stamp, both));
        let Some((from, until)) = self.middle() else { return };
        while let Some(&(at, triad, value)) = self.waiting.front() {
            if at > until {
                break;
            }
            self.waiting.pop_front();
            if at >= from {
                sink(triad, value, self.interpolate(at));
            }
        }
    }

    /// Interval between the second and the third of four samples, where a cubic is most accurate.
    fn middle(&self) -> Option<(Stamp, Stamp)> {
        match (self.known.get(1), self.known.get(2), self.known.get(3)) {
            (Some(&(from, _)), Some(&(until, _)), Some(_)) => Some((from, until)),
            _ => None,
        }
    }

    /// Evaluates the cubic through the four samples (Lagrange).
    fn interpolate(&self, at: Stamp) -> [Vector3<f64>; 2] {
        let mut sum = [Vector3::zeros(); 2];
        for &(own, values) in &self.known {
            let others = self.known.iter().filter(|(stamp, _)| *stamp != own);
            let weight: f64 = others.map(|&(other, _)| at.since(other) as f64 / own.since(other) as f64).product();
            sum[0] += values[0] * weight;
            sum[1] += values[1] * weight;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// True force and rate, at one rotation a second.
    fn truth(stamp: Stamp) -> [Vector3<f64>; 2] {
        let angle = stamp.nanos() as f64 * 1e-9 * std::f64::consts::TAU;
        [Vector3::new(libm::cos(angle), libm::sin(angle), 0.0) * 9.8, Vector3::z() * libm::sin(angle)]
    }

    /// Pairs of a triad that reads the force itself at 130 Hz, beside a reference at 100 Hz without its samples in a
    /// gap.
    fn aligned(gap: std::ops::Range<i64>) -> Vec<(Vector3<f64>, [Vector3<f64>; 2])> {
        let mut interpolation = TimeInterpolation::new(0.1);
        let mut pairs = Vec::new();
        for i in 0..13_000_i64 {
            let stamp = Stamp::from_nanos(i * 100_000);
            if i % 77 == 0 {
                interpolation.reading(3, stamp, truth(stamp)[0]);
            }
            if i % 100 == 0 && !gap.contains(&i) {
                for quantity in [1, 0] {
                    interpolation.reference(quantity, stamp, truth(stamp)[quantity], &mut |triad, value, reference| {
                        assert_eq!(triad, 3);
                        pairs.push((value, reference));
                    });
                }
            }
        }
        pairs
    }

    #[test]
    fn between_its_samples_the_reference_is_interpolated() {
        let pairs = aligned(0..0);
        assert!(pairs.len() > 160, "{}", pairs.len());
        for (value, reference) in pairs {
            // Linear interpolation would be off by up to 5 mm/s².
            assert!((value - reference[0]).norm() < 1e-5, "{}", (value - reference[0]).norm());
        }
    }

    #[test]
    fn nothing_is_made_up_across_a_gap() {
        let (whole, holed) = (aligned(0..0).len(), aligned(4000..8000).len());
        assert!((50..62).contains(&(whole - holed)), "{whole} {holed}");
    }
}
