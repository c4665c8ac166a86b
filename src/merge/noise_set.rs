//! Allan sums of one sensor from any number of recordings, in bounded memory: those of the recordings with the most
//! samples at rest, which is a function of the set of recordings alone. Sums at one rate add up.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::engine::allan_sums;
use crate::messages::Noise;
use crate::still::{AllanSums, Octaves};

/// Most recordings whose sums are kept.
const MOST_RECORDINGS: usize = 128;

/// Sums by recording and sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct NoiseSet(BTreeMap<i64, BTreeMap<String, AllanSums>>);

impl NoiseSet {
    /// The valid sums of one recording.
    pub(super) fn of(recording: i64, noise: &Noise) -> Self {
        let sums = noise.triads.iter().map(|triad| (triad.sensor.clone(), allan_sums(triad)));
        let sums: BTreeMap<_, _> = sums.filter(|(_, sums)| is_sound(sums)).collect();
        Self(if sums.is_empty() { BTreeMap::new() } else { BTreeMap::from([(recording, sums)]) })
    }

    pub(super) fn join(&mut self, other: Self) {
        for (recording, sums) in other.0 {
            let mine = self.0.entry(recording).or_default();
            if rank(mine) < rank(&sums) {
                *mine = sums;
            }
        }
        while self.0.len() > MOST_RECORDINGS {
            let least = self.0.iter().map(|(recording, sums)| (rank(sums), *recording)).min();
            let Some((_, recording)) = least else { break };
            self.0.remove(&recording);
        }
    }

    /// The sums of each sensor over the recordings from `begin` to `end`, at the rate of the one with the most samples.
    pub(super) fn total(&self, begin: i64, end: i64) -> BTreeMap<String, AllanSums> {
        let inside = || self.0.range(begin..=end.max(begin)).flat_map(|(_, sums)| sums);
        let mut total: BTreeMap<String, AllanSums> = BTreeMap::new();
        for (sensor, sums) in inside() {
            let largest = total.entry(sensor.clone()).or_default();
            if largest.all.samples < sums.all.samples {
                *largest = sums.clone();
            }
        }
        for (sensor, sum) in &mut total {
            let largest = sum.clone();
            let all = inside().filter(|(name, _)| *name == sensor).map(|(_, sums)| sums);
            let mut skipped = false;
            for sums in all {
                // The sums that it began with count once.
                if !skipped && *sums == largest {
                    skipped = true;
                } else {
                    sum.add(sums);
                }
            }
        }
        total
    }
}

/// Rank of a recording's sums: by number of samples, then by all their values.
fn rank(sums: &BTreeMap<String, AllanSums>) -> (u64, Vec<(&str, [u64; 3])>) {
    let samples = sums.values().map(|sums| sums.all.samples).fold(0, u64::saturating_add);
    let bits = |octaves: &Octaves| octaves.octaves.iter().map(|octave| octave.squares.sum()).sum::<f64>().to_bits();
    let said =
        sums.iter().map(|(name, sums)| (name.as_str(), [sums.seconds.to_bits(), bits(&sums.all), bits(&sums.lasting)]));
    (samples, said.collect())
}

fn is_sound(sums: &AllanSums) -> bool {
    /// More samples than any recording has (a century at 1 kHz).
    const MOST: u64 = 1 << 42;
    let octaves = |octaves: &Octaves| {
        let number = |value: f64| value.is_finite() && value >= 0.0;
        octaves.samples < MOST
            && octaves.octaves.iter().all(|octave| {
                octave.squares.iter().chain(&octave.freedom).all(|value| number(*value)) && octave.count < MOST
            })
    };
    sums.seconds.is_finite() && sums.seconds >= 0.0 && octaves(&sums.all) && octaves(&sums.lasting)
}
