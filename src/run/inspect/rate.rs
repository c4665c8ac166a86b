//! Message rate of a channel by log times.

/// Intervals between messages, in nanoseconds.
#[derive(Default)]
pub(super) struct Rate {
    last: Option<u64>,
    intervals: Vec<u64>,
}

/// Most intervals that make a rate.
const MOST: usize = 1000;

impl Rate {
    /// Takes the log time of a message.
    pub(super) fn push(&mut self, log_time: u64) {
        let last = self.last.replace(log_time);
        if let Some(interval) = last.and_then(|last| log_time.checked_sub(last)).filter(|_| self.intervals.len() < MOST)
        {
            self.intervals.push(interval);
        }
    }

    /// Message rate in Hz: by the median interval or, for messages in bursts, by the mean without gaps, which are far longer
    /// than from burst to burst.
    pub(super) fn hz(&self) -> Option<f64> {
        let mut sorted = self.intervals.clone();
        sorted.sort_unstable();
        let median = *sorted.get(sorted.len() / 2)?;
        // Log times may be any number, so that a sum of integers could overflow.
        let mean = |of: &[u64]| of.iter().map(|&interval| interval as f64).sum::<f64>() / of.len() as f64;
        // The longest 2 % may be gaps.
        let without = mean(sorted.get(..sorted.len() - sorted.len() / 50)?);
        let bursts = sorted.len() > 8 && (median == 0 || without > 2.0 * median as f64);
        let between = sorted.get(sorted.partition_point(|&interval| interval as f64 <= without)..)?;
        let typical = match between.get(between.len() / 2).filter(|_| bursts) {
            Some(&step) => mean(sorted.get(..sorted.partition_point(|&one| one <= step.saturating_mul(3)))?),
            None => median as f64,
        };
        (typical > 0.0).then(|| 1e9 / typical)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hz(log_times: impl IntoIterator<Item = u64>) -> Option<f64> {
        let mut rate = Rate::default();
        log_times.into_iter().for_each(|log_time| rate.push(log_time));
        rate.hz()
    }

    #[test]
    fn a_rate_is_that_of_the_topic_whatever_the_recording_spans() {
        let regular = |from: u64| (0..500).map(move |i| from + i * 10_000_000);
        assert_eq!(hz(regular(0)), Some(100.0));
        assert_eq!(hz([0].into_iter().chain(regular(1 << 60))), Some(100.0));
        let with_a_pause = regular(1 << 60).chain(regular((1 << 60) + 3_600_000_000_000));
        assert_eq!(hz(with_a_pause), Some(100.0));
        let bursts = (0..500).map(|i: u64| i / 10 * 100_000_000 + i % 10 * 1000);
        assert!(hz(bursts).is_some_and(|hz| (95.0..105.0).contains(&hz)));
        // Bursts with one time, few and large ones, and with a pause.
        for burst in [2, 5, 20] {
            let logged = |from: u64| (0..1000).map(move |i: u64| from + i / burst * burst * 10_000_000);
            assert!(hz(logged(0)).is_some_and(|hz| (90.0..112.0).contains(&hz)), "{burst}");
            let paused = logged(0).take(500).chain(logged(3_600_000_000_000).take(500));
            assert!(hz(paused).is_some_and(|hz| (85.0..115.0).contains(&hz)), "{burst}");
        }
        assert!(hz((0..100).map(|i| if i % 2 == 0 { 0 } else { u64::MAX })).is_some());
        assert_eq!(hz([5]), None);
        assert_eq!(hz([5, 5]), None);
    }
}
