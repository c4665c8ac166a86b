//! Sensors that take turns on one topic: each reading is far from those before it, and near the last one of its own sensor.

use std::collections::VecDeque;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Number of readings that are like those of two, three or four sensors in turn, and the rests that show it where each
/// reading is lost in noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Alternation {
    counts: [u64; 3],
    rests: u64,
    /// Rests whose readings differ by their place in a cycle, and the sum of these differences.
    uneven: u64,
    apart: f64,
}

/// Readings of a rest by their place in a cycle of six, in which those of two and of three sensors in turn repeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Phases([(Vector3<f64>, u64); 6]);

/// Square of the ratio from which on a reading counts as far.
const FAR: f64 = 25.0;
/// Fewest readings that tell.
const ENOUGH: u64 = 200;
/// Fewest rests that tell.
const ENOUGH_RESTS: u64 = 3;

impl Alternation {
    /// Takes the last of these readings.
    pub(super) fn push(&mut self, recent: &VecDeque<(Stamp, Vector3<f64>)>) {
        let mut back = recent.iter().rev().map(|(_, value)| value);
        let Some(value) = back.next() else { return };
        let mut nearest = back.next().map_or(0.0, |before| (value - before).norm_squared());
        for (count, before) in self.counts.iter_mut().zip(back) {
            let distance = (value - before).norm_squared();
            *count += u64::from(FAR * distance < nearest);
            nearest = nearest.min(distance);
        }
    }

    /// Number of sensors, if more than half of so many readings are like those of several.
    pub(super) fn sensors(&self, readings: u64) -> Option<usize> {
        let most = |count: &u64| readings > ENOUGH && count.saturating_mul(2) > readings;
        self.counts.iter().position(most).map(|place| place + 2)
    }

    /// Takes a rest with the sum of the variances of its axes.
    pub(super) fn rest(&mut self, phases: &Phases, variance: f64) {
        self.rests += 1;
        if let Some(apart) = phases.apart(variance) {
            self.uneven += 1;
            self.apart += apart;
        }
    }

    /// Typical distance between readings and the next ones at rest, if more than half of the rests show one.
    pub(super) fn apart(&self) -> Option<f64> {
        let most = self.rests >= ENOUGH_RESTS && self.uneven.saturating_mul(2) > self.rests;
        most.then(|| self.apart / self.uneven as f64)
    }
}

impl Phases {
    /// Takes a reading with its number in the stream.
    pub(super) fn push(&mut self, number: u64, value: &Vector3<f64>) {
        if let Some((mean, count)) = self.0.get_mut((number % 6) as usize) {
            *count += 1;
            *mean += (value - *mean) / *count as f64;
        }
    }

    /// Distance between the means of readings at different places in a cycle, if it is neither chance nor within the noise
    /// of one reading. `variance` is the sum of the variances of the axes.
    fn apart(&self, variance: f64) -> Option<f64> {
        /// Least distance over its standard deviation.
        const CLEAR: f64 = 6.0;
        let of_cycle = |length: usize| {
            let place = |place: usize| {
                let (sum, count) = self.0[place..]
                    .iter()
                    .step_by(length)
                    .fold((Vector3::zeros(), 0), |all, one| (all.0 + one.0 * one.1 as f64, all.1 + one.1));
                (count > 0).then(|| (sum / count as f64, count))
            };
            let places: Option<Vec<_>> = (0..length).map(place).collect();
            let places = places?;
            let (mean, _) = *places.first()?;
            let fewest = places.iter().map(|(_, count)| *count).min()? as f64;
            let apart = places.iter().map(|(other, _)| (other - mean).norm()).fold(0.0, f64::max);
            // What lies between the places is no noise: a quarter of the square of the distance for two.
            let noise = (variance - apart * apart / 4.0).max(0.0);
            (apart > CLEAR * (2.0 * noise / fewest).sqrt() && apart > (noise / 3.0).sqrt()).then_some(apart)
        };
        [2, 3].into_iter().filter_map(of_cycle).max_by(f64::total_cmp)
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

    /// Typical distance found in rests of so many readings of sensors in turn.
    fn apart(rests: usize, readings: usize, value: impl Fn(usize) -> f64) -> Option<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut alternation = Alternation::default();
        for rest in 0..rests {
            let (mut phases, mut moments) = (Phases::default(), super::super::moments::Moments::default());
            for i in rest * readings..(rest + 1) * readings {
                let value = Vector3::from_fn(|axis, _| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    0.02 * noise + if axis == 2 { 9.8 + value(i) } else { 0.0 }
                });
                phases.push(i as u64, &value);
                moments.push(&value);
            }
            alternation.rest(&phases, moments.variance());
        }
        alternation.apart()
    }

    #[test]
    fn sensors_in_turn_that_differ_by_little_more_than_noise_show_at_rest() {
        for count in [2, 3] {
            let found = apart(6, 200, |i| if i % count == 0 { 0.06 } else { 0.0 }).unwrap();
            assert!((0.055..0.065).contains(&found), "{count}: {found}");
        }
    }

    #[test]
    fn noise_a_drift_and_a_hum_do_not_look_like_sensors_in_turn() {
        assert_eq!(apart(200, 150, |_| 0.0), None);
        assert_eq!(apart(20, 150, |i| 1e-4 * (i % 150) as f64), None);
        for cycles in [0.11, 0.24, 0.49] {
            assert_eq!(apart(20, 150, |i| 0.03 * (std::f64::consts::TAU * cycles * i as f64).sin()), None, "{cycles}");
        }
        // Too few rests, and one in three.
        assert_eq!(apart(2, 200, |i| 0.06 * (i % 2) as f64), None);
        assert_eq!(apart(9, 200, |i| if i / 200 % 3 == 0 { 0.06 * (i % 2) as f64 } else { 0.0 }), None);
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
