//! Sampling times of a gyroscope, estimated from its stamps: a converter's clock is even, whereas stamps are taken when
//! the driver gets to it.

use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Regression of the stamps over the sample number, from the latest ones (an α–β filter with the gains of a regression,
/// Bar-Shalom et al., "Estimation with applications to tracking and navigation", 2001).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct SampleClock {
    /// Last stamp, and the line's time for it less the stamp, ns.
    last: Option<(Stamp, f64)>,
    /// Sample period, ns.
    period: f64,
    /// Deviation of the last stamp from the line, ns.
    error: f64,
    /// Mean square of the deviations, ns².
    jitter: f64,
    /// Mean product of successive deviations, ns².
    wander: f64,
    /// Number of samples that the line is fitted to.
    memory: f64,
}

/// Largest number of samples of the line; older ones fade.
const LONGEST: f64 = 1024.0;
/// Fewest samples of a line; with fewer the stamps are used as they are.
const LEAST: f64 = 32.0;
/// Largest gap within a line, in periods.
const GAP: f64 = 20.0;

impl SampleClock {
    /// Interval from the sample before, by the line, ns; `None` for the first one.
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
        // Deviation of the stamp from the line, one sample on.
        let mut error = interval - late - self.period;
        let mut steps = 1.0;
        if 2.0 * error.abs() > self.period && error * error > 3.3 * 3.3 * self.jitter {
            // Samples were lost, or a late stamp looked like that.
            steps = (steps + libm::rint(error / self.period)).max(0.0);
            error -= (steps - 1.0) * self.period;
        }
        // Repeated deviations to one side mean another line.
        let lasting = self.wander > 0.3 * self.jitter;
        self.memory = if lasting { (0.95 * self.memory).max(2.0) } else { (self.memory + 1.0).min(LONGEST) };
        let n = self.memory;
        let part = 2.0 / (n * (n + 1.0));
        let (level, slope) = ((2.0 * n - 1.0) * part, 3.0 * part);
        let advance = steps * self.period + level * error;
        let change = if steps > 1.0 { slope * error / steps } else { slope * error };
        self.period = (self.period + change).max(1.0);
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

    /// Standard deviation, in ns, of the intervals by the line for samples each 10 ms, whose stamps scatter by `jitter`
    /// ns and a share `lost` of which is missing.
    fn scatter(jitter: f64, lost: f64) -> f64 {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut sample_clock = SampleClock::default();
        let (mut squares, mut count, mut before) = (0.0, 0.0, 0);
        for i in 0..6000_i64 {
            if rng.random::<f64>() < lost {
                continue;
            }
            let stamp = Stamp::from_nanos(i * 10_000_000 + (jitter * rng.sample::<f64, _>(StandardNormal)) as i64);
            let interval = sample_clock.interval(stamp);
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
        let mut sample_clock = SampleClock::default();
        let mut now = 0;
        let mut sum = 0.0;
        for i in 0..4000 {
            let interval = if i < 2000 { 10_000_000 } else { 5_000_000 };
            now += interval;
            let said = sample_clock.interval(Stamp::from_nanos(now));
            if i > 2200 {
                assert!((said.unwrap_or(0.0) - 5e6).abs() < 5e4, "{i}: {said:?}");
                sum += said.unwrap_or(0.0);
            }
        }
        assert!((sum / 1799.0 - 5e6).abs() < 1e3);
    }
}
