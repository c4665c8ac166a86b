//! Sketch of the readings of a rest: hashes of sequences of them, by which a copy is recognised wherever its rest begins
//! and ends.
//!
//! A sequence is of so many runs of equal readings, each with its length: where a converter's step hides the noise, the
//! lengths are of chance, and where there is no noise, there are no runs. The smallest hashes are kept (Broder, "On the
//! resemblance and containment of documents", 1997): those of two rests with mostly the same readings are mostly the
//! same.

use std::collections::VecDeque;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Smallest hashes of a rest, in order; none if its readings repeat themselves or hardly change.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Sketch(Vec<u64>);

/// Number of hashes of a rest.
const MOST: usize = 16;
/// Number of runs of a sequence: two bits of chance each, or more.
const RUNS: usize = 32;
/// Base of the rolling hash (Karp and Rabin 1987), modulo 2⁶⁴, and its power to the number of runs.
const BASE: u64 = 0x9e37_79b9_7f4a_7c15;
const BASE_TO_RUNS: u64 = BASE.wrapping_pow(RUNS as u32);

impl Sketch {
    /// Hashes, in order.
    pub fn hashes(&self) -> &[u64] {
        &self.0
    }

    /// Combines the sketches of two rests.
    pub fn merged(&self, other: &Self) -> Self {
        let mut all: Vec<_> = self.0.iter().chain(&other.0).copied().collect();
        all.sort_unstable();
        all.dedup();
        all.truncate(MOST);
        Self(all)
    }
}

/// Maker of a sketch, in constant memory.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Sketcher {
    /// Hash of the current reading, how often it was read in a row, and whether the run may have begun before.
    current: Option<(u64, u64, bool)>,
    /// Hashes of the last runs, and the rolling hash over them.
    runs: VecDeque<u64>,
    rolled: u64,
    smallest: Vec<u64>,
    /// Whether a sequence occurred twice.
    repeats: bool,
}

impl Sketcher {
    /// Takes the next reading.
    pub(super) fn push(&mut self, value: &Vector3<f64>) {
        let reading = value.iter().fold(0, |hash, axis| mixed(hash ^ axis.to_bits()));
        self.current = match self.current {
            None => Some((reading, 1, true)),
            Some((before, times, cut)) if before == reading => Some((before, times + 1, cut)),
            Some((before, times, cut)) => {
                if !cut {
                    self.add(mixed(before ^ times));
                }
                Some((reading, 1, false))
            }
        };
    }

    /// Sketch of the readings so far.
    pub(super) fn sketch(&self) -> Sketch {
        if self.repeats { Sketch::default() } else { Sketch(self.smallest.clone()) }
    }

    fn add(&mut self, run: u64) {
        self.rolled = self.rolled.wrapping_mul(BASE).wrapping_add(run);
        if self.runs.len() == RUNS {
            let oldest = self.runs.pop_front().unwrap_or_default();
            self.rolled = self.rolled.wrapping_sub(oldest.wrapping_mul(BASE_TO_RUNS));
        }
        self.runs.push_back(run);
        if self.runs.len() < RUNS {
            return;
        }
        let hash = mixed(self.rolled);
        if self.smallest.len() == MOST && self.smallest.last().is_some_and(|largest| hash > *largest) {
            return;
        }
        match self.smallest.binary_search(&hash) {
            Ok(_) => self.repeats = true,
            Err(place) => {
                self.smallest.insert(place, hash);
                self.smallest.truncate(MOST);
            }
        }
    }
}

/// Hash of a number (the finaliser of SplitMix64, Steele et al. 2014).
fn mixed(number: u64) -> u64 {
    let mixed = number.wrapping_add(BASE);
    let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    use super::*;

    /// Readings with noise of this many steps of the converter.
    fn readings(count: usize, noise: f64, seed: u64) -> Vec<Vector3<f64>> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut axis = |mean: f64| (mean + noise * rng.sample::<f64, _>(StandardNormal)).round();
        (0..count).map(|_| Vector3::new(axis(0.3), axis(-7.1), axis(980.4))).collect()
    }

    fn shared(one: &[Vector3<f64>], other: &[Vector3<f64>]) -> usize {
        let sketch = |values: &[Vector3<f64>]| {
            let mut sketcher = Sketcher::default();
            values.iter().for_each(|value| sketcher.push(value));
            sketcher.sketch()
        };
        let (one, other) = (sketch(one), sketch(other));
        one.hashes().iter().filter(|hash| other.hashes().contains(hash)).count()
    }

    #[test]
    fn a_copy_is_known_wherever_it_is_cut() {
        for noise in [0.3, 1.0, 10.0] {
            let rest = readings(400, noise, 1);
            assert!(shared(&rest, &rest[1..]) > 10 && shared(&rest, &rest[..399]) > 10, "{noise}");
            assert!(shared(&rest[..300], &rest[100..]) > 3, "{noise}");
        }
    }

    #[test]
    fn rests_with_little_noise_or_none_share_nothing() {
        for noise in [0.0, 0.05, 0.15, 0.3] {
            for seed in 1..40 {
                assert_eq!(shared(&readings(1000, noise, 0), &readings(1000, noise, seed)), 0, "{noise}");
            }
        }
        let wave = |i: usize| Vector3::repeat((0.7 * (i % 50) as f64).sin());
        let waves: Vec<_> = (0..400).map(wave).collect();
        assert_eq!(shared(&waves, &waves[3..]), 0, "a wave is its own copy");
    }
}
