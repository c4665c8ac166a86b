//! Measurement model of one sensor: `measured = bias + S · true`, the cross terms, noise, quantisation, saturation.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::scenario::matrix;
use super::trajectory::State;
use super::{Scenario, Temperature, Triad};
use crate::imu::{self, Quantity};

/// A sensor with its random generator.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    pub which: imu::Sensor,
    triad: Triad,
    temperature: Option<Temperature>,
    sensitivity: Matrix3<f64>,
    /// Sensitivity to the other quantity: rate for an accelerometer, specific force for a gyroscope.
    cross: Matrix3<f64>,
    square: Vector3<f64>,
    /// Offset of each placement.
    offsets: Vec<Vector3<f64>>,
    random: ChaCha8Rng,
    /// Autocorrelation of the noise from one sample to the next, 0 to 1.
    memory: f64,
    noise: Vector3<f64>,
    filter: Option<LowPass>,
    taken: u64,
    /// Last recorded value.
    recorded: Option<Vector3<f64>>,
}

impl Sensor {
    /// Sensor of the scenario; `random` is its own generator.
    pub fn new(which: imu::Sensor, triad: &Triad, scenario: &Scenario, mut random: ChaCha8Rng) -> Self {
        let memory = match triad.noise_correlation_s {
            0.0 => 0.0,
            correlation_s => libm::exp(-1.0 / (triad.rate_hz * correlation_s)),
        };
        let offsets = scenario.pose.iter().map(|_| normal(&mut random) * triad.placement_scatter).collect();
        Self {
            which,
            sensitivity: triad.sensitivity.matrix(),
            cross: triad.g_sensitivity.or(triad.rate_sensitivity).map(matrix).unwrap_or_default(),
            square: triad.g2_sensitivity.map(Vector3::from).unwrap_or_default(),
            triad: triad.clone(),
            temperature: scenario.temperature.clone(),
            offsets,
            noise: normal(&mut random) * triad.noise,
            memory,
            filter: triad.bandwidth_hz.map(|bandwidth| LowPass::new(bandwidth, triad.rate_hz)),
            random,
            taken: 0,
            recorded: None,
        }
    }

    /// Time of the next sample, in nanoseconds since the start of the recording.
    pub fn next(&self) -> i64 {
        ((self.triad.phase_s + self.taken as f64 / self.triad.rate_hz) * 1e9).round() as i64
    }

    /// Takes the next sample.
    pub fn measure(&mut self, state: &State) -> Vector3<f64> {
        let (own, other) = match self.which {
            imu::Sensor::Gyroscope | imu::Sensor::Reference(Quantity::Rate) => (state.rate, state.force),
            _ => (state.force, state.rate),
        };
        let seconds = self.next() as f64 * 1e-9;
        let drift = Vector3::from(self.triad.bias_drift_per_h) * (seconds / 3600.0);
        let bias = Vector3::from(self.triad.bias) * self.triad.fault.bias_left(seconds) + drift + self.warmth(seconds);
        let own = if self.triad.fault.gravity_removed { own - state.gravity } else { own };
        let cross = self.cross * other + self.square.component_mul(&other.component_mul(&other));
        // First-order Gauss–Markov process, whose standard deviation does not depend on its memory.
        let fresh = self.triad.noise * (1.0 - self.memory * self.memory).sqrt();
        self.noise = self.noise * self.memory + normal(&mut self.random) * fresh;
        self.taken += 1;
        let input = self.sensitivity * own + cross;
        let input = self.filter.as_mut().map_or(input, |filter| filter.next(input));
        let reading = bias + input + self.offset(state) + self.noise;
        let reading = reading.map(|value| self.saturate(self.quantise(value)));
        let recorded = self.triad.fault.recorded(reading, seconds, self.recorded);
        self.recorded = Some(recorded);
        recorded
    }

    /// Change of the bias with temperature.
    fn warmth(&self, seconds: f64) -> Vector3<f64> {
        let Some(temperature) = self.temperature.as_ref().filter(|_| !self.triad.bias_by_temperature.is_empty()) else {
            return Vector3::zeros();
        };
        let distance = temperature.at(seconds) - temperature.reference;
        let terms = (1..).zip(&self.triad.bias_by_temperature);
        terms.map(|(degree, change)| Vector3::from(*change) * distance.powi(degree)).sum()
    }

    /// Offset of the placement, which changes smoothly on the way from one to the next.
    fn offset(&self, state: &State) -> Vector3<f64> {
        let of = |pose: usize| self.offsets.get(pose).copied().unwrap_or_default();
        of(state.poses.0).lerp(&of(state.poses.1), state.progress)
    }

    fn quantise(&self, value: f64) -> f64 {
        if self.triad.step > 0.0 { (value / self.triad.step).round() * self.triad.step } else { value }
    }

    fn saturate(&self, value: f64) -> f64 {
        self.triad.range.map_or(value, |range| value.clamp(-range, range))
    }
}

/// Low-pass filter of first order, exact for inputs that are linear between samples (first-order hold: Franklin, Powell
/// and Workman, Digital Control of Dynamic Systems, 3rd edition, section 6.3.2).
#[derive(Clone, Debug)]
struct LowPass {
    /// Remainder of a step after one sample, and the share of the last change that the output has followed.
    left: f64,
    followed: f64,
    /// Last input and output.
    last: Option<[Vector3<f64>; 2]>,
}

impl LowPass {
    fn new(bandwidth_hz: f64, rate_hz: f64) -> Self {
        // Samples in a time constant.
        let constant = rate_hz / (TAU * bandwidth_hz);
        let left = libm::exp(-1.0 / constant);
        Self { left, followed: 1.0 - (1.0 - left) * constant, last: None }
    }

    fn next(&mut self, input: Vector3<f64>) -> Vector3<f64> {
        let [before, output] = self.last.unwrap_or([input, input]);
        let output = output * self.left + before * (1.0 - self.left) + (input - before) * self.followed;
        self.last = Some([input, output]);
        output
    }
}

fn normal(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.sample(StandardNormal))
}
