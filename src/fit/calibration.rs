//! Bias and sensitivity of one triad, and the measurement models that say which of their entries are unknown.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
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

/// The entries of S that a measurement model leaves free, as (row, column) in the order of the parameter vector: first
/// the three biases, then these. The others are those of the identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape(&'static [(usize, usize)]);

impl Shape {
    /// Diagonal S: six unknowns (the thesis' simplified model 2).
    pub const DIAGONAL: Self = Self(&[(0, 0), (1, 1), (2, 2)]);

    /// The free entries of S.
    pub fn free(self) -> &'static [(usize, usize)] {
        self.0
    }

    /// Number of unknowns.
    pub fn unknowns(self) -> usize {
        3 + self.0.len()
    }

    /// The parameter vector of a calibration.
    pub fn vector(self, calibration: &Calibration) -> DVector<f64> {
        let entries = self.0.iter().map(|&entry| calibration.sensitivity[entry]);
        DVector::from_iterator(self.unknowns(), calibration.bias.iter().copied().chain(entries))
    }

    /// The calibration of a parameter vector.
    pub fn calibration(self, parameters: &DVector<f64>) -> Calibration {
        let mut calibration = Calibration { bias: parameters.fixed_rows::<3>(0).into(), ..Calibration::default() };
        for (&entry, value) in self.0.iter().zip(parameters.iter().skip(3)) {
            calibration.sensitivity[entry] = *value;
        }
        calibration
    }

    /// ∂measured/∂(the entries of S that are not free) at a true value: 3 × 6 for a diagonal S.
    pub fn unmodelled(self, truth: &Vector3<f64>) -> DMatrix<f64> {
        let fixed: Vec<_> = (0..9).map(|k| (k / 3, k % 3)).filter(|entry| !self.0.contains(entry)).collect();
        let mut jacobian = DMatrix::zeros(3, fixed.len());
        for (k, (row, column)) in fixed.into_iter().enumerate() {
            jacobian[(row, k)] = truth[column];
        }
        jacobian
    }

    /// ∂measured/∂parameters at a true value: 3 × unknowns.
    pub fn jacobian(self, truth: &Vector3<f64>) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(3, self.unknowns());
        jacobian.view_mut((0, 0), (3, 3)).fill_with_identity();
        for (k, &(row, column)) in self.0.iter().enumerate() {
            jacobian[(row, 3 + k)] = truth[column];
        }
        jacobian
    }
}
