//! Sensors that take turns on one topic: each reading is far from those before it, and near the last one of its own sensor.

use std::collections::VecDeque;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Number of readings that are like those of two, three or four sensors in turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Alternation([u64; 3]);

/// Square of the ratio from which on a reading counts as far.
const FAR: f64 = 25.0;
/// Fewest readings that tell.
const ENOUGH: u64 = 200;

impl Alternation {
    /// Takes the last of these readings.
    pub(super) fn push(&mut self, recent: &VecDeque<(Stamp, Vector3<f64>)>) {
        let mut back = recent.iter().rev().map(|(_, value)| value);
        let Some(value) = back.next() else { return };
        let mut nearest = back.next().map_or(0.0, |before| (value - before).norm_squared());
        for (count, before) in self.0.iter_mut().zip(back) {
            let distance = (value - before).norm_squared();
            *count += u64::from(FAR * distance < nearest);
            nearest = nearest.min(distance);
        }
    }

    /// Number of sensors, if more than half of so many readings are like those of several.
    pub(super) fn sensors(&self, readings: u64) -> Option<usize> {
        let most = |count: &u64| readings > ENOUGH && count.saturating_mul(2) > readings;
        self.0.iter().position(most).map(|place| place + 2)
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn sensors(value: impl Fn(usize) -> [f64; 3], step: f64) -> Option<usize> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let (mut recent, mut alternation) = (VecDeque::new(), Alternation::default());
        for i in 0..1000 {
            let mut axis = |value: f64| -> f64 {
                let noise: f64 = StandardNormal.sample(&mut rng);
                let read = value + 0.02 * noise;
                if step > 0.0 { (read / step).round() * step } else { read }
            };
            recent.push_back((Stamp::from_nanos(i as i64), Vector3::from(value(i).map(&mut axis))));
            alternation.push(&recent);
        }
        alternation.sensors(1000)
    }

    #[test]
    fn sensors_in_turn_are_counted_whatever_they_measure() {
        for count in [2, 3, 4] {
            assert_eq!(sensors(|i| [0.0, (i % count) as f64, 9.8], 0.0), Some(count));
            let turning =
                |i: usize| [(i as f64 * 0.001).sin() * 9.8, (i % count) as f64, (i as f64 * 0.001).cos() * 9.8];
            assert_eq!(sensors(turning, 0.0), Some(count));
        }
    }

    #[test]
    fn one_sensor_is_one_at_rest_in_motion_and_between_two_steps() {
        for step in [0.0, 0.02, 0.05, 0.2] {
            assert_eq!(sensors(|_| [0.0, 0.1, 9.8], step), None, "{step}");
            assert_eq!(sensors(|i| [(i as f64 * 0.3).sin() * 5.0, 0.0, 9.8], step), None, "{step}");
            assert_eq!(sensors(|i| [(i as f64 * 2.0).sin() * 5.0, 0.0, 9.8], step), None, "{step}");
        }
        // Shaken at nearly half the rate for a while.
        assert_eq!(sensors(|i| [(i as f64 * 3.13).sin() * if i < 400 { 5.0 } else { 0.0 }, 0.0, 9.8], 0.0), None);
    }
}
