//! Result of a fit of any triad: parameters, their uncertainty, and how well the rests agree with them.

use nalgebra::{DMatrix, DVector, MatrixXx3};

use super::calibration::Calibration;
use super::parameterisation::Parameterisation;
use super::reliability::Reliability;
use super::worst_case::{ReadingError, most};

/// Parameters of a triad with their uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Estimated parameters and their order.
    pub shape: Parameterisation,
    /// Values of the parameters.
    pub parameters: DVector<f64>,
    /// Covariance of the parameters from all causes, stretched so that 1.96 standard deviations are half of a 95 %
    /// interval.
    pub covariance: DMatrix<f64>,
    /// Root mean square of the entries of S that the shape leaves out, from assumption and data.
    pub unmodelled_std: f64,
    /// The same of the primary accelerometer that a secondary one is compared with.
    pub inherited_std: f64,
    /// Root mean square of the residuals, in the unit of the triad; of the primary accelerometer, weighted, of
    /// ‖corrected‖ − g.
    pub residual_rms: f64,
    /// Largest rms that noise or the gate's allowance explains.
    pub residual_limit: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed placement scatter; `None` without
    /// redundancy.
    pub chi2_per_dof: Option<f64>,
    /// Degrees of freedom of that.
    pub freedom: f64,
    /// Standard deviation between placements used for the weights: one for all axes, or one for each.
    pub placement_std: Vec<f64>,
    /// Condition number of the design.
    pub condition: f64,
    /// Mutual check of the placements; `None` beside a reference, where every sample checks the others.
    pub reliability: Option<Reliability>,
    /// Parameters held by a bound, as indices into the parameter vector.
    pub active: Vec<usize>,
    /// Causes of the errors of a primary accelerometer, for triads that are compared with it.
    pub origin: Option<Origin>,
}

/// Errors of the parameters by cause.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// Covariance from errors that are the same at every placement.
    pub systematic: DMatrix<f64>,
    /// Derivative of the parameters with respect to the mean of each placement, by its number: unknowns × 3.
    pub influence: Vec<(u32, MatrixXx3<f64>)>,
    /// Variance between placements, per axis: the likeliest; one of whose roots 1.96 bound 95 %; and the variance of an
    /// estimate of it.
    pub between: [f64; 3],
}

impl Estimate {
    /// Bias and sensitivity.
    pub fn calibration(&self) -> Calibration {
        self.shape.calibration(&self.parameters)
    }

    /// Whether the residuals are small enough to believe the model.
    pub fn agrees(&self) -> bool {
        self.residual_rms <= self.residual_limit
    }

    /// Whether a single wrong placement would show, whichever it is; true beside a reference.
    pub fn is_checked(&self) -> bool {
        self.reliability.as_ref().is_none_or(Reliability::is_checked)
    }

    /// Standard deviation of a parameter by its index.
    pub fn std(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    /// Widens the covariance for parameters that may be off by `moved`.
    pub fn widen(&mut self, moved: &DVector<f64>) {
        /// Half width of a normal error's 95 % interval over its standard deviation.
        const NORMAL_95: f64 = 1.96;
        let doubt = moved * moved.transpose() / NORMAL_95.powi(2);
        self.covariance += &doubt;
        if let Some(origin) = &mut self.origin {
            origin.systematic += &doubt;
        }
    }

    /// Bound of the error of a corrected accelerometer reading at rest, in every direction of gravity at once, 95 % of
    /// the time, if no placement was wrong, m/s². Includes the entries of S that this model and that of the primary
    /// leave out.
    pub fn reading_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let left_out = [self.unmodelled_std, self.inherited_std];
        ReadingError::new(self.shape, &self.covariance, inverse, left_out, gravity).worst()
    }

    /// The same bound, in the one direction where it is largest.
    pub fn direction_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let left_out = [self.unmodelled_std, self.inherited_std];
        ReadingError::new(self.shape, &self.covariance, inverse, left_out, gravity).worst_direction()
    }

    /// Largest error of a corrected reading that one wrong placement could cause undetected, m/s².
    pub fn hidden_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let checks = self.reliability.iter().flat_map(|reliability| &reliability.checks);
        let errors = checks.map(|check| most(&inverse, &self.shape.calibration(&check.hidden), gravity));
        errors.fold(0.0, f64::max)
    }

    /// Sum of [`reading_error`](Self::reading_error) and [`hidden_error`](Self::hidden_error), m/s².
    pub fn worst_case_error(&self, gravity: f64) -> f64 {
        self.reading_error(gravity) + self.hidden_error(gravity)
    }

    /// Widens the covariance for parameters held by a bound, given their values `without` it.
    pub fn doubt_bound(&mut self, without: &DVector<f64>) {
        /// Half width of a normal error's 95 % interval over its standard deviation.
        const NORMAL_95: f64 = 1.96;
        let mut moved = without - &self.parameters;
        for i in 0..moved.len() {
            // The unbounded value is no more certain than the parameter is.
            moved[i] += NORMAL_95 * self.std(i) * if moved[i] == 0.0 { 0.0 } else { moved[i].signum() };
        }
        self.widen(&moved);
    }
}
