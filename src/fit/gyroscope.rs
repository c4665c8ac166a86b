//! The gyroscope's bias: the mean of what it reads at rest. It needs no faces, only rests that are no turns.

use nalgebra::{Matrix3, Vector3};

use super::scatter::variance_between;

/// What the gyroscope read during one placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Mean of the raw readings, rad/s.
    pub mean: Vector3<f64>,
    /// Variance of that mean by noise alone, per axis.
    pub noise: Vector3<f64>,
}

/// A bias and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Bias, rad/s.
    pub bias: Vector3<f64>,
    /// Its covariance, all causes included.
    pub covariance: Matrix3<f64>,
    /// Root mean square of the placements about it, rad/s.
    pub residual_rms: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed scatter; `None` for one placement.
    pub chi2_per_dof: Option<f64>,
}

/// Angular rate of the Earth, rad/s (IERS Conventions 2010, nominal mean).
pub const EARTH_RATE: f64 = 7.292_115e-5;

/// The mean over placements that scatter by `assumed_std` (rad/s) until they show otherwise; `None` without any.
pub fn fit(observations: &[Observation], assumed_std: f64) -> Option<Fit> {
    if observations.is_empty() {
        return None;
    }
    let assumed = assumed_std * assumed_std;
    let freedom = (observations.len() - 1) as f64;
    let mut bias = Vector3::zeros();
    let mut covariance = Matrix3::zeros();
    let (mut squares, mut chi2) = (0.0, 0.0);
    for axis in 0..3 {
        let (first, _) = weighted_mean(observations, axis, assumed);
        let residuals = observations.iter().map(|seen| (seen.mean[axis] - first, seen.noise[axis]));
        let between = variance_between(residuals, freedom, assumed_std);
        let (mean, variance) = weighted_mean(observations, axis, between);
        bias[axis] = mean;
        // Which way the Earth turns the sensor is unknown: one component of its rate, in the mean of squares.
        covariance[(axis, axis)] = variance + EARTH_RATE * EARTH_RATE / 3.0;
        let square = |seen: &Observation| (seen.mean[axis] - mean).powi(2);
        squares += observations.iter().map(square).sum::<f64>();
        chi2 += observations.iter().map(|seen| square(seen) / (assumed + seen.noise[axis])).sum::<f64>();
    }
    Some(Fit {
        bias,
        covariance,
        residual_rms: (squares / (3 * observations.len()) as f64).sqrt(),
        chi2_per_dof: (freedom > 0.0).then(|| chi2 / (3.0 * freedom)),
    })
}

/// Mean of one axis weighted by inverse variance, and its variance.
fn weighted_mean(observations: &[Observation], axis: usize, between: f64) -> (f64, f64) {
    let (mut sum, mut weights) = (0.0, 0.0);
    for seen in observations {
        let weight = 1.0 / (between + seen.noise[axis]);
        sum += weight * seen.mean[axis];
        weights += weight;
    }
    (sum / weights, 1.0 / weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bias_is_the_mean_over_placements_not_over_samples() {
        let seen = |x: f64, noise: f64| Observation { mean: Vector3::repeat(x), noise: Vector3::repeat(noise) };
        // A long rest has less noise, but its placement scatters like that of any other.
        let fit = fit(&[seen(0.010, 1e-12), seen(0.012, 1e-8)], 1e-3).unwrap();
        assert!((fit.bias.x - 0.011).abs() < 5e-5, "{}", fit.bias.x);
        assert!(fit.covariance[(0, 0)].sqrt() > 5e-4);
    }

    #[test]
    fn nothing_comes_of_nothing() {
        assert_eq!(fit(&[], 1e-3), None);
    }
}
