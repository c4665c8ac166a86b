//! Temperature of a simulated sensor: its course, and what a thermometer reads of it.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// Course of the temperature, and the thermometer that records it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// Points of the course: seconds since the start of the recording, and °C. It is linear in between and constant
    /// beyond.
    pub course: Vec<[f64; 2]>,
    /// Temperature at which the biases are as stated, °C.
    #[serde(default = "room")]
    pub reference: f64,
    /// Topic of its messages (`sensor_msgs/Temperature` in ROS); if absent, the temperature is in the accelerometer's
    /// messages, for which those of ROS have no field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Rate of its messages, in Hz.
    #[serde(default = "once_a_second")]
    pub rate_hz: f64,
    /// Standard deviation of the noise of one reading, °C.
    #[serde(default)]
    pub noise: f64,
    /// Quantisation step, °C; 0 for none.
    #[serde(default)]
    pub step: f64,
}

impl Temperature {
    /// True temperature at `seconds` after the start, °C.
    pub(super) fn at(&self, seconds: f64) -> f64 {
        let after = self.course.partition_point(|[time, _]| *time <= seconds);
        match (after.checked_sub(1).and_then(|before| self.course.get(before)), self.course.get(after)) {
            (Some([from, cold]), Some([to, warm])) => cold + (warm - cold) * (seconds - from) / (to - from),
            (Some([_, celsius]), None) | (None, Some([_, celsius])) => *celsius,
            (None, None) => self.reference,
        }
    }
}

fn room() -> f64 {
    25.0
}

fn once_a_second() -> f64 {
    1.0
}

/// Thermometer with its random generator.
#[derive(Clone, Debug)]
pub(super) struct Thermometer {
    pub(super) temperature: Temperature,
    random: ChaCha8Rng,
    taken: u64,
}

impl Thermometer {
    pub(super) fn new(temperature: Temperature, random: ChaCha8Rng) -> Self {
        Self { temperature, random, taken: 0 }
    }

    /// Time of the next message on a topic of its own, in nanoseconds since the start of the recording.
    pub(super) fn next(&self) -> i64 {
        (self.taken as f64 / self.temperature.rate_hz * 1e9).round() as i64
    }

    /// Reading at `nanos` nanoseconds since the start, °C.
    pub(super) fn measure(&mut self, nanos: i64) -> f64 {
        self.taken += 1;
        let noise = self.temperature.noise * self.random.sample::<f64, _>(StandardNormal);
        let celsius = self.temperature.at(nanos as f64 * 1e-9) + noise;
        match self.temperature.step {
            step if step > 0.0 => (celsius / step).round() * step,
            _ => celsius,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_course_is_linear_between_its_points_and_constant_beyond() {
        let course = vec![[10.0, 20.0], [20.0, 30.0], [40.0, 26.0]];
        let temperature = Temperature { course, reference: 25.0, topic: None, rate_hz: 1.0, noise: 0.0, step: 0.0 };
        for (seconds, celsius) in [(0.0, 20.0), (10.0, 20.0), (15.0, 25.0), (20.0, 30.0), (30.0, 28.0), (99.0, 26.0)] {
            assert_eq!(temperature.at(seconds), celsius, "{seconds} s");
        }
    }
}
