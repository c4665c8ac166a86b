//! A secondary accelerometer's calibration: regression, axis by axis, on the calibrated primary over all rests, tilted
//! ones included, since both feel the same gravity whatever its direction.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::accelerometer;
use super::calibration::{Calibration, Shape};
use super::config::Bounds;
use super::lsqlin::{self, lsqlin};
use super::scatter::variance_between;

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

/// A secondary's calibration and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Bias and diagonal sensitivity.
    pub calibration: Calibration,
    /// Of the parameters in the order of [`Shape::DIAGONAL`], the primary's uncertainty included.
    pub covariance: DMatrix<f64>,
    /// Root mean square of the residuals of all axes, m/s².
    pub residual_rms: f64,
    /// The greatest rms that noise or the gate's allowance excuse, m/s².
    pub residual_limit: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed scatter; `None` without redundancy.
    pub chi2_per_dof: Option<f64>,
    /// Largest condition number of the three regressions.
    pub condition: f64,
    /// Parameters held back by a bound.
    pub active: Vec<usize>,
}

/// Residuals below this are no reason to refuse, m/s².
const ALLOWANCE: f64 = 0.05;

impl Fit {
    /// Whether the secondary felt what the primary felt.
    pub fn agrees(&self) -> bool {
        self.residual_rms <= self.residual_limit
    }
}

impl Pair {
    /// Variance of the secondary's residual by the noise of both, for one axis of a given scale.
    fn noise(&self, axis: usize, scale: f64, inverse: &Matrix3<f64>) -> f64 {
        let row = inverse.row(axis).transpose();
        self.secondary_noise[axis] + scale * scale * row.component_mul(&row).dot(&self.primary_noise)
    }
}

/// Regresses the secondary on the primary as `primary` calibrates it.
///
/// # Errors
/// If the rests do not determine an axis, or the solver fails.
pub fn fit(
    pairs: &[Pair],
    primary: &accelerometer::Fit,
    assumed_std: f64,
    bounds: &Bounds,
) -> Result<Fit, lsqlin::Error> {
    let truths: Vec<_> = pairs.iter().map(|pair| primary.calibration.correct(&pair.primary)).collect();
    let inverse = primary.calibration.inverse();
    let unknowns = Shape::DIAGONAL.unknowns();
    let mut parameters = DVector::zeros(unknowns);
    let mut covariance = DMatrix::zeros(unknowns, unknowns);
    // ∂parameters/∂(the primary's parameters).
    let mut by_primary = DMatrix::zeros(unknowns, primary.shape.unknowns());
    let (mut squares, mut white, mut chi2, mut condition, mut active) = (0.0, 0.0, 0.0, 0.0_f64, Vec::new());
    let freedom = pairs.len().saturating_sub(2);

    for axis in 0..3 {
        let line = |between: f64, scale: f64| {
            let noise: Vec<f64> = pairs.iter().map(|pair| pair.noise(axis, scale, &inverse)).collect();
            regress(pairs, &truths, axis, noise, between, bounds)
        };
        // The scale and the scatter that the first regression shows set the weights of the second.
        let first = line(assumed_std * assumed_std, 1.0)?;
        let residuals = first.residuals.iter().copied().zip(first.noise.iter().copied());
        let between = variance_between(residuals, freedom as f64, assumed_std);
        let line = line(between, first.scale)?;

        let (b, s) = (axis, 3 + axis);
        (parameters[b], parameters[s]) = (line.bias, line.scale);
        for (i, p) in [b, s].into_iter().enumerate() {
            for (j, q) in [b, s].into_iter().enumerate() {
                covariance[(p, q)] = line.covariance[(i, j)];
            }
            // A regressor that moves by δ moves the solution like a reading that moves by −scale · δ.
            for (r, truth) in truths.iter().enumerate() {
                let by_parameters = -(inverse * primary.shape.jacobian(truth));
                let gain = -line.scale * line.gain[(i, r)];
                let mut row = by_primary.row_mut(p);
                row += by_parameters.row(axis) * gain;
            }
        }
        squares += line.residuals.iter().map(|r| r * r).sum::<f64>();
        white += line.noise.iter().sum::<f64>();
        let assumed = assumed_std * assumed_std;
        chi2 += line.residuals.iter().zip(&line.noise).map(|(r, v)| r * r / (assumed + v)).sum::<f64>();
        condition = condition.max(line.condition);
        active.extend(line.active.iter().map(|i| if *i == 0 { b } else { s }));
    }
    covariance += &by_primary * &primary.covariance * by_primary.transpose();
    Ok(Fit {
        calibration: Shape::DIAGONAL.calibration(&parameters),
        covariance,
        residual_rms: (squares / (3 * pairs.len().max(1)) as f64).sqrt(),
        residual_limit: (5.0 * (white / (3 * pairs.len().max(1)) as f64).sqrt()).max(ALLOWANCE),
        chi2_per_dof: (freedom > 0).then(|| chi2 / (3 * freedom) as f64),
        condition,
        active,
    })
}

/// One axis: secondary = bias + scale · truth.
struct Regression {
    bias: f64,
    scale: f64,
    covariance: DMatrix<f64>,
    /// ∂(bias, scale)/∂reading, 2 × rests.
    gain: DMatrix<f64>,
    residuals: Vec<f64>,
    /// Their variances by noise alone.
    noise: Vec<f64>,
    condition: f64,
    active: Vec<usize>,
}

fn regress(
    pairs: &[Pair],
    truths: &[Vector3<f64>],
    axis: usize,
    noise: Vec<f64>,
    between: f64,
    bounds: &Bounds,
) -> Result<Regression, lsqlin::Error> {
    if pairs.len() < 2 {
        return Err(lsqlin::Error::Singular(f64::INFINITY));
    }
    let weight = DVector::from_iterator(pairs.len(), noise.iter().map(|v| 1.0 / (between + v).sqrt()));
    let design = DMatrix::from_fn(pairs.len(), 2, |r, c| if c == 0 { weight[r] } else { truths[r][axis] * weight[r] });
    let target = DVector::from_fn(pairs.len(), |r, _| pairs[r].secondary[axis] * weight[r]);
    let Bounds { secondary_bias: bias, secondary_scale: scale, .. } = bounds;
    let limit = |side: usize| DVector::from_vec(vec![bias[side], scale[side]]);
    let solution = lsqlin(&design, &target, &limit(0), &limit(1))?;
    let covariance = design.tr_mul(&design).try_inverse().ok_or(lsqlin::Error::Singular(solution.condition))?;
    let gain = &covariance * design.transpose() * DMatrix::from_diagonal(&weight);
    let (bias, scale) = (solution.x[0], solution.x[1]);
    let residuals =
        pairs.iter().zip(truths).map(|(pair, truth)| pair.secondary[axis] - bias - scale * truth[axis]).collect();
    Ok(Regression {
        bias,
        scale,
        covariance,
        gain,
        residuals,
        noise,
        condition: solution.condition,
        active: solution.active,
    })
}
