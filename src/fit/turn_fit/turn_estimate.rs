//! Result of a fit to turns.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector};

use super::g_sensitivity::GSensitivity;
use super::information::{OffDiagonals, Told};
use super::too_little::PRECISE;
use crate::fit::estimate::Estimate;
use crate::fit::parameterisation::Parameterisation;

/// Standard gravity, m/s².
const STANDARD_GRAVITY: f64 = 9.806_65;

/// Result of a fit to turns.
#[derive(Clone, Debug)]
pub struct TurnEstimate {
    /// Sensitivity S of the gyroscope.
    pub sensitivity: Matrix3<f64>,
    /// Covariance of its entries row by row, stretched as above.
    pub covariance: SMatrix<f64, 9, 9>,
    /// Entries of the accelerometer's S below the diagonal.
    pub off_diagonals: OffDiagonals,
    /// Accelerometer by rests and turns together: bias and lower-triangular S.
    pub accelerometer: SVector<f64, 9>,
    /// Information from the turns alone about the accelerometer.
    pub told: Told,
    /// G-sensitivity, if the rests show one.
    pub g_sensitivity: Option<GSensitivity>,
    /// Angle between gravity as predicted and as measured after each turn, rad.
    pub residuals: Vec<f64>,
    /// Turn that contradicts the others, if any; it is left out of the fit.
    pub left_out: Option<usize>,
    /// Number of turns in the fit.
    pub used: usize,
    /// Chi-squared over its degrees of freedom, before anything was scaled or added.
    pub chi2_per_dof: f64,
    /// Degrees of freedom of the fit.
    pub freedom: f64,
    /// Added error common to all turns, rad.
    pub added: f64,
    /// Condition number of the information from the turns, each unknown in its own unit.
    pub condition: f64,
    /// Whether the fit without any one turn agrees.
    pub redundant: bool,
}

impl TurnEstimate {
    /// Whether the accelerometer's entries below the diagonal are known, too.
    pub fn completes(&self) -> bool {
        self.off_diagonals.half_width() <= PRECISE
    }

    /// Estimate of the gyroscope, with a bias from rests.
    pub fn with_bias(&self, bias: &Estimate) -> Estimate {
        let (shape, first) = match &self.g_sensitivity {
            Some(_) => (Parameterisation::GYROSCOPE_BY_TURNS, 12),
            None => (Parameterisation::MATRIX, 12),
        };
        let mut parameters = DVector::zeros(shape.unknowns());
        let mut covariance = DMatrix::zeros(shape.unknowns(), shape.unknowns());
        for axis in 0..3 {
            parameters[axis] = bias.parameters.get(axis).copied().unwrap_or(0.0);
            for other in 0..3 {
                covariance[(axis, other)] = bias.covariance[(axis, other)];
                parameters[3 + 3 * axis + other] = self.sensitivity[(axis, other)];
            }
        }
        covariance.view_mut((3, 3), (9, 9)).copy_from(&self.covariance);
        if let Some(g) = &self.g_sensitivity {
            covariance.view_mut((0, 0), (3, 3)).fill(0.0);
            for axis in 0..3 {
                parameters[axis] = g.bias[axis];
                let place = |k: usize| if k == 0 { axis } else { first + 3 * axis + k - 1 };
                for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                    let unit = [1.0, 1.0 / STANDARD_GRAVITY];
                    covariance[(place(i), place(j))] =
                        g.covariance[axis][(i, j)] * unit[usize::from(i > 0)] * unit[usize::from(j > 0)];
                }
                // The error of the bias at rest stays.
                covariance[(axis, axis)] += bias.covariance[(axis, axis)];
                for column in 0..3 {
                    parameters[first + 3 * axis + column] = g.by_up[(axis, column)] / STANDARD_GRAVITY;
                }
            }
        }
        Estimate {
            shape,
            parameters,
            covariance,
            chi2_per_dof: Some(self.chi2_per_dof),
            freedom: self.freedom,
            condition: self.condition,
            origin: None,
            ..bias.clone()
        }
    }
}
