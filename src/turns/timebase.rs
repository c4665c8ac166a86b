//! When the samples of a gyroscope were taken, as far as their stamps tell: a converter's clock is even, stamps are taken
//! when a driver gets to it. Where stamps break is left to [`still`](crate::still).

use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Follows the line of the stamps over the number of the sample: a regression over the latest ones (an α–β filter with the
/// gains of one, Bar-Shalom et al., "Estimation with applications to tracking and navigation", 2001).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Timebase {
    /// The last stamp, and by how many nanoseconds the line has it later.
    last: Option<(Stamp, f64)>,
    /// Nanoseconds from sample to sample.
    period: f64,
    /// What the last stamp was off the line, ns.
    error: f64,
    /// Mean square of that, ns².
    jitter: f64,
    /// Mean product of two in a row, ns².
    wander: f64,
    /// So many samples the line is learned from.
    memory: f64,
}

/// The line of so many samples at most; older ones fade.
const LONGEST: f64 = 1024.0;
/// Over fewer the stamps are taken at their word.
const LEAST: f64 = 32.0;
/// A gap of more periods begins another line.
const GAP: f64 = 20.0;

impl Timebase {
    /// Nanoseconds from the sample before, by the line; `None` for the first one.
    pub(super) fn interval(&mut self, stamp: Stamp) -> Option<f64> {
        let Some((last, late)) = self.last else {
            self.last = Some((stamp, 0.0));
            return None;
        };
        let interval = stamp.since(last) as f64;
        if self.memory == 0.0 || interval <= 0.0 || interval > GAP * self.period.max(1.0) {
            *self = Self { last: Some((stamp, 0.0)), period: interval.max(1.0), memory: 1.0, ..Self::default() };
            return Some(interval.max(0.0));
        }
        // Where the stamp is against the line, one sample on.
        let mut error = interval - late - self.period;
        let mut steps = 1.0;
        let slip = libm::rint(error / self.period);
        if slip != 0.0 && error.abs() > 3.3 * self.jitter.sqrt() {
            // Samples were lost; or it was a late stamp that looked like that.
            steps = (steps + slip).max(0.0);
            error -= (steps - 1.0) * self.period;
        }
        // What is off the line again and again is another line.
        let lasting = self.wander > 0.3 * self.jitter;
        self.memory = if lasting { (0.95 * self.memory).max(2.0) } else { (self.memory + 1.0).min(LONGEST) };
        let n = self.memory;
        let (level, slope) = (2.0 * (2.0 * n - 1.0) / (n * (n + 1.0)), 6.0 / (n * (n + 1.0)));
        let advance = steps * self.period + level * error;
        self.period = (self.period + slope * error / steps.max(1.0)).max(1.0);
        let share = 1.0 / n.min(64.0);
        self.jitter += (error * error - self.jitter) * share;
        self.wander += (error * self.error - self.wander) * share;
        self.error = error;
        self.last = Some((stamp, late + advance - interval));
        Some(if n < LEAST { interval } else { advance.max(0.0) })
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    use super::*;

    /// Standard deviation of the intervals by the line, in ns, of samples whose stamps scatter by `jitter` ns around each
    /// 10 ms of which a twentieth is lost.
    fn scatter(jitter: f64, lost: f64) -> f64 {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut timebase = Timebase::default();
        let (mut squares, mut count, mut before) = (0.0, 0.0, 0);
        for i in 0..6000_i64 {
            if rng.random::<f64>() < lost {
                continue;
            }
            let stamp = Stamp::from_nanos(i * 10_000_000 + (jitter * rng.sample::<f64, _>(StandardNormal)) as i64);
            let interval = timebase.interval(stamp);
            if let Some(interval) = interval.filter(|_| i > 3000) {
                squares += (interval - (i - before) as f64 * 1e7).powi(2);
                count += 1.0;
            }
            before = i;
        }
        f64::sqrt(squares / count)
    }

    #[test]
    fn an_even_clock_stays_even() {
        assert!(scatter(0.0, 0.0) < 1.0);
        assert!(scatter(0.0, 0.05) < 1.0);
    }

    #[test]
    fn stamps_that_scatter_are_smoothed_to_a_line() {
        for jitter in [0.3e6, 1e6] {
            assert!(scatter(jitter, 0.0) < 0.03 * jitter, "{jitter}: {}", scatter(jitter, 0.0));
        }
    }

    #[test]
    fn a_clock_that_changes_its_pace_is_followed() {
        let mut timebase = Timebase::default();
        let mut now = 0;
        let mut sum = 0.0;
        for i in 0..4000 {
            let interval = if i < 2000 { 10_000_000 } else { 5_000_000 };
            now += interval;
            let said = timebase.interval(Stamp::from_nanos(now));
            if i > 2200 {
                assert!((said.unwrap_or(0.0) - 5e6).abs() < 5e4, "{i}: {said:?}");
                sum += said.unwrap_or(0.0);
            }
        }
        assert!((sum / 1799.0 - 5e6).abs() < 1e3);
    }
}
