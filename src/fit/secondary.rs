//! A secondary accelerometer's calibration: regression on the calibrated primary over all rests, tilted ones included,
//! since both feel the same gravity whatever its direction.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::bars::Sharing;
use super::bound::Bounds;
use super::config::Loss;
use super::estimate::Estimate;
use super::lsqlin;
use super::regression::{Reading, regress};
use super::scatter::Assumed;
use super::shape::{Shape, Truth};
use super::system;

/// What both sensors read during one placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Number of the placement.
    pub placement: u32,
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
    loss: Loss,
) -> Result<Estimate, lsqlin::Error> {
    let calibration = primary.calibration();
    let inverse = calibration.inverse();
    let [typical, between] = primary.origin.as_ref().map_or([0.0; 2], |origin| origin.between);
    let placed = |pair: &Pair, between: f64| Matrix3::from_diagonal(&pair.primary_noise.add_scalar(between));
    let reading = |pair: &Pair| Reading {
        mean: pair.secondary,
        noise: pair.secondary_noise,
        truth: Truth::of(calibration.correct(&pair.primary)),
        truth_noise: inverse * placed(pair, typical) * inverse.transpose(),
    };
    let readings: Vec<_> = pairs.iter().map(reading).collect();
    let assumed = Assumed { placement: assumed_std, leak: MOUNTING };
    let limits = system::limits(shape, |term| bounds.secondary(shape, term));
    let regression = regress(shape, &readings, assumed, Sharing::Common, &limits, loss)?;

    let solved = &regression.solved;
    // A truth that moves by δ moves the solution like a reading that moves by −S δ. Truths move with the mean of the
    // primary by S'⁻¹, and with the primary's parameters, which that mean may have been fitted to, by −S'⁻¹ J.
    let through = shape.calibration(&solved.solution.x).sensitivity * inverse;
    let influence: Vec<_> = solved.influence(&solved.gain()).collect();
    let by_mean: Vec<_> = influence.chunks_exact(3).map(|axes| (&axes[0] + &axes[1] + &axes[2]) * through).collect();
    let mut by_parameters = DMatrix::zeros(shape.unknowns(), primary.shape.unknowns());
    for (by_mean, reading) in by_mean.iter().zip(&readings) {
        by_parameters += by_mean * primary.shape.jacobian(&reading.truth);
    }
    let mut other = DMatrix::zeros(shape.unknowns(), shape.unknowns());
    let fitted = primary.origin.iter().flat_map(|origin| &origin.influence);
    let fitted: BTreeMap<_, _> = fitted.map(|(placement, influence)| (*placement, influence)).collect();
    for (pair, by_mean) in pairs.iter().zip(by_mean) {
        // The regression took the means of the primary for independent of its parameters.
        other -= &by_mean * placed(pair, typical) * by_mean.transpose();
        let all = match fitted.get(&pair.placement) {
            Some(influence) => &by_parameters * *influence - by_mean,
            None => by_mean,
        };
        other += &all * placed(pair, between) * all.transpose();
    }
    if let Some(origin) = &primary.origin {
        other += &by_parameters * &origin.systematic * by_parameters.transpose();
    }
    let skewed = primary.shape.unmodelled().next().is_some();
    let inherited_std = if skewed { primary.unmodelled_std } else { primary.inherited_std };
    Ok(Estimate { inherited_std, ..regression.estimate(&other, ALLOWANCE) })
}
