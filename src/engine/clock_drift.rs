//! Drift of the stamps against the times of the log: a sensor's own clock may run fast, and angles with it.

use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Line through the delays of the log behind the stamps, by the least delay of each second: what is in the way only
/// adds to it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct ClockDrift {
    /// First stamp and its delay, ns.
    origin: Option<(Stamp, i64)>,
    /// The open second since the first stamp, and its least delay since the origin's, s.
    open: Option<(i64, f64)>,
    /// Sums over seconds t and least delays d: count, t, d, t², t·d, d².
    sums: [f64; 6],
}

/// Fewest seconds that tell.
const ENOUGH: f64 = 20.0;
/// Least drift that matters, s/s: a fifth of the interval that a scale must have.
const MATTERS: f64 = 1e-3;
/// Largest drift of a clock. What is more was played again faster or slower, or logged at one time.
const CLOCK: f64 = 0.3;
/// Largest deviation from a line, of all that the delays change by: a queue that fills makes a step.
const STRAIGHT: f64 = 0.05;

impl ClockDrift {
    /// Takes a reading.
    pub(super) fn push(&mut self, stamp: Stamp, log_time: u64) {
        let Some(delay) = i64::try_from(log_time).ok().and_then(|log| log.checked_sub(stamp.nanos())) else { return };
        let &mut (first, least) = self.origin.get_or_insert((stamp, delay));
        let second = stamp.since(first).div_euclid(1_000_000_000);
        let delay = delay.saturating_sub(least) as f64 * 1e-9;
        self.open = match self.open {
            Some((open, least)) if open == second => Some((open, least.min(delay))),
            closed => {
                self.close(closed);
                Some((second, delay))
            }
        };
    }

    fn close(&mut self, closed: Option<(i64, f64)>) {
        let Some((second, delay)) = closed else { return };
        let second = second as f64;
        let terms = [1.0, second, delay, second * second, second * delay, delay * delay];
        self.sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
    }

    /// Seconds of the stamps less those of the log, in a second of the log; `None` if they go alike, or too little is
    /// known.
    pub(super) fn found(&self) -> Option<f64> {
        let [n, t, d, tt, td, dd] = self.sums;
        if n < ENOUGH {
            return None;
        }
        let (tt, td, dd) = (tt - t * t / n, td - t * d / n, dd - d * d / n);
        if tt <= 0.0 {
            return None;
        }
        let slope = td / tt;
        let off = ((dd - slope * td).max(0.0) / n).sqrt();
        // Of seconds that are spread evenly.
        let span = (12.0 * tt / n).sqrt();
        let drift = 1.0 / (1.0 + slope) - 1.0;
        let matters = (MATTERS..CLOCK).contains(&drift.abs());
        (matters && off < STRAIGHT * (slope * span).abs()).then_some(drift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drift of a stream of 100 Hz whose stamps run by `drift` too fast, with delays of its log.
    fn drift(seconds: usize, drift: f64, delay: impl Fn(usize) -> f64) -> Option<f64> {
        let mut clock = ClockDrift::default();
        for i in 0..seconds * 100 {
            let time = i as f64 * 0.01;
            let stamp = Stamp::from_nanos(1_700_000_000_000_000_000 + (time * (1.0 + drift) * 1e9) as i64);
            clock.push(stamp, 1_700_000_000_000_000_000 + ((time + delay(i)) * 1e9) as u64);
        }
        clock.found()
    }

    #[test]
    fn a_clock_that_runs_fast_or_slow_is_found_through_delays_that_vary() {
        let delay = |i: usize| 0.002 + 0.03 * ((i * 7919) % 100) as f64 / 100.0;
        for wrong in [0.01, -0.01, 0.002, 0.05, 0.2] {
            let found = drift(60, wrong, delay).unwrap();
            assert!((found - wrong).abs() < 3e-4, "{found} of {wrong}");
        }
        assert_eq!(drift(60, 0.0, delay), None);
        assert_eq!(drift(60, 1e-4, delay), None);
        assert_eq!(drift(15, 0.01, delay), None, "too short");
    }

    #[test]
    fn a_queue_that_fills_or_a_recording_that_is_played_again_is_no_clock() {
        // A step of 0.3 s half-way.
        assert_eq!(drift(60, 0.0, |i| if i < 3000 { 0.0 } else { 0.3 }), None);
        assert_eq!(drift(60, 1.0, |_| 0.0), None);
        assert_eq!(drift(60, -0.5, |_| 0.0), None);
        assert_eq!(drift(60, 0.0, |i| -(i as f64) * 0.01), None, "all logged at once");
    }
}
