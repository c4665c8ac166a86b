//! Allan variance of one triad at rest, by octaves: a cascade of averages in constant memory, and its sums over rests.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Number of averages in a mean that an octave compares …
const OVERLAP: u64 = 4;
/// … with as many before them. No rest has more octaves than this.
const MAX_OCTAVES: usize = 28;

/// Octave l: squared differences of neighbouring means over τ = 4·2^l samples, taken every quarter of τ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Octave {
    /// Sum Σ d² of each axis.
    pub squares: Vector3<f64>,
    /// Number of differences.
    pub count: u64,
    /// Degrees of freedom of the sum if the noise is white, and if it is a random walk (NIST SP 1065, 5.4).
    pub freedom: [f64; 2],
}

/// Sums over rests. Those of several recordings at one rate can be added.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Octaves {
    /// Number of samples in the rests.
    pub samples: u64,
    /// Number of rests.
    pub rests: u32,
    /// Duration of the shortest rest, s; infinite without one.
    pub shortest: f64,
    /// Octaves, from τ = 4 samples on.
    pub octaves: Vec<Octave>,
}

/// Allan sums of one triad over all its rests.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AllanSums {
    /// Total duration of the rests, s.
    pub seconds: f64,
    /// Sums over all rests.
    pub all: Octaves,
    /// Sums over the long rests, without the first seconds, in which a sensor that was put down settles.
    pub lasting: Octaves,
}

/// Open rest of one triad, as averages over 2^l samples of each level l.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Cascade {
    /// Origin of the readings, so that no digits are lost to gravity.
    origin: Vector3<f64>,
    samples: u64,
    settling: u64,
    levels: Vec<Level>,
}

/// Latest averages of a level.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Level {
    /// Number of averages so far.
    seen: u64,
    /// Last four averages as a ring, and the last four sums of four.
    averages: [Vector3<f64>; 4],
    sums: [Vector3<f64>; 4],
    all: (Vector3<f64>, u64),
    /// Sum and number of the squared differences that do not touch the first seconds.
    settled: (Vector3<f64>, u64),
}

impl AllanSums {
    /// Sample period, s.
    pub fn period(&self) -> Option<f64> {
        let intervals = self.all.samples.checked_sub(self.all.rests.into()).filter(|intervals| *intervals > 0)?;
        Some(self.seconds / intervals as f64)
    }

    /// Computes the sums of one rest, sampled every `period` seconds. The first `settling` samples do not count for
    /// long rests, which last at least `lasting` seconds.
    pub fn of_rest(values: &[Vector3<f64>], period: f64, settling: u64, lasting: f64) -> Option<Self> {
        let mut cascade = Cascade::default();
        cascade.begin(settling);
        values.iter().for_each(|value| cascade.push(value));
        cascade.end(period * values.len().checked_sub(1)? as f64, lasting)
    }

    /// Adds the sums of other rests at the same rate. Those at a rate that differs by more than 2 % are ignored.
    pub fn add(&mut self, other: &Self) {
        const ALIKE: f64 = 0.02;
        if let (Some(mine), Some(theirs)) = (self.period(), other.period())
            && (mine - theirs).abs() > ALIKE * mine
        {
            return;
        }
        self.seconds += other.seconds;
        self.all.add(&other.all);
        self.lasting.add(&other.lasting);
    }
}

impl Octaves {
    /// Adds the sums of other rests.
    pub fn add(&mut self, other: &Self) {
        if other.rests == 0 {
            return;
        }
        self.shortest = if self.rests == 0 { other.shortest } else { self.shortest.min(other.shortest) };
        self.samples += other.samples;
        self.rests += other.rests;
        if self.octaves.len() < other.octaves.len() {
            self.octaves.resize(other.octaves.len(), Octave::default());
        }
        for (mine, theirs) in self.octaves.iter_mut().zip(&other.octaves) {
            mine.squares += theirs.squares;
            mine.count += theirs.count;
            mine.freedom = [0, 1].map(|kind| mine.freedom[kind] + theirs.freedom[kind]);
        }
    }

    /// Collects the octaves of one rest.
    fn of(levels: impl Iterator<Item = (Vector3<f64>, u64)>, samples: u64, seconds: f64) -> Self {
        let octaves = levels.enumerate().map(|(level, (squares, count))| {
            let freedom = if count > 0 { freedom(samples, OVERLAP << level) } else { [0.0; 2] };
            Octave { squares, count, freedom }
        });
        let mut octaves: Vec<_> = octaves.collect();
        let told = octaves.iter().take_while(|octave| octave.count > 0).count();
        octaves.truncate(told);
        Self { samples, rests: 1, shortest: seconds, octaves }
    }
}

/// Equivalent degrees of freedom of overlapping Allan variances over `m` of `n` samples, for white noise and random
/// walk of the quantity (NIST SP 1065, table 5: "white FM" and "random walk FM"), at least one.
fn freedom(n: u64, m: u64) -> [f64; 2] {
    let (n, m) = (n as f64, m as f64);
    let white = (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * (4.0 * m * m) / (4.0 * m * m + 5.0);
    let walk = (n - 2.0) / m * ((n - 1.0).powi(2) - 3.0 * m * (n - 1.0) + 4.0 * m * m) / (n - 3.0).powi(2);
    [white.max(1.0), walk.max(1.0)]
}

impl Cascade {
    /// Begins a rest, of whose samples the first `settling` are not settled.
    pub(super) fn begin(&mut self, settling: u64) {
        self.levels.clear();
        (self.samples, self.settling) = (0, settling);
    }

    pub(super) fn push(&mut self, value: &Vector3<f64>) {
        if self.samples == 0 {
            self.origin = *value;
        }
        self.samples += 1;
        let mut average = value - self.origin;
        for level in 0..MAX_OCTAVES {
            if level == self.levels.len() {
                self.levels.push(Level::default());
            }
            match self.levels[level].push(average, level, self.settling) {
                Some(pair) => average = pair,
                None => return,
            }
        }
    }

    /// Returns the sums of the rest, which lasted `seconds`; from `lasting` seconds on it is a long one.
    pub(super) fn end(&self, seconds: f64, lasting: f64) -> Option<AllanSums> {
        if self.samples < 2 {
            return None;
        }
        let all = Octaves::of(self.levels.iter().map(|level| level.all), self.samples, seconds);
        let settled = self.samples.saturating_sub(self.settling);
        let lasting = match seconds >= lasting {
            true => Octaves::of(self.levels.iter().map(|level| level.settled), settled, seconds),
            false => Octaves::default(),
        };
        Some(AllanSums { seconds, all, lasting })
    }
}

impl Level {
    /// Takes the next average over 2^`level` samples; every second one yields an average of the next level.
    fn push(&mut self, average: Vector3<f64>, level: usize, settling: u64) -> Option<Vector3<f64>> {
        let place = (self.seen % OVERLAP) as usize;
        self.seen += 1;
        let before = self.averages[place ^ 1];
        self.averages[place] = average;
        if self.seen >= OVERLAP {
            let [a, b, c, d] = &self.averages;
            let sum = (a + b) + (c + d);
            let earlier = std::mem::replace(&mut self.sums[place], sum);
            if let Some(first) = self.seen.checked_sub(2 * OVERLAP) {
                let difference = (sum - earlier) / OVERLAP as f64;
                let square = difference.component_mul(&difference);
                add(&mut self.all, &square);
                if first << level >= settling {
                    add(&mut self.settled, &square);
                }
            }
        }
        (place % 2 == 1).then(|| (before + average) / 2.0)
    }
}

fn add((squares, count): &mut (Vector3<f64>, u64), square: &Vector3<f64>) {
    *squares += square;
    *count += 1;
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The same computation at once: averages of 2^l samples, means of four of them, their differences.
    fn vectorised(values: &[f64], level: usize, skip: usize) -> (f64, u64) {
        let averages: Vec<f64> =
            values.chunks_exact(1 << level).map(|chunk| chunk.iter().sum::<f64>() / chunk.len() as f64).collect();
        let means: Vec<f64> = averages.windows(4).map(|four| four.iter().sum::<f64>() / 4.0).collect();
        let pairs = means.iter().zip(means.iter().skip(4)).enumerate().filter(|(first, _)| first << level >= skip);
        pairs.fold((0.0, 0), |(squares, count), (_, (one, other))| (squares + (other - one).powi(2), count + 1))
    }

    fn cascade(values: &[f64], settling: u64) -> Cascade {
        let mut cascade = Cascade::default();
        cascade.begin(settling);
        values.iter().for_each(|value| cascade.push(&Vector3::new(*value, 2.0 * value, 9.81)));
        cascade
    }

    proptest! {
        #[test]
        fn the_cascade_says_what_a_computation_in_one_piece_says(
            values in proptest::collection::vec(-1.0..1.0_f64, 2..700), settling in 0..400_usize, lasts: bool,
        ) {
            let seconds = if lasts { 120.0 } else { 10.0 };
            let sums = cascade(&values, settling as u64).end(seconds, 120.0).unwrap();
            prop_assert_eq!(sums.lasting.rests, u32::from(lasts));
            for (octaves, skip) in [(&sums.all, 0), (&sums.lasting, settling)] {
                for (level, octave) in octaves.octaves.iter().enumerate() {
                    let (squares, count) = vectorised(&values, level, skip);
                    // A difference of averages that nearly cancel keeps the rounding of these.
                    let near = 1e-12 * squares + 1e-14 * squares.sqrt();
                    prop_assert_eq!(octave.count, count);
                    prop_assert!((octave.squares.x - squares).abs() <= near, "{} {squares}", octave.squares.x);
                    prop_assert!((octave.squares.y - 4.0 * squares).abs() <= 4.0 * near);
                    prop_assert_eq!(octave.squares.z, 0.0);
                }
            }
            let whole = (values.len() / 8).checked_ilog2().map_or(0, |level| level as usize + 1);
            prop_assert_eq!(sums.all.octaves.len(), whole);
        }

        #[test]
        fn sums_add_over_rests_in_any_order(lengths in proptest::collection::vec(9..300_usize, 1..6)) {
            let rest = |length: &usize| {
                let values: Vec<f64> = (0..*length).map(|i| ((i * i + length) % 7) as f64).collect();
                cascade(&values, 0).end((length - 1) as f64 * 0.01, 100.0).unwrap()
            };
            let total = |rests: &mut dyn Iterator<Item = AllanSums>| {
                let mut total = AllanSums::default();
                rests.for_each(|rest| total.add(&rest));
                total
            };
            let forth = total(&mut lengths.iter().map(rest));
            let back = total(&mut lengths.iter().rev().map(rest));
            prop_assert_eq!(forth.all.rests as usize, lengths.len());
            prop_assert_eq!(forth.all.samples, lengths.iter().sum::<usize>() as u64);
            prop_assert_eq!(forth.all.shortest, (lengths.iter().min().unwrap() - 1) as f64 * 0.01);
            for (one, other) in forth.all.octaves.iter().zip(&back.all.octaves) {
                prop_assert_eq!(one.count, other.count);
                prop_assert!((one.squares - other.squares).amax() <= 1e-9 * one.squares.amax());
            }
        }
    }

    #[test]
    fn white_noise_has_the_degrees_of_freedom_that_theory_gives() {
        // An average of squares with ν degrees of freedom has a variance of 2σ⁴/ν.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut estimates = Vec::new();
        for _ in 0..400 {
            let values: Vec<f64> = (0..256).map(|_| (0..12).map(|_| uniform()).sum::<f64>()).collect();
            let octave = cascade(&values, 0).end(1.0, 2.0).unwrap().all.octaves[2];
            estimates.push((octave.squares.x / octave.count as f64, octave.freedom[0]));
        }
        let n = estimates.len() as f64;
        let mean = estimates.iter().map(|(value, _)| value).sum::<f64>() / n;
        let variance = estimates.iter().map(|(value, _)| (value - mean).powi(2)).sum::<f64>() / n;
        let (seen, said) = (2.0 * mean * mean / variance, estimates[0].1);
        assert!((0.75..1.33).contains(&(seen / said)), "{seen} {said}");
    }

    #[test]
    fn rests_at_another_rate_are_not_added() {
        let rest = |seconds| cascade(&[1.0; 100], 0).end(seconds, 60.0).unwrap();
        let mut sums = rest(1.0);
        sums.add(&rest(2.0));
        assert_eq!(sums.all.rests, 1);
        sums.add(&rest(1.01));
        assert_eq!(sums.all.rests, 2);
    }
}
