//! Regression of what a triad read at rest on known truths: the gyroscope on the specific force, a secondary
//! accelerometer on the primary, an accelerometer on an accurate fixture. Where the truths come from, and what their own
//! uncertainty adds, is left to the callers.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::calibration::Calibration;
use super::estimate::Estimate;
use super::lsqlin;
use super::scatter::variance_between;
use super::shape::{Shape, Term, Truth};
use super::system::{Limits, Solved, System};

/// What a triad read during one placement, and what there was to read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Mean of the raw readings.
    pub mean: Vector3<f64>,
    /// Variance of that mean by noise alone, per axis.
    pub noise: Vector3<f64>,
    /// What there was to read.
    pub truth: Truth,
    /// Covariance of the noise of `truth.own`.
    pub truth_noise: Matrix3<f64>,
}

/// The parameters and what they leave over.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    pub(super) shape: Shape,
    pub(super) solved: Solved,
    /// What each equation was weighted with: readings in turn, three axes each.
    pub(super) weights: Vec<f64>,
    /// Root mean square of the residuals.
    pub(super) rms: f64,
    /// What noise alone would leave.
    pub(super) white_rms: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed scatter; `None` without redundancy.
    pub(super) chi2_per_dof: Option<f64>,
}

/// Regresses readings whose placements scatter by `assumed_std` on each axis until they show otherwise.
pub(super) fn regress(
    shape: Shape,
    readings: &[Reading],
    assumed_std: f64,
    limits: &Limits,
) -> Result<Regression, lsqlin::Error> {
    let assumed = assumed_std * assumed_std;
    let solve = |between: &Vector3<f64>, calibration: &Calibration| {
        let mut system = System::new(shape);
        let mut weights = Vec::new();
        for reading in readings {
            let variance = between + noise(reading, calibration);
            for axis in 0..3 {
                let direction = Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
                let target = reading.mean[axis] - fixed(shape, axis, &reading.truth);
                system.push(&direction, &reading.truth, target, variance[axis]);
                weights.push(1.0 / variance[axis].sqrt());
            }
        }
        system.solve(limits).map(|solved| (solved, weights))
    };
    // The sensitivity and the scatter that the first regression shows set the weights of the second.
    let (first, _) = solve(&Vector3::repeat(assumed), &Calibration::default())?;
    let left = residuals(shape, readings, &first.solution.x);
    let between = Vector3::from_fn(|axis, _| {
        let unknowns = shape.terms().iter().filter(|term| term.axis() == axis).count();
        let freedom = readings.len().saturating_sub(unknowns) as f64;
        variance_between(left.iter().map(|(residual, noise)| (residual[axis], noise[axis])), freedom, assumed_std)
    });
    let (solved, weights) = solve(&between, &shape.calibration(&first.solution.x))?;

    let left = residuals(shape, readings, &solved.solution.x);
    let count = (3 * left.len()).max(1) as f64;
    let freedom = (3 * left.len()).saturating_sub(shape.unknowns());
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        left.iter().flat_map(|(residual, noise)| residual.iter().zip(noise)).map(|(r, v)| of(*r, *v)).sum()
    };
    Ok(Regression {
        shape,
        solved,
        weights,
        rms: (sum(&|r, _| r * r) / count).sqrt(),
        white_rms: (sum(&|_, v| v) / count).sqrt(),
        chi2_per_dof: (freedom > 0).then(|| sum(&|r, v| r * r / (assumed + v)) / freedom as f64),
    })
}

impl Regression {
    /// As an estimate with a covariance of all causes. What noise does not excuse is allowed up to `allowance`.
    pub(super) fn estimate(self, covariance: DMatrix<f64>, allowance: f64) -> Estimate {
        Estimate {
            shape: self.shape,
            parameters: self.solved.solution.x,
            covariance,
            residual_rms: self.rms,
            residual_limit: (5.0 * self.white_rms).max(allowance),
            chi2_per_dof: self.chi2_per_dof,
            condition: self.solved.solution.condition,
            active: self.solved.solution.active,
        }
    }
}

/// What is left over of each reading, and its variance by noise alone.
fn residuals(shape: Shape, readings: &[Reading], parameters: &DVector<f64>) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let calibration = shape.calibration(parameters);
    let left = |reading: &Reading| {
        let explained = shape.jacobian(&reading.truth) * parameters;
        let residual =
            Vector3::from_fn(|axis, _| reading.mean[axis] - fixed(shape, axis, &reading.truth) - explained[axis]);
        (residual, noise(reading, &calibration))
    };
    readings.iter().map(left).collect()
}

/// What a perfect sensor makes of the truth where the shape leaves nothing free.
fn fixed(shape: Shape, axis: usize, truth: &Truth) -> f64 {
    let diagonal = shape.has(Term::Own(axis, axis));
    if diagonal { 0.0 } else { truth.own[axis] }
}

fn noise(reading: &Reading, calibration: &Calibration) -> Vector3<f64> {
    let sensitivity = &calibration.sensitivity;
    reading.noise + (sensitivity * reading.truth_noise * sensitivity.transpose()).diagonal()
}
