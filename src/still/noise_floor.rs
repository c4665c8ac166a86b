//! Noise floor of one triad, learned online, in motion and at rest.
//!
//! The deviations of all windows go into a logarithmic histogram. The floor is a low quantile of them, divided by the 2
//! % quantile for white noise. The quantile is of all windows: 12 % of the first few, 0.1 % of a day's. Which quantile
//! of the windows at rest it is depends on how many are at rest, so the constant correction leaves an error of some 10
//! %, small beside the factors that the floor is multiplied with. No still start is needed: the quiet level of any
//! recording is found. [`TriadTrack`](super::triad_track::TriadTrack) decides whether that level can be rest.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Estimator of the deviation √(Σ variance of the axes) of a triad at rest.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct NoiseFloor {
    /// Low quantile of the deviation of a window of white noise of unit deviation.
    white_quantile: f64,
    /// Number of windows with a deviation in each bin.
    bins: Vec<u32>,
    windows: u64,
    /// Number of windows without any deviation.
    constant: u64,
    /// Highest level that can be rest, in the unit of the triad.
    ceiling: f64,
    lowest_bin: usize,
    /// Smallest step seen between two readings of one axis.
    step: Option<f64>,
    /// Number of readings that equal the reading before.
    repeated: u64,
    last: Option<Vector3<f64>>,
    level: Option<f64>,
}

/// Binary logarithm of the bins an octave: 2⁵ = 32 bins, each 2 to 3 % wide.
const SUB_BITS: u32 = 5;
/// Range of the histogram: deviations from 2⁻⁴⁰ to 2²⁴.
const OCTAVES: std::ops::Range<i64> = -40..24;
const BINS: usize = ((OCTAVES.end - OCTAVES.start) << SUB_BITS) as usize;
/// Fewest windows for a meaningful floor.
const SETTLED: u64 = 8;
/// Target quantile, which is corrected for, and its standard normal deviate.
const QUANTILE: f64 = 0.02;
const QUANTILE_NORMAL: f64 = -2.054;
/// Number of windows, a couple of seconds of rest, that suffice in a recording of a minute or an hour …
const FEW_WINDOWS: f64 = 16.0;
/// … but in one of a day, a few oddly quiet seconds do not: least quantile.
const LEAST_QUANTILE: f64 = 0.001;
/// From one constant window in so many on, it is a dead band or a simulation without noise, not a stream that froze for
/// a moment.
const DEAD_BAND: u64 = 8;

impl NoiseFloor {
    /// Creates a floor for windows of `window` samples, of a triad whose level at rest is at most `ceiling`.
    pub(super) fn new(window: usize, ceiling: f64) -> Self {
        Self {
            white_quantile: white_quantile(3.0 * (window.max(2) - 1) as f64),
            bins: vec![0; BINS],
            windows: 0,
            constant: 0,
            ceiling,
            lowest_bin: BINS,
            step: None,
            repeated: 0,
            last: None,
            level: None,
        }
    }

    /// Takes one sample, for the quantisation step.
    pub(super) fn sample(&mut self, value: &Vector3<f64>) {
        if let Some(last) = self.last {
            self.repeated += u64::from(last == *value);
            for step in (value - last).iter().map(|d| d.abs()) {
                // Smaller steps are rounding of the conversion to SI units, not steps of the converter.
                if step > 1e-7 && self.step.is_none_or(|least| step < least) {
                    self.step = Some(step);
                }
            }
        }
        self.last = Some(*value);
    }

    /// Takes the deviation of one window. Windows should overlap by no more than half.
    pub(super) fn window(&mut self, deviation: f64) {
        if deviation <= 0.0 {
            self.constant += 1;
        } else {
            let bin = bin(deviation);
            if let Some(count) = self.bins.get_mut(bin) {
                *count = count.saturating_add(1);
            }
            self.lowest_bin = self.lowest_bin.min(bin);
        }
        self.windows += 1;
        self.level = self.quantile();
    }

    /// Whether enough windows were seen for a meaningful level.
    pub(super) fn is_settled(&self) -> bool {
        self.windows >= SETTLED
    }

    /// Noise floor: √(Σ variance of the axes) at rest, in the unit of the triad.
    pub(super) fn level(&self) -> Option<f64> {
        // Deviation of three axes with a uniform error of one step each.
        let quantisation = 0.5 * self.step.unwrap_or(0.0);
        let noise = self.level.map(|level| level.max(quantisation));
        if self.step.is_some() && self.rests_constant() { Some(quantisation) } else { noise }
    }

    /// Whether rest has no noise at all. Where some noise is low enough to be rest, a constant stretch is a stream that
    /// is republished or dead, and says nothing.
    fn rests_constant(&self) -> bool {
        let noisy_rest = self.level.is_some_and(|level| level <= self.ceiling);
        !noisy_rest && self.constant.saturating_mul(DEAD_BAND) >= self.windows.max(1)
    }

    /// Smallest step seen between two readings of one axis, an upper bound of the resolution.
    pub(super) fn step(&self) -> Option<f64> {
        self.step
    }

    /// Number of readings that equal the reading before in all three axes.
    pub(super) fn repeated(&self) -> u64 {
        self.repeated
    }

    fn quantile(&self) -> Option<f64> {
        let windows = self.windows as f64;
        let rank = (QUANTILE * windows).min(FEW_WINDOWS).max(LEAST_QUANTILE * windows).max(1.0);
        let mut seen = 0.0;
        let found = self.bins.iter().enumerate().skip(self.lowest_bin).find(|(_, count)| {
            seen += f64::from(**count);
            seen >= rank
        });
        found.map(|(bin, _)| centre(bin) / self.white_quantile)
    }
}

/// The 2 % quantile of the deviation of white noise of unit deviation, with so many degrees of freedom (three axes,
/// n − 1 each): χ by Wilson and Hilferty (1931).
fn white_quantile(freedom: f64) -> f64 {
    let v = 2.0 / (9.0 * freedom);
    let cube_root = 1.0 - v + QUANTILE_NORMAL * v.sqrt();
    libm::pow(cube_root, 1.5)
}

/// Bin of a positive deviation: exponent and leading bits of the mantissa, a logarithm without computing one.
fn bin(deviation: f64) -> usize {
    let bits = deviation.to_bits() >> (52 - SUB_BITS);
    let lowest = ((1023 + OCTAVES.start) as u64) << SUB_BITS;
    usize::try_from(bits.saturating_sub(lowest)).unwrap_or(BINS).min(BINS - 1)
}

/// Deviation in the middle of a bin.
fn centre(bin: usize) -> f64 {
    let lowest = ((1023 + OCTAVES.start) as u64) << SUB_BITS;
    let lower = (bin as u64 + lowest) << (52 - SUB_BITS);
    f64::from_bits(lower + (1 << (51 - SUB_BITS)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::still::window::Window;

    /// Learns from white noise whose deviation is `sigma(second)`, 100 samples a second.
    fn learn(seconds: usize, sigma: impl Fn(usize) -> f64) -> NoiseFloor {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let (mut floor, mut window) = (NoiseFloor::new(25, 0.15), Window::new(25));
        for i in 0..seconds * 100 {
            let mut axis = || -> f64 { StandardNormal.sample(&mut rng) };
            let value = Vector3::new(axis(), axis(), axis()) * sigma(i / 100);
            floor.sample(&value);
            window.push(&value);
            if window.is_full() && i % 12 == 0 {
                floor.window(window.variance().sum().sqrt());
            }
        }
        floor
    }

    #[test]
    fn the_floor_of_white_noise_is_its_deviation() {
        let level = learn(60, |_| 0.02).level().unwrap();
        assert!((level / (0.02 * 3_f64.sqrt()) - 1.0).abs() < 0.1, "{level}");
    }

    #[test]
    fn a_few_seconds_of_rest_in_an_hour_of_motion_are_found() {
        let level = learn(3600, |s| if (1800..1804).contains(&s) { 0.02 } else { 2.0 }).level().unwrap();
        assert!((level / (0.02 * 3_f64.sqrt()) - 1.0).abs() < 0.3, "{level}");
    }

    #[test]
    fn a_frozen_stream_does_not_lower_the_floor() {
        let level = learn(60, |s| if (20..30).contains(&s) { 0.0 } else { 0.02 }).level().unwrap();
        assert!((level / (0.02 * 3_f64.sqrt()) - 1.0).abs() < 0.15, "{level}");
    }

    #[test]
    fn a_stream_that_was_frozen_first_has_the_floor_of_its_noise() {
        let level = learn(14, |s| if s < 10 { 0.0 } else { 0.02 }).level().unwrap();
        assert!((level / (0.02 * 3_f64.sqrt()) - 1.0).abs() < 0.2, "{level}");
    }

    #[test]
    fn a_triad_that_is_constant_at_rest_has_the_floor_of_its_step() {
        let floor = learn(60, |s| if s % 6 < 3 { 0.0 } else { 2.0 });
        assert_eq!(floor.level().unwrap(), 0.5 * floor.step().unwrap());
    }

    #[test]
    fn a_moment_frozen_in_motion_is_no_floor() {
        let level = learn(60, |s| if (20..24).contains(&s) { 0.0 } else { 2.0 }).level().unwrap();
        assert!(level > 1.0, "{level}");
    }

    proptest! {
        #[test]
        fn a_bin_holds_its_deviations(deviation in 1e-11_f64..1e7) {
            prop_assert!((centre(bin(deviation)) / deviation - 1.0).abs() < 0.02);
        }
    }
}
