//! Full sensitivity of the primary accelerometer, from placements whose directions an accurate fixture knows (the
//! thesis' simplified model 1).

use nalgebra::{DMatrix, Matrix3, MatrixXx3, Vector3};

use super::accelerometer::{Assumptions, Observation};
use super::error::Error;
use super::estimate::{Estimate, Origin};
use super::linear_system::limits;
use super::parameterisation::{Parameterisation, Truth};
use super::placement_scatter::Assumed;
use super::regression::{Reading, regress};
use super::uncertainty::Sharing;

/// Residuals below this never make a fit disagree, m/s².
const ALLOWANCE: f64 = 0.03;

/// Regresses the observations on the directions of their faces. Each may be off by `accuracy` (radians, standard
/// deviation about each axis across it), the same whenever the IMU rests on it.
///
/// # Errors
/// If the placements do not determine the parameters, or the solver fails.
pub fn fit(observations: &[Observation], given: &Assumptions<'_>, accuracy: f64) -> Result<Estimate, Error> {
    let off = (given.gravity.value * accuracy).powi(2);
    let reading = |seen: &Observation| Reading {
        mean: seen.mean,
        noise: seen.noise,
        truth: Truth::of(seen.normal * given.gravity.value),
        truth_noise: across(&seen.normal) * off,
    };
    let readings: Vec<_> = observations.iter().map(reading).collect();
    let shape = Parameterisation::MATRIX;
    let bounds = limits(shape, |term| given.bounds.accelerometer(term));
    let assumed = Assumed { placement: given.placement_std, leak: 0.0 };
    let regression = regress(shape, &readings, assumed, Sharing::ByAxis, &bounds, given.loss)?;

    // The regression took the direction errors as independent between placements. But the error of a face is the same
    // whenever the IMU rests on it, so the effects of its placements add up.
    let solved = &regression.solved;
    let sensitivity = shape.calibration(&solved.solution.x).sensitivity;
    let influence: Vec<_> = solved.influence(&regression.gain).collect();
    let mut faces: Vec<(Vector3<f64>, MatrixXx3<f64>)> = Vec::new();
    let mut other = DMatrix::zeros(shape.unknowns(), shape.unknowns());
    for (axes, (seen, reading)) in influence.chunks_exact(3).zip(observations.iter().zip(&readings)) {
        let by_mean = &axes[0] + &axes[1] + &axes[2];
        let own = (sensitivity * reading.truth_noise * sensitivity.transpose()).diagonal();
        other -= &by_mean * Matrix3::from_diagonal(&own) * by_mean.transpose();
        match faces.iter_mut().find(|(known, _)| *known == seen.normal) {
            Some((_, by_face)) => *by_face += by_mean,
            None => faces.push((seen.normal, by_mean)),
        }
    }
    for (normal, by_face) in faces {
        let moved = by_face * sensitivity * across(&normal);
        other += &moved * moved.transpose() * off;
    }
    let mut by_gravity = solved.solution.x.clone() / given.gravity.value;
    by_gravity.fixed_rows_mut::<3>(0).fill(0.0);
    other += &by_gravity * by_gravity.transpose() * given.gravity.std.powi(2);
    let between = regression.uncertainty.between_placements();
    let estimate = regression.estimate(&other.into(), ALLOWANCE);
    let origin = Origin { systematic: estimate.covariance.clone(), influence: Vec::new(), between };
    Ok(Estimate { origin: Some(origin), ..estimate })
}

/// Projection onto the plane perpendicular to a direction.
fn across(normal: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() - normal * normal.transpose()
}
