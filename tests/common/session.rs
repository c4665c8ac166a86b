//! An IMU's session made in code: rests, motions, turns, slides and gaps at 100 Hz, with known truth.
#![allow(dead_code)]

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use stillpoint::Stamp;
use stillpoint::fit::Calibration;
use stillpoint::imu::{Sample, Sensor};

/// Gravity, m/s².
pub const G: f64 = 9.80665;
/// Bias of the simulated gyroscope, rad/s.
pub const GYRO_BIAS: [f64; 3] = [0.01, -0.02, 0.005];
/// Stamp of the first sample, ns.
pub const START: i64 = 1_000_000_000;

/// What an IMU goes through, at 100 Hz.
pub struct Session {
    rng: ChaCha8Rng,
    /// Truth of the primary accelerometer.
    accelerometer: Calibration,
    /// Truth of a secondary one, if there is one.
    secondary: Option<Calibration>,
    /// Noise of the primary accelerometer's axes, m/s².
    accel_noise: f64,
    now: i64,
    pub samples: Vec<(Sensor, Sample)>,
}

impl Session {
    /// Of a perfect accelerometer beside a gyroscope with a bias.
    pub fn new() -> Self {
        Self {
            rng: ChaCha8Rng::seed_from_u64(11),
            accelerometer: Calibration::default(),
            secondary: None,
            accel_noise: 0.03,
            now: START,
            samples: Vec::new(),
        }
    }

    pub fn accelerometer(mut self, truth: Calibration) -> Self {
        self.accelerometer = truth;
        self
    }

    pub fn accel_noise(mut self, sigma: f64) -> Self {
        self.accel_noise = sigma;
        self
    }

    pub fn secondary(mut self, truth: Calibration) -> Self {
        self.secondary = Some(truth);
        self
    }

    fn noise(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            let x: f64 = StandardNormal.sample(&mut self.rng);
            x * sigma
        })
    }

    /// One sample of every sensor, of a true specific force and a true rate.
    pub fn sample(&mut self, specific_force: Vector3<f64>, rate: Vector3<f64>) {
        let stamp = Stamp::from_nanos(self.now);
        let log_time = self.now as u64;
        let accelerometer = self.accelerometer.measure(&specific_force) + self.noise(self.accel_noise);
        let gyroscope = rate + Vector3::from(GYRO_BIAS) + self.noise(0.002);
        self.samples.push((Sensor::Gyroscope, Sample { stamp, log_time, value: gyroscope }));
        self.samples.push((Sensor::Accelerometer, Sample { stamp, log_time, value: accelerometer }));
        if let Some(truth) = self.secondary {
            let value = truth.measure(&specific_force) + self.noise(0.35);
            self.samples.push((Sensor::Secondary(0), Sample { stamp, log_time, value }));
        }
        self.now += 10_000_000;
    }

    /// Each direction for so long, with a second of motion before it.
    pub fn rests(self, ups: &[Vector3<f64>], seconds: f64) -> Self {
        ups.iter().fold(self, |session, up| session.motion(1.0).rest(*up, seconds))
    }

    pub fn rest(mut self, up: Vector3<f64>, seconds: f64) -> Self {
        (0..(seconds * 100.0) as usize).for_each(|_| self.sample(up * G, Vector3::zeros()));
        self
    }

    pub fn motion(mut self, seconds: f64) -> Self {
        for _ in 0..(seconds * 100.0) as usize {
            let shake = self.noise(2.0);
            let rate = self.noise(0.5);
            self.sample(Vector3::z() * G + shake, rate);
        }
        self
    }

    pub fn turn(mut self, seconds: f64, rate: f64) -> Self {
        (0..(seconds * 100.0) as usize).for_each(|_| self.sample(Vector3::z() * G, Vector3::z() * rate));
        self
    }

    pub fn slide(mut self, seconds: f64, per_second: f64) -> Self {
        for i in 0..(seconds * 100.0) as usize {
            let angle = i as f64 * 0.01 * per_second;
            self.sample(Vector3::new(angle.sin(), 0.0, angle.cos()) * G, Vector3::zeros());
        }
        self
    }

    pub fn gap(mut self, seconds: f64) -> Self {
        self.now += (seconds * 1e9) as i64;
        self
    }
}
