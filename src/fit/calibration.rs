//! Bias and sensitivity of one triad. Which of their entries are unknown is said by [`Parameterisation`](super::Parameterisation).

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// `measured = bias + sensitivity · true`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// What a reading of zero adds, in the unit of the triad.
    pub bias: Vector3<f64>,
    /// Maps true to measured, dimensionless.
    pub sensitivity: Matrix3<f64>,
}

impl Default for Calibration {
    fn default() -> Self {
        Self { bias: Vector3::zeros(), sensitivity: Matrix3::identity() }
    }
}

impl Calibration {
    /// `S⁻¹ (measured − bias)`, in the unit of the triad; NaN if S cannot be inverted.
    pub fn correct(&self, measured: &Vector3<f64>) -> Vector3<f64> {
        self.inverse() * (measured - self.bias)
    }

    /// `bias + S · truth`.
    pub fn measure(&self, truth: &Vector3<f64>) -> Vector3<f64> {
        self.bias + self.sensitivity * truth
    }

    /// S⁻¹, NaN if there is none.
    pub fn inverse(&self) -> Matrix3<f64> {
        self.sensitivity.try_inverse().unwrap_or(Matrix3::repeat(f64::NAN))
    }
}
