//! What a fit of any triad comes to: parameters, their uncertainty, and how well the rests agree with them.

use nalgebra::{DMatrix, DVector, MatrixXx3};

use super::calibration::Calibration;
use super::parameterisation::Parameterisation;
use super::reliability::Reliability;
use super::worst_case::{ReadingError, most};

/// Parameters of a triad and how well they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Which parameters were estimated, and in what order they stand.
    pub shape: Parameterisation,
    /// Their values.
    pub parameters: DVector<f64>,
    /// Their covariance, all causes included, and stretched so that 1.96 standard deviations are half of a 95 % interval.
    pub covariance: DMatrix<f64>,
    /// How large the entries of S are that the shape leaves out, by assumption and data: a root mean square.
    pub unmodelled_std: f64,
    /// The same of the primary accelerometer that a secondary one was compared with.
    pub inherited_std: f64,
    /// Root mean square of what is left over, in the unit of the triad; for the primary accelerometer of ‖corrected‖ − g,
    /// weighted.
    pub residual_rms: f64,
    /// The greatest rms that noise or the gate's allowance excuse.
    pub residual_limit: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed placement scatter; `None` without redundancy.
    pub chi2_per_dof: Option<f64>,
    /// Those degrees of freedom.
    pub freedom: f64,
    /// What placements scatter by, as they were weighted with: one standard deviation for all axes, or one each.
    pub placement_std: Vec<f64>,
    /// Condition number of the design.
    pub condition: f64,
    /// How well the placements check each other; `None` beside a reference, where every sample checks the others.
    pub reliability: Option<Reliability>,
    /// Parameters held back by a bound, by their place in the parameter vector.
    pub active: Vec<usize>,
    /// Where the errors of a primary accelerometer come from, for what is compared with it.
    pub origin: Option<Origin>,
}

/// The errors of parameters by their causes.
#[derive(Clone, Debug, PartialEq)]
pub struct Origin {
    /// Covariance by what is the same at every placement.
    pub systematic: DMatrix<f64>,
    /// How the parameters move with the mean of a placement, by its number: unknowns × 3.
    pub influence: Vec<(u32, MatrixXx3<f64>)>,
    /// Variance between placements, per axis: likeliest, and such that 1.96 of its roots bound 95 %; and the variance of an
    /// estimate of it.
    pub between: [f64; 3],
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

    /// Allows for parameters that may as well be off by this.
    pub fn widen(&mut self, moved: &DVector<f64>) {
        /// Half width of a normal error's 95 % interval over its standard deviation.
        const NORMAL_95: f64 = 1.96;
        let doubt = moved * moved.transpose() / NORMAL_95.powi(2);
        self.covariance += &doubt;
        if let Some(origin) = &mut self.origin {
            origin.systematic += &doubt;
        }
    }

    /// Bound of the error of a corrected reading of an accelerometer at rest that holds in every direction of gravity at
    /// once, 95 % of the time, if no placement was wrong, m/s². What the model leaves out of S is in it, and so is what that
    /// of the primary does.
    pub fn reading_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let left_out = [self.unmodelled_std, self.inherited_std];
        ReadingError::new(self.shape, &self.covariance, inverse, left_out, gravity).worst()
    }

    /// The same in the one direction where it is worst.
    pub fn direction_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let left_out = [self.unmodelled_std, self.inherited_std];
        ReadingError::new(self.shape, &self.covariance, inverse, left_out, gravity).worst_direction()
    }

    /// The largest error of a corrected reading that one wrong placement could cause without being noticed, m/s².
    pub fn hidden_error(&self, gravity: f64) -> f64 {
        let inverse = self.calibration().inverse();
        let checks = self.reliability.iter().flat_map(|reliability| &reliability.checks);
        let errors = checks.map(|check| most(&inverse, &self.shape.calibration(&check.hidden), gravity));
        errors.fold(0.0, f64::max)
    }

    /// Both together.
    pub fn worst_case_error(&self, gravity: f64) -> f64 {
        self.reading_error(gravity) + self.hidden_error(gravity)
    }

    /// Allows for a parameter that a bound holds back and that would lie elsewhere without it.
    pub fn doubt_bound(&mut self, without: &DVector<f64>) {
        /// Half width of a normal error's 95 % interval over its standard deviation.
        const NORMAL_95: f64 = 1.96;
        let mut moved = without - &self.parameters;
        for i in 0..moved.len() {
            // Where it would lie is no surer than the parameter would be.
            moved[i] += NORMAL_95 * self.std(i) * if moved[i] == 0.0 { 0.0 } else { moved[i].signum() };
        }
        self.widen(&moved);
    }
}
