//! Time base of one triad: its sample period, and the breaks of its stamps.

use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Meaning of a new stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tick {
    /// The next sample.
    Next,
    /// Repeated or backward stamp: the sample is to be dropped.
    Dropped,
    /// Jump of the stamps: what follows is not connected to what came before. The sample itself is valid.
    Break,
}

/// Time base of one triad, which follows its stamps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TimeBase {
    gap_nanos: i64,
    last: Option<Stamp>,
    dropped: u64,
    /// Number of samples dropped one after another.
    dropped_in_a_row: u32,
    breaks: u64,
    /// Latest intervals, as a ring, ns.
    intervals: Vec<i64>,
    cursor: usize,
    seen: u64,
    period: Option<i64>,
}

/// Number of intervals of a median.
const INTERVALS: usize = 63;
/// Fewest intervals for a period.
const LEAST_INTERVALS: usize = 8;
/// Number of dropped stamps in a row that mean a clock that was set back.
const PATIENCE: u32 = 5;

impl TimeBase {
    /// Creates a time base that breaks at forward jumps beyond both `gap_s` seconds and five sample periods.
    pub fn new(gap_s: f64) -> Self {
        Self {
            gap_nanos: (gap_s * 1e9) as i64,
            last: None,
            dropped: 0,
            dropped_in_a_row: 0,
            breaks: 0,
            intervals: Vec::with_capacity(INTERVALS),
            cursor: 0,
            seen: 0,
            period: None,
        }
    }

    /// Takes the stamp of a new sample.
    pub fn tick(&mut self, stamp: Stamp) -> Tick {
        let Some(last) = self.last else {
            self.last = Some(stamp);
            return Tick::Next;
        };
        let interval = stamp.since(last);
        if interval <= 0 {
            self.dropped += 1;
            self.dropped_in_a_row += 1;
            if self.dropped_in_a_row < PATIENCE {
                return Tick::Dropped;
            }
            return self.rebase(stamp);
        }
        self.dropped_in_a_row = 0;
        self.learn(interval);
        if self.period.is_some_and(|period| interval > self.longest_interval(period)) {
            // It may be the first of a slower rate, so the period is measured again; one gap does not move a median.
            self.measure();
            return self.rebase(stamp);
        }
        self.last = Some(stamp);
        Tick::Next
    }

    /// Typical interval of the latest samples, ns, once eight were seen: their median, or their mean if they come in
    /// bursts.
    pub fn period(&self) -> Option<i64> {
        self.period
    }

    /// Whether a sample at this time would come after a gap.
    pub fn is_overdue(&self, now: Stamp) -> bool {
        let longest = self.period.map(|period| self.longest_interval(period));
        self.last.zip(longest).is_some_and(|(last, longest)| now.since(last) > longest)
    }

    /// Number of samples dropped for a repeated or backward stamp.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Number of breaks of the time base.
    pub fn breaks(&self) -> u64 {
        self.breaks
    }

    fn rebase(&mut self, stamp: Stamp) -> Tick {
        self.last = Some(stamp);
        self.dropped_in_a_row = 0;
        self.breaks += 1;
        Tick::Break
    }

    fn learn(&mut self, interval: i64) {
        if self.intervals.len() < INTERVALS {
            self.intervals.push(interval);
        } else if let Some(oldest) = self.intervals.get_mut(self.cursor) {
            *oldest = interval;
            self.cursor = (self.cursor + 1) % INTERVALS;
        }
        self.seen += 1;
        // Frequent at first, rare afterwards: a median costs more than a sample may.
        if self.seen <= 64 && self.seen.is_multiple_of(LEAST_INTERVALS as u64) || self.seen.is_multiple_of(1024) {
            self.measure();
        }
    }

    fn measure(&mut self) {
        let mut sorted = self.intervals.clone();
        sorted.sort_unstable();
        let Some(median) = sorted.get(sorted.len() / 2).copied().filter(|_| sorted.len() >= LEAST_INTERVALS) else {
            return;
        };
        // Gaps are not sample intervals. The shortest half is never beyond the limit, so there is a mean.
        let longest = self.longest_interval(median);
        let within = &sorted[..sorted.partition_point(|interval| *interval <= longest)];
        let mean = within.iter().map(|interval| interval / within.len() as i64).sum::<i64>();
        // A lost sample here and there leaves the mean near the median; a burst of samples per message does not.
        self.period = Some(if mean > median.saturating_mul(2) { mean } else { median });
    }

    /// Longest interval, beyond which the time base breaks, ns.
    fn longest_interval(&self, period: i64) -> i64 {
        self.gap_nanos.max(period.saturating_mul(5))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: i64) -> Stamp {
        Stamp::from_nanos(millis * 1_000_000)
    }

    fn running_at_100_hz() -> TimeBase {
        let mut clock = TimeBase::new(0.1);
        for i in 0..100 {
            assert_eq!(clock.tick(at(10 * i)), Tick::Next);
        }
        clock
    }

    #[test]
    fn the_period_is_the_median_interval() {
        assert_eq!(running_at_100_hz().period(), Some(10_000_000));
    }

    #[test]
    fn a_repeated_stamp_is_dropped_and_counted() {
        let mut clock = running_at_100_hz();
        assert_eq!(clock.tick(at(990)), Tick::Dropped);
        assert_eq!(clock.tick(at(1000)), Tick::Next);
        assert_eq!(clock.dropped(), 1);
    }

    #[test]
    fn a_forward_jump_beyond_the_gap_breaks_the_time_base() {
        let mut clock = running_at_100_hz();
        assert_eq!(clock.tick(at(1080)), Tick::Next);
        assert_eq!(clock.tick(at(1190)), Tick::Break);
        assert_eq!(clock.tick(at(1200)), Tick::Next);
    }

    #[test]
    fn a_slower_rate_is_learned_and_a_single_gap_is_not() {
        let mut clock = TimeBase::new(0.1);
        (0..20).for_each(|i| assert_eq!(clock.tick(at(i)), Tick::Next));
        let ticks: Vec<_> = (1..100).map(|i| clock.tick(at(20 + 200 * i))).collect();
        assert!(ticks[40..].iter().all(|tick| *tick == Tick::Next), "{ticks:?}");
        assert_eq!(clock.period(), Some(200_000_000));

        let mut gap = running_at_100_hz();
        assert_eq!(gap.tick(at(3_600_000)), Tick::Break);
        assert_eq!(gap.period(), Some(10_000_000));
    }

    #[test]
    fn the_period_of_samples_in_bursts_is_their_mean_interval() {
        let mut clock = TimeBase::new(0.1);
        for i in 0..200 {
            clock.tick(Stamp::from_nanos(i / 10 * 100_000_000 + i % 10 * 100_000));
        }
        let period = clock.period().unwrap();
        assert!((8_000_000..12_000_000).contains(&period), "{period}");
    }

    #[test]
    fn five_backward_stamps_in_a_row_re_base() {
        let mut clock = running_at_100_hz();
        let ticks: Vec<_> = (0..6).map(|i| clock.tick(at(10 * i))).collect();
        assert_eq!(ticks[..4], [Tick::Dropped; 4]);
        assert_eq!(ticks[4..], [Tick::Break, Tick::Next]);
    }
}
