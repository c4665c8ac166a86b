//! A secondary accelerometer's calibration: regression on the calibrated primary over all rests, tilted ones included,
//! since both feel the same gravity whatever its direction.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::config::Bounds;
use super::estimate::Estimate;
use super::lsqlin;
use super::regression::{Reading, regress};
use super::scatter::Assumed;
use super::shape::{Shape, Truth};
use super::system::limits;

/// What both sensors read during one placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Raw mean of the primary, m/s².
    pub primary: Vector3<f64>,
    /// Raw mean of the secondary, m/s².
    pub secondary: Vector3<f64>,
    /// Noise variance of the primary's mean, per axis.
    pub primary_noise: Vector3<f64>,
    /// Noise variance of the secondary's mean, per axis.
    pub secondary_noise: Vector3<f64>,
}

/// A secondary is mounted, and cross-couples, this far off the primary's axes where the model has no word for it (one
/// standard deviation): two degrees.
const MOUNTING: f64 = 0.035;
/// Residuals below this are no reason to refuse, m/s².
const ALLOWANCE: f64 = 0.05;

/// Regresses the secondary on the primary as `primary` calibrates it.
///
/// # Errors
/// If the rests do not determine the parameters, or the solver fails.
pub fn fit(
    shape: Shape,
    pairs: &[Pair],
    primary: &Estimate,
    assumed_std: f64,
    bounds: &Bounds,
) -> Result<Estimate, lsqlin::Error> {
    let calibration = primary.calibration();
    let inverse = calibration.inverse();
    let reading = |pair: &Pair| Reading {
        mean: pair.secondary,
        noise: pair.secondary_noise,
        truth: Truth::of(calibration.correct(&pair.primary)),
        truth_noise: inverse * Matrix3::from_diagonal(&pair.primary_noise) * inverse.transpose(),
    };
    let readings: Vec<_> = pairs.iter().map(reading).collect();
    // Both sensors are placed anew each time.
    let placement = assumed_std * std::f64::consts::SQRT_2;
    let assumed = Assumed { placement, leak: MOUNTING };
    let regression = regress(shape, &readings, assumed, &limits(shape, |term| bounds.secondary(term)))?;

    // A truth that moves by δ moves the solution like a reading that moves by −S δ; the truths move with the primary's
    // parameters by −S'⁻¹ J.
    let solved = &regression.solved;
    let through = shape.calibration(&solved.solution.x).sensitivity * inverse;
    let mut moved = DMatrix::zeros(3 * readings.len(), primary.shape.unknowns());
    for (r, reading) in readings.iter().enumerate() {
        moved.rows_mut(3 * r, 3).copy_from(&(through * primary.shape.jacobian(&reading.truth)));
    }
    solved.weigh(&mut moved);
    let by_primary = solved.gain() * moved;
    let other = &by_primary * &primary.covariance * by_primary.transpose();
    Ok(regression.estimate(&other, ALLOWANCE))
}
