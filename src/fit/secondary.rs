//! Calibration of a secondary accelerometer: regression on the calibrated primary over all rests, tilted ones included,
//! since both sense the same gravity in any direction.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::bound::Bounds;
use super::config::Loss;
use super::error::Error;
use super::estimate::Estimate;
use super::linear_system;
use super::parameterisation::{Parameterisation, Term, Truth};
use super::placement_scatter::Assumed;
use super::regression::{Reading, regress};
use super::uncertainty::{Other, Sharing};

/// Readings of both sensors during one placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Number of the placement.
    pub placement: u32,
    /// Raw mean of the primary, m/s².
    pub primary: Vector3<f64>,
    /// Raw mean of the secondary, m/s².
    pub secondary: Vector3<f64>,
    /// Noise variance of the primary's mean, per axis, (m/s²)².
    pub primary_noise: Vector3<f64>,
    /// Noise variance of the secondary's mean, per axis, (m/s²)².
    pub secondary_noise: Vector3<f64>,
}

/// Off-diagonal entries of a secondary's S that the model does not estimate, standard deviation: two degrees of
/// mounting and one percent of cross-axis sensitivity.
const MOUNTING: f64 = 0.0363;
/// Residuals below this never make a fit disagree, m/s².
const ALLOWANCE: f64 = 0.05;

/// Regresses the secondary on the primary, corrected by the calibration `primary`.
///
/// # Errors
/// If the rests do not determine the parameters, or the solver fails.
pub fn fit(
    shape: Parameterisation,
    pairs: &[Pair],
    primary: &Estimate,
    assumed_std: f64,
    bounds: &Bounds,
    loss: Loss,
) -> Result<Estimate, Error> {
    let calibration = primary.calibration();
    let inverse = calibration.inverse();
    let [between, _, spread] = primary.origin.as_ref().map_or([0.0; 3], |origin| origin.between);
    let placed = |pair: &Pair| Matrix3::from_diagonal(&pair.primary_noise.add_scalar(between));
    let reading = |pair: &Pair| Reading {
        mean: pair.secondary,
        noise: pair.secondary_noise,
        truth: Truth::of(calibration.correct(&pair.primary)),
        truth_noise: inverse * placed(pair) * inverse.transpose(),
    };
    let readings: Vec<_> = pairs.iter().map(reading).collect();
    let assumed = Assumed { placement: assumed_std, leak: MOUNTING };
    let limits = linear_system::limits(shape, |term| bounds.secondary(shape, term));
    let regression = regress(shape, &readings, assumed, Sharing::Common, &limits, loss)?;

    let solved = &regression.solved;
    // A truth that moves by δ moves the solution like a reading that moves by −S δ. Truths move with the mean of the
    // primary by S'⁻¹; and by −S'⁻¹ J with the primary's parameters, which may have been fitted to that mean.
    let through = shape.calibration(&solved.solution.x).sensitivity * inverse;
    let influence: Vec<_> = solved.influence(&regression.gain).collect();
    let by_mean: Vec<_> = influence.chunks_exact(3).map(|axes| (&axes[0] + &axes[1] + &axes[2]) * through).collect();
    let mut by_parameters = DMatrix::zeros(shape.unknowns(), primary.shape.unknowns());
    for (by_mean, reading) in by_mean.iter().zip(&readings) {
        by_parameters += by_mean * primary.shape.jacobian(&reading.truth);
    }
    let mut other = DMatrix::zeros(shape.unknowns(), shape.unknowns());
    let fitted = primary.origin.iter().flat_map(|origin| &origin.influence);
    let fitted: BTreeMap<_, _> = fitted.map(|(placement, influence)| (*placement, influence)).collect();
    // Share of the variance between placements in each parameter beyond what the regression accounted for.
    let mut more = DVector::<f64>::zeros(shape.unknowns());
    for (pair, by_mean) in pairs.iter().zip(by_mean) {
        // The regression took the means of the primary as independent of its parameters.
        let all = match fitted.get(&pair.placement) {
            Some(influence) => &by_parameters * *influence - &by_mean,
            None => by_mean.clone(),
        };
        other += &all * placed(pair) * all.transpose() - &by_mean * placed(pair) * by_mean.transpose();
        for (i, more) in more.iter_mut().enumerate() {
            *more += all.row(i).norm_squared() - by_mean.row(i).norm_squared();
        }
    }
    if let Some(origin) = &primary.origin {
        other += &by_parameters * &origin.systematic * by_parameters.transpose();
    }
    if shape == Parameterisation::DIAGONAL {
        // The leaks of the primary turn part of an axis into the next, and the leaks of the secondary turn part of it
        // back.
        for (i, _) in shape.terms().iter().enumerate().filter(|(_, term)| matches!(term, Term::Own(..))) {
            other[(i, i)] += 2.0 * (regression.uncertainty.leak_rms * primary.unmodelled_std).powi(2);
        }
    }
    let other = Other { covariance: other, spread: more.map(|more| more * more * spread) };
    let skewed = primary.shape.unmodelled().next().is_some();
    let inherited_std = if skewed { primary.unmodelled_std } else { primary.inherited_std };
    Ok(Estimate { inherited_std, ..regression.estimate(&other, ALLOWANCE) })
}

#[cfg(test)]
mod tests {
    use super::super::accelerometer::{self, Assumptions, Observation};
    use super::super::{Bounds, Calibration, Estimator, Fixture, Gravity};
    use super::*;

    const G: f64 = 9.80665;

    /// Six exact faces, those that point up with less noise, and a secondary that is turned by up to three degrees.
    #[test]
    fn where_faces_are_not_seen_equally_well_a_mounting_is_no_bias() {
        let bounds = Bounds::default();
        let faces = Fixture::cube();
        let noise = |i: usize| Vector3::repeat([1e-4, 4e-4][i % 2]);
        let observation = |(i, face): (usize, &super::super::Face)| Observation {
            placement: i as u32,
            mean: face.normal * G,
            noise: noise(i) / 100.0,
            normal: face.normal,
        };
        let observations: Vec<_> = faces.faces().iter().enumerate().map(observation).collect();
        let given = Assumptions {
            shape: Parameterisation::DIAGONAL,
            estimator: Estimator::Magnitude,
            gravity: Gravity::configured(G),
            placement_std: 1e-4,
            cross_axis_std: 0.01,
            nonlinearity: 0.0,
            loss: Loss::Square,
            bounds: &bounds,
            start: Calibration::default(),
        };
        let primary = accelerometer::fit(&observations, &given).unwrap();
        let sensitivity = Matrix3::new(0.98, 0.04, -0.03, -0.05, 1.01, 0.02, 0.03, -0.04, 1.02);
        let truth = Calibration { bias: Vector3::new(0.3, -0.2, 0.1), sensitivity };
        let pair = |(i, seen): (usize, &Observation)| Pair {
            placement: seen.placement,
            primary: seen.mean,
            secondary: truth.measure(&seen.mean),
            primary_noise: seen.noise,
            secondary_noise: noise(i),
        };
        let pairs: Vec<_> = observations.iter().enumerate().map(pair).collect();
        let fit = fit(Parameterisation::DIAGONAL, &pairs, &primary, 1e-4, &bounds, Loss::Square).unwrap();
        let off = fit.parameters.fixed_rows::<3>(0) - truth.bias;
        // Least squares without leaks would be off by 0.3 m/s².
        assert!(off.amax() < 0.002, "{off}");
        assert!((fit.calibration().sensitivity.diagonal() - sensitivity.diagonal()).amax() < 5e-4);
        assert!(fit.std(0) < 0.02 && fit.agrees(), "{}", fit.std(0));
    }
}
