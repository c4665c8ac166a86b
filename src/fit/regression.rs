//! Regression of the readings of a triad at rest on known true values: the gyroscope on specific force, a secondary
//! accelerometer on the primary, an accelerometer on an accurate fixture.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::calibration::Calibration;
use super::config::Loss;
use super::error::Error;
use super::estimate::Estimate;
use super::linear_system::{self, Limits, LinearSystem, Solved};
use super::parameterisation::{Parameterisation, Term, Truth};
use super::placement_scatter::Assumed;
use super::reliability::{GROSS_ERROR, Reliability};
use super::uncertainty::{Other, Sharing, Uncertainty};

/// Reading of a triad during one placement, with its true value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Mean of the raw readings.
    pub mean: Vector3<f64>,
    /// Variance of that mean from noise alone, per axis.
    pub noise: Vector3<f64>,
    /// True quantities.
    pub truth: Truth,
    /// Covariance of the noise of `truth.own`.
    pub truth_noise: Matrix3<f64>,
}

/// Solution of a regression, with its residuals.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    pub(super) shape: Parameterisation,
    pub(super) solved: Solved,
    /// Derivative of the unknowns with respect to each weighted target.
    pub(super) gain: DMatrix<f64>,
    pub(super) uncertainty: Uncertainty,
    assumed: Assumed,
    /// Residual rms expected from noise alone.
    white_rms: f64,
    /// Unknowns without limits, if a limit holds one of them back.
    unlimited: Option<DVector<f64>>,
}

/// Regresses readings whose placements scatter on each axis as assumed, until they show otherwise. The equations are
/// those of the readings in turn, three axes each.
pub(super) fn regress(
    shape: Parameterisation,
    readings: &[Reading],
    assumed: Assumed,
    sharing: Sharing,
    limits: &Limits,
    loss: Loss,
) -> Result<Regression, Error> {
    let solve = |between: &Vector3<f64>, calibration: &Calibration, limits: &Limits| {
        let mut system = LinearSystem::leaking(shape, assumed.leak);
        for reading in readings {
            let noise = noise(reading, calibration);
            for axis in 0..3 {
                let direction = Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
                let target = reading.mean[axis] - fixed(shape, axis, &reading.truth);
                system.push(&direction, &reading.truth, target, noise[axis], between[axis]);
            }
        }
        system.solve(limits, loss)
    };
    // The sensitivity and the scatter of the first regression set the weights of the second.
    let first = solve(&Vector3::repeat(assumed.placement.powi(2)), &Calibration::default(), limits)?;
    let calibration = shape.calibration(&first.solution.x);
    let uncertainty = Uncertainty::learn(shape, &first, sharing, assumed);
    let solved = solve(&Vector3::from_fn(|axis, _| uncertainty.between(axis)), &calibration, limits)?;
    let white: f64 = readings.iter().map(|reading| noise(reading, &calibration).sum()).sum();
    let white_rms = (white / (3 * readings.len()).max(1) as f64).sqrt();
    let unlimited = match solved.solution.active.is_empty() {
        true => None,
        false => {
            let none = linear_system::limits(shape, |_| [f64::NEG_INFINITY, f64::INFINITY]);
            Some(solve(&Vector3::from_fn(|axis, _| uncertainty.between(axis)), &calibration, &none)?.solution.x)
        }
    };
    Ok(Regression { shape, gain: solved.gain(), solved, uncertainty, assumed, white_rms, unlimited })
}

impl Regression {
    /// Converts the regression to an estimate, with `other` for what the readings do not show. A residual rms that
    /// neither noise nor scatter explains is accepted up to `allowance`.
    pub(super) fn estimate(self, other: &Other, allowance: f64) -> Estimate {
        let Self { shape, solved, gain, uncertainty, assumed, white_rms, unlimited } = self;
        let reliability = Reliability::of(&solved, &gain, GROSS_ERROR);
        let mut estimate = Estimate {
            shape,
            covariance: uncertainty.covariance(shape, &solved, &gain, other),
            unmodelled_std: uncertainty.leak_rms,
            inherited_std: 0.0,
            residual_rms: uncertainty.left_rms,
            residual_limit: (5.0 * libm::hypot(white_rms, assumed.placement)).max(allowance),
            chi2_per_dof: uncertainty.chi2_per_dof(),
            freedom: uncertainty.freedom(),
            placement_std: uncertainty.placement_std(),
            condition: solved.solution.condition(),
            reliability: Some(reliability),
            active: solved.solution.active.clone(),
            parameters: solved.solution.x,
            origin: None,
        };
        if let Some(unlimited) = unlimited {
            estimate.doubt_bound(&unlimited);
        }
        estimate
    }
}

/// Reading of a perfect sensor, if its own sensitivity is not an unknown of the shape; otherwise zero.
fn fixed(shape: Parameterisation, axis: usize, truth: &Truth) -> f64 {
    let diagonal = shape.has(Term::Own(axis, axis));
    if diagonal { 0.0 } else { truth.own[axis] }
}

fn noise(reading: &Reading, calibration: &Calibration) -> Vector3<f64> {
    let sensitivity = &calibration.sensitivity;
    reading.noise + (sensitivity * reading.truth_noise * sensitivity.transpose()).diagonal()
}
