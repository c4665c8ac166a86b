//! What a fit of any triad comes to: parameters, their uncertainty, and how well the rests agree with them.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::calibration::Calibration;
use super::shape::{Shape, Truth};

/// Parameters of a triad and how well they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Which parameters were estimated, and in what order they stand.
    pub shape: Shape,
    /// Their values.
    pub parameters: DVector<f64>,
    /// Their covariance, all causes included.
    pub covariance: DMatrix<f64>,
    /// Root mean square of what is left over, in the unit of the triad; for the primary accelerometer of ‖corrected‖ − g,
    /// weighted.
    pub residual_rms: f64,
    /// The greatest rms that noise or the gate's allowance excuse.
    pub residual_limit: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed placement scatter; `None` without redundancy.
    pub chi2_per_dof: Option<f64>,
    /// Condition number of the design.
    pub condition: f64,
    /// Parameters held back by a bound, by their place in the parameter vector.
    pub active: Vec<usize>,
}

impl Estimate {
    /// Bias and sensitivity.
    pub fn calibration(&self) -> Calibration {
        self.shape.calibration(&self.parameters)
    }

    /// Whether what is left over is small enough to believe the model.
    pub fn agrees(&self) -> bool {
        self.residual_rms <= self.residual_limit
    }

    /// Standard deviation of a parameter by its place in the vector.
    pub fn std(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    /// 95 % bound of the error of a corrected reading of an accelerometer, over all directions of gravity, m/s².
    pub fn worst_case_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let worst = directions().map(|up| {
            // δ(S⁻¹(m − b)) = −S⁻¹ ∂measured/∂parameters δparameters.
            let by_parameters = inverse * self.shape.jacobian(&Truth::of(up * gravity));
            let error: Matrix3<f64> = Matrix3::from_fn(|i, j| {
                (by_parameters.row(i) * &self.covariance * by_parameters.row(j).transpose())[(0, 0)]
            });
            error.symmetric_eigenvalues().max()
        });
        1.96 * worst.fold(0.0, f64::max).sqrt()
    }
}

/// Faces, edges and corners of a cube: where a quadratic form of direction has its extremes, near enough.
pub fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let axis = [-1.0, 0.0, 1.0];
    axis.into_iter()
        .flat_map(move |x| axis.into_iter().flat_map(move |y| axis.into_iter().map(move |z| Vector3::new(x, y, z))))
        .filter_map(|direction: Vector3<f64>| direction.try_normalize(0.5))
}
