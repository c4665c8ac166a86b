//! Readings that stop at an end of the range of a gyroscope.
//!
//! A rate that turns round reads the same a few times, too, where the steps of the converter are coarse. But it comes there
//! slowly: on a parabola that stays within one step `q` for `n` readings, with `n` of 3 or more, the change into them is at
//! most `4 n q / (n − 1)²`, and one step more by rounding. Readings have stopped where they came faster, or where they come
//! back to the very extreme and stay.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Least reading that can be at the end of a range, rad/s.
const FAST: f64 = 0.5;
/// Change into equal readings beyond one step of the converter, times their number, beyond which no rate turns round, in
/// steps: 9, and some noise.
const STOPPED: f64 = 12.0;

/// Extremes of a stream of rates, with how it reached its present values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RangeEnd {
    high: Vector3<f64>,
    low: Vector3<f64>,
    last: Vector3<f64>,
    /// Smallest change of each axis: the step of the converter.
    step: Vector3<f64>,
    /// Arrival of each axis at its last value.
    arrival: [Arrival; 3],
}

/// Arrival of an axis at a value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Arrival {
    /// Change of the reading.
    change: f64,
    /// Whether the value was an extreme before.
    again: bool,
    /// Number of times that it has been read in a row.
    times: u32,
}

impl RangeEnd {
    /// Begins with a reading.
    pub(super) fn of(rate: &Vector3<f64>) -> Self {
        Self { high: *rate, low: *rate, last: *rate, step: Vector3::repeat(f64::MAX), arrival: [Arrival::default(); 3] }
    }

    /// Largest magnitude on any axis, rad/s.
    pub(super) fn peak(&self) -> f64 {
        self.high.amax().max(self.low.amax())
    }

    /// Takes a reading, and tells whether it has stopped at an extreme.
    pub(super) fn push(&mut self, rate: &Vector3<f64>) -> bool {
        let stopped = (0..3).filter(|&axis| self.stops(axis, rate[axis])).count();
        self.high = self.high.sup(rate);
        self.low = self.low.inf(rate);
        self.last = *rate;
        stopped > 0
    }

    fn stops(&mut self, axis: usize, rate: f64) -> bool {
        let was_extreme = rate == self.high[axis] || rate == self.low[axis];
        let Self { last, step, arrival, .. } = self;
        let (arrival, step) = (&mut arrival[axis], &mut step[axis]);
        let change = (rate - last[axis]).abs();
        if change > 0.0 {
            *step = step.min(change);
            *arrival = Arrival { change, again: was_extreme, times: 0 };
        }
        arrival.times += 1;
        let enough = if arrival.again { 2 } else { 3 };
        let fast = (arrival.change - *step) * f64::from(arrival.times) > STOPPED * *step;
        was_extreme && rate.abs() > FAST && arrival.times >= enough && fast
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of readings that stopped, of turns of this peak (rad/s) and duration (s) in steps of a converter, limited to a
    /// range.
    fn stopped(rate_hz: f64, peak: f64, seconds: f64, step: f64, range: f64) -> usize {
        let count = (rate_hz * seconds) as u32;
        let mut end: Option<RangeEnd> = None;
        let turns = (0..3).flat_map(|turn| (0..=count).map(move |i| (turn, f64::from(i) / f64::from(count))));
        let rates = turns.map(|(turn, u)| {
            // Not of the same height, and after a rest with noise.
            let peak = peak * (1.0 - 0.01 * f64::from(turn));
            let rate = (peak * 16.0 * (u * (1.0 - u)).powi(2)).min(range);
            Vector3::new(0.0, (rate / step).round() * step, 0.1)
        });
        let rates = [0.0, step, 0.0].map(|noise| Vector3::new(0.0, noise, 0.1)).into_iter().chain(rates);
        rates.filter(|rate| end.get_or_insert(RangeEnd::of(rate)).push(rate)).count()
    }

    #[test]
    fn a_rate_that_turns_round_has_not_stopped_however_often_it_reads_the_same() {
        for rate_hz in [25.0, 50.0, 100.0, 200.0, 400.0, 1000.0] {
            for seconds in [0.4, 1.0, 1.68, 3.0, 6.0] {
                // 250 to 4,000 °/s in 16 bit.
                for step in [0.00013, 0.00027, 0.00053, 0.00107, 0.0021] {
                    for peak in [0.7, 2.0, 3.7, 3.71, 6.1] {
                        let found = stopped(rate_hz, peak, seconds, step, f64::MAX);
                        assert!(found == 0, "{found}: {rate_hz} Hz, {peak} rad/s, {seconds} s, steps of {step}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_rate_beyond_the_range_stops_at_its_end() {
        for rate_hz in [25.0, 50.0, 100.0, 200.0, 400.0, 1000.0] {
            for step in [1e-9, 0.00013, 0.00053, 0.00107] {
                let found = stopped(rate_hz, 5.5, 1.0, step, 4.36);
                assert!(found >= 3, "{found}: {rate_hz} Hz, steps of {step}");
            }
        }
    }
}
