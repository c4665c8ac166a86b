//! What happens to the readings of a sensor between its converter and the recording.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The faults of one sensor; none by default. They are no part of its truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fault {
    /// What readings are multiplied with: 0.101972 for an accelerometer in g, 57.29578 for a gyroscope in deg/s.
    pub factor: f64,
    /// Axes recorded with the other sign.
    pub flipped: Vec<Axis>,
    /// Axes that stand still …
    pub frozen: Vec<Axis>,
    /// … from so many seconds after the start of the recording on.
    pub frozen_from_s: f64,
    /// Accelerometer: whether gravity is taken away, as by a sensor that knows its attitude.
    pub gravity_removed: bool,
    /// How fast an estimator in the driver takes the bias away, a time constant in seconds; not at all if absent.
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
    /// How much of the bias is left so many seconds after the start.
    pub(super) fn bias_left(&self, seconds: f64) -> f64 {
        self.bias_learned_in_s.map_or(1.0, |constant| libm::exp(-seconds / constant))
    }

    /// What is recorded of a reading, given what was recorded before.
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
