//! What may happen to the readings between the sensor and the recording.

pub use nalgebra::Vector3;
use stillpoint::Stamp;
use stillpoint::imu::{Sample, Sensor};

pub use super::sessions::FACES;
use super::sessions::Session;

pub const G: f64 = 9.80665;

pub fn clamp(value: Vector3<f64>, range: f64) -> Vector3<f64> {
    value.map(|axis| axis.clamp(-range, range))
}

impl Session {
    pub fn change(mut self, of: Sensor, how: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Self {
        self.each(of, |_, sample| sample.value = how(sample.value));
        self
    }

    /// The accelerometer with so much more bias.
    pub fn biased(mut self, bias: Vector3<f64>) -> Self {
        self.truth.bias += bias;
        self.change(Sensor::Accelerometer, |value| value + bias)
    }

    /// Corrected by the truth.
    pub fn ideal(mut self) -> Self {
        let (bias, scale) = (self.truth.bias, self.truth.scale);
        (self.truth.bias, self.truth.scale) = (Vector3::zeros(), Vector3::repeat(1.0));
        self.change(Sensor::Accelerometer, |value| (value - bias).component_div(&scale))
    }

    /// All axes of the accelerometer with the other sign.
    pub fn flipped(mut self) -> Self {
        self.truth.bias *= -1.0;
        self.change(Sensor::Accelerometer, |value| -value)
    }

    /// The gyroscope through signs or an exchange of its axes.
    pub fn turned(mut self, how: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Self {
        self.truth.gyro_bias = how(self.truth.gyro_bias);
        self.change(Sensor::Gyroscope, how)
    }

    /// An axis of the accelerometer stands still from the middle on.
    pub fn freezing(mut self, axis: usize) -> Self {
        let (half, mut last) = (self.samples.len() / 2, 0.0);
        self.each(Sensor::Accelerometer, |i, sample| {
            if i < half {
                last = sample.value[axis];
            }
            sample.value[axis] = last;
        });
        self
    }

    /// Everything once more, half a period later.
    pub fn republished(mut self) -> Self {
        let later = (self.period * 0.5e9) as i64;
        self.twice(|pair| pair.iter().map(|(sensor, sample)| (*sensor, delayed(sample, later))).collect());
        self
    }

    /// Everything once more, as it is.
    pub fn duplicated(mut self) -> Self {
        self.twice(<[_]>::to_vec);
        self
    }

    /// Readings of so many sensors in turn on one topic: what another one reads, by its number.
    pub fn in_turn(mut self, sensors: usize, reads: impl Fn(usize, Sensor, Vector3<f64>) -> Vector3<f64>) -> Self {
        let later = |k: usize| (self.period * 1e9 * k as f64 / sensors as f64) as i64;
        let of = |k: usize, (sensor, sample): &(Sensor, Sample)| {
            let value = reads(k, *sensor, sample.value);
            (*sensor, Sample { value, ..delayed(sample, later(k)) })
        };
        let all = |pair: &[_]| (0..sensors).flat_map(|k| pair.iter().map(move |one| (k, *one))).collect::<Vec<_>>();
        self.samples = self.samples.chunks(2).flat_map(all).map(|(k, one)| of(k, &one)).collect();
        self
    }

    /// An estimator learns the bias of the gyroscope while it rests, and forgets it in motion.
    pub fn relaxing(mut self, seconds: f64) -> Self {
        let (bias, rested) = (self.truth.gyro_bias, self.rested.clone());
        self.each(Sensor::Gyroscope, |i, sample| {
            let learned = rested[i].map_or(0.0, |rested| 1.0 - (-rested / seconds).exp());
            sample.value -= bias * learned;
        });
        self
    }

    /// The same, but it never forgets.
    pub fn relaxing_once(mut self, seconds: f64) -> Self {
        let (bias, first) = (self.truth.gyro_bias, self.samples[0].1.stamp);
        self.each(Sensor::Gyroscope, |_, sample| {
            sample.value -= bias * (1.0 - (-sample.stamp.seconds_since(first) / seconds).exp());
        });
        self
    }

    /// Half a second is missing every three seconds.
    pub fn gaps(mut self) -> Self {
        let first = self.samples[0].1.stamp;
        self.samples.retain(|(_, sample)| sample.stamp.seconds_since(first) % 3.0 < 2.5);
        self
    }

    /// Stamps early or late by up to a third of a period.
    pub fn jittered(mut self) -> Self {
        let most = self.period * 1e9 / 3.0;
        for (i, pair) in self.samples.chunks_mut(2).enumerate() {
            let late = (most * (i as f64 * 12.9898).sin()) as i64;
            pair.iter_mut().for_each(|(_, sample)| *sample = delayed(sample, late));
        }
        self
    }

    fn each(&mut self, of: Sensor, mut change: impl FnMut(usize, &mut Sample)) {
        let samples = self.samples.iter_mut().enumerate().filter(|(_, (sensor, _))| *sensor == of);
        samples.for_each(|(i, (_, sample))| change(i, sample));
    }

    fn twice(&mut self, again: impl Fn(&[(Sensor, Sample)]) -> Vec<(Sensor, Sample)>) {
        self.samples = self.samples.chunks(2).flat_map(|pair| [pair.to_vec(), again(pair)].concat()).collect();
    }
}

fn delayed(sample: &Sample, nanos: i64) -> Sample {
    let stamp: Stamp = sample.stamp.plus_nanos(nanos);
    Sample { stamp, ..*sample }
}
