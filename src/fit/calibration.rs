//! Bias and sensitivity of one triad.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Measurement model `measured = bias + sensitivity · true`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Reading at a true value of zero, in the unit of the triad.
    pub bias: Vector3<f64>,
    /// Matrix S that maps true to measured, dimensionless.
    pub sensitivity: Matrix3<f64>,
}

impl Default for Calibration {
    fn default() -> Self {
        Self { bias: Vector3::zeros(), sensitivity: Matrix3::identity() }
    }
}

impl Calibration {
    /// Corrects a reading: `S⁻¹ (measured − bias)`, in the unit of the triad; NaN if S is singular.
    pub fn correct(&self, measured: &Vector3<f64>) -> Vector3<f64> {
        self.inverse() * (measured - self.bias)
    }

    /// Predicts a reading: `bias + S · truth`, in the unit of the triad.
    pub fn measure(&self, truth: &Vector3<f64>) -> Vector3<f64> {
        self.bias + self.sensitivity * truth
    }

    /// Inverse S⁻¹; NaN if S is singular.
    pub fn inverse(&self) -> Matrix3<f64> {
        self.sensitivity.try_inverse().unwrap_or(Matrix3::repeat(f64::NAN))
    }
}
