//! A sensor in somebody's hand: rests and the turns between them, with known truth, beside a world that stands still.
#![allow(dead_code)]

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::Stamp;
use stillpoint::imu::{Sample, Sensor};

/// Gravity, m/s².
pub const G: f64 = 9.80665;

/// What the hand holds.
#[derive(Clone)]
pub struct Held {
    pub rate_hz: f64,
    pub accel_noise: f64,
    pub gyro_noise: f64,
    pub gyro_bias: Vector3<f64>,
    /// Readings of the gyroscope are S times the true rate, in whatever unit.
    pub gyro_sensitivity: Matrix3<f64>,
    pub accel_sensitivity: Matrix3<f64>,
    pub accel_bias: Vector3<f64>,
    /// What specific force along a unit vector adds to the rate, rad/s.
    pub g_sensitivity: Matrix3<f64>,
    /// What a reading of specific force is off by from placement to placement, one standard deviation, m/s².
    pub placement: f64,
    /// Rotation vectors of wobble, rad.
    pub wobble: f64,
}

impl Default for Held {
    fn default() -> Self {
        Self {
            rate_hz: 100.0,
            accel_noise: 0.02,
            gyro_noise: 0.001,
            gyro_bias: Vector3::new(0.01, -0.02, 0.005),
            gyro_sensitivity: Matrix3::identity(),
            accel_sensitivity: Matrix3::identity(),
            accel_bias: Vector3::zeros(),
            g_sensitivity: Matrix3::zeros(),
            placement: 0.0,
            wobble: 0.1,
        }
    }
}

/// A recording under way.
pub struct Hand {
    held: Held,
    rng: ChaCha8Rng,
    /// Attitude: sensor to world.
    attitude: Rotation3<f64>,
    now: f64,
    off: Vector3<f64>,
    pub samples: Vec<(Sensor, Sample)>,
    /// Stamp and angle of its x axis in the horizontal plane, rad, of each pair of samples, and the number of the rest that
    /// they belong to; 0 in motion.
    pub headings: Vec<(Stamp, f64, usize)>,
    rests: usize,
}

impl Hand {
    pub fn new(held: Held, seed: u64) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(seed);
        Self {
            held,
            rng,
            attitude: Rotation3::identity(),
            now: 1.0,
            off: Vector3::zeros(),
            samples: Vec::new(),
            headings: Vec::new(),
            rests: 0,
        }
    }

    /// The same sensor, turned by a rotation vector before it is read.
    pub fn mounted(mut self, vector: Vector3<f64>) -> Self {
        self.attitude *= Rotation3::from_scaled_axis(vector);
        self
    }

    pub fn normal(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.rng.sample::<f64, _>(StandardNormal))
    }

    /// Time since the first reading, s.
    pub fn seconds(&self) -> f64 {
        self.now - 1.0
    }

    /// Direction of specific force in the sensor's axes.
    pub fn up(&self) -> Vector3<f64> {
        self.attitude.inverse() * Vector3::z()
    }

    fn sample(&mut self, attitude: &Rotation3<f64>, rate: &Vector3<f64>, jolt: f64) {
        let stamp = Stamp::from_nanos((self.now * 1e9).round() as i64);
        let log_time = stamp.nanos() as u64;
        let held = self.held.clone();
        let force = attitude.inverse() * Vector3::z() * G + self.normal() * jolt;
        let accel = held.accel_sensitivity * force + held.accel_bias + self.off + self.normal() * held.accel_noise;
        let gyro = held.gyro_sensitivity * (rate + held.gyro_bias + self.normal() * held.gyro_noise)
            + held.g_sensitivity * force / G;
        let front = attitude * Vector3::x();
        let rest = if *rate == Vector3::zeros() { self.rests } else { 0 };
        self.headings.push((stamp, front.y.atan2(front.x), rest));
        self.samples.push((Sensor::Gyroscope, Sample { stamp, log_time, value: gyro }));
        self.samples.push((Sensor::Accelerometer, Sample { stamp, log_time, value: accel }));
        self.now += 1.0 / held.rate_hz;
    }

    pub fn rest(mut self, seconds: f64) -> Self {
        self.off = self.normal() * self.held.placement;
        self.rests += 1;
        for _ in 0..(seconds * self.held.rate_hz) as usize {
            self.sample(&self.attitude.clone(), &Vector3::zeros(), 0.0);
        }
        self
    }

    /// Turns by a rotation vector of its own axes, as a hand does: wobbling.
    pub fn turn(self, vector: Vector3<f64>, seconds: f64) -> Self {
        self.sway(vector, seconds, 0.3)
    }

    /// Turns over until a direction of its own axes points up.
    pub fn turn_up(self, target: Vector3<f64>, seconds: f64) -> Self {
        let up = self.up();
        let axis = target.cross(&up);
        let angle = axis.norm().atan2(target.dot(&up));
        // Upside down: about any axis across.
        let axis = if axis.norm() < 0.1 { up.cross(&Vector3::ith(up.iamin(), 1.0)) } else { axis };
        self.turn(axis.normalize() * angle, seconds)
    }

    /// Through faces of a cube in an order of chance, tilted a little, so many turns, and a rest after each.
    pub fn through_faces(mut self, turns: usize) -> Self {
        let mut left = Vec::new();
        let mut face = 4;
        for _ in 0..turns {
            if left.is_empty() {
                left = (0..6).filter(|next| *next != face).collect();
            }
            face = left.swap_remove(self.rng.random_range(0..left.len()));
            let normal = Vector3::ith(face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
            let target = (normal + self.normal() * 0.03).normalize();
            let seconds = self.rng.random_range(1.0..2.5);
            self = self.turn_up(target, seconds).rest(3.0);
        }
        self
    }

    /// A table that is knocked: it shakes, and turns nowhere.
    pub fn bump(mut self, seconds: f64) -> Self {
        let wobble = std::mem::replace(&mut self.held.wobble, 0.002);
        let mut moved = self.sway(Vector3::zeros(), seconds, 3.0);
        moved.held.wobble = wobble;
        moved
    }

    fn sway(mut self, vector: Vector3<f64>, seconds: f64, jolt: f64) -> Self {
        let start = self.attitude;
        let waves: Vec<_> = (1..4).map(|k| (self.normal() * self.held.wobble / f64::from(k), self.normal())).collect();
        let at = |x: f64| {
            let share = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
            let fade = (std::f64::consts::PI * x).sin().powi(2);
            let wave = waves.iter().zip(1..).map(|((size, phase), k)| {
                size.zip_map(phase, |size, phase| size * (f64::from(k) * std::f64::consts::TAU * x + phase).sin())
            });
            let wobble: Vector3<f64> = wave.sum::<Vector3<f64>>() * fade;
            start * Rotation3::from_scaled_axis(vector * share) * Rotation3::from_scaled_axis(wobble)
        };
        let count = (seconds * self.held.rate_hz) as usize;
        let seconds = count as f64 / self.held.rate_hz;
        for i in 0..count {
            let x = (i as f64 + 1.0) / count as f64;
            let small = 1e-4;
            let (before, after) = (at(x - small), at((x + small).min(1.0)));
            let span = ((x + small).min(1.0) - (x - small)) * seconds;
            let step = (before.inverse() * after).into_inner();
            let sine = Vector3::new(step.m32 - step.m23, step.m13 - step.m31, step.m21 - step.m12) / 2.0;
            let rate = sine * (1.0 + sine.norm_squared() / 6.0) / span;
            self.sample(&at(x), &rate, jolt);
        }
        self.attitude = at(1.0);
        self
    }
}
