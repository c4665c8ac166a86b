//! Faults of a sensor's readings between its converter and the recording.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Faults of one sensor; none by default. They are not part of its truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fault {
    /// Factor on the readings: 0.101972 for an accelerometer in g, 57.29578 for a gyroscope in deg/s.
    pub factor: f64,
    /// Axes recorded with the opposite sign.
    pub flipped: Vec<Axis>,
    /// Axes whose readings freeze, from [`frozen_from_s`](Self::frozen_from_s) on.
    pub frozen: Vec<Axis>,
    /// Start of the freezing, in seconds after the start of the recording.
    pub frozen_from_s: f64,
    /// Accelerometer: whether gravity is removed, as by a sensor that knows its attitude.
    pub gravity_removed: bool,
    /// Time constant with which an estimator in the driver removes the bias, in seconds; it does not if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_learned_in_s: Option<f64>,
}

/// An axis of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Default for Fault {
    fn default() -> Self {
        Self {
            factor: 1.0,
            flipped: Vec::new(),
            frozen: Vec::new(),
            frozen_from_s: 0.0,
            gravity_removed: false,
            bias_learned_in_s: None,
        }
    }
}

impl Fault {
    /// Fraction of the bias that is left `seconds` after the start.
    pub(super) fn bias_left(&self, seconds: f64) -> f64 {
        self.bias_learned_in_s.map_or(1.0, |constant| libm::exp(-seconds / constant))
    }

    /// Recorded value of a reading, given the last recorded value.
    pub(super) fn recorded(&self, mut reading: Vector3<f64>, seconds: f64, last: Option<Vector3<f64>>) -> Vector3<f64> {
        reading *= self.factor;
        self.flipped.iter().for_each(|axis| reading[axis.index()] *= -1.0);
        if let Some(last) = last.filter(|_| seconds >= self.frozen_from_s) {
            self.frozen.iter().for_each(|axis| reading[axis.index()] = last[axis.index()]);
        }
        reading
    }
}

impl Axis {
    fn index(self) -> usize {
        self as usize
    }
}
