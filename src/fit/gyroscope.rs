//! The gyroscope from what it reads at rest: its bias, and, where specific force is known, what it makes of that. It needs
//! no faces, only rests that are no turns.

use nalgebra::DMatrix;

use super::bars::Sharing;
use super::bound::Bounds;
use super::config::Loss;
use super::estimate::Estimate;
use super::gravity::EARTH_RATE;
use super::lsqlin;
use super::regression::{Reading, regress};
use super::scatter::Assumed;
use super::shape::{Shape, Term};
use super::system::limits;

/// Regresses placements that scatter by `assumed_std` (rad/s) until they show otherwise on the specific forces (m/s²) that
/// their truths hold as the other quantity.
///
/// # Errors
/// If the placements do not determine the parameters, or the solver fails.
pub fn fit(
    shape: Shape,
    readings: &[Reading],
    assumed_std: f64,
    bounds: &Bounds,
    loss: Loss,
) -> Result<Estimate, lsqlin::Error> {
    let assumed = Assumed { placement: assumed_std, leak: 0.0 };
    let limits = limits(shape, |term| bounds.gyroscope(term));
    let regression = regress(shape, readings, assumed, Sharing::ByAxis, &limits, loss)?;
    let mut other = DMatrix::zeros(shape.unknowns(), shape.unknowns());
    let up = readings.iter().map(|reading| reading.truth.other.norm()).fold(0.0, f64::max);
    for (i, term) in shape.terms().iter().enumerate() {
        // Which way the Earth turns the sensor is unknown: one component of its rate, in the mean of squares. That about
        // the vertical looks like sensitivity to gravity.
        other[(i, i)] = match *term {
            Term::Bias(_) => EARTH_RATE * EARTH_RATE / 3.0,
            Term::Other(row, column) if row == column => (EARTH_RATE / up.max(1.0)).powi(2) / 3.0,
            _ => 0.0,
        };
    }
    Ok(regression.estimate(&other, f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::fit::shape::Truth;

    fn seen(mean: Vector3<f64>, force: Vector3<f64>, noise: f64) -> Reading {
        let truth = Truth { own: Vector3::zeros(), other: force };
        Reading { mean, noise: Vector3::repeat(noise), truth, truth_noise: Matrix3::zeros() }
    }

    #[test]
    fn the_bias_is_the_mean_over_placements_not_over_samples() {
        let seen = |x: f64, noise: f64| seen(Vector3::repeat(x), Vector3::zeros(), noise);
        // A long rest has less noise, but its placement scatters like that of any other.
        let fit =
            fit(Shape::BIAS, &[seen(0.010, 1e-12), seen(0.012, 1e-8)], 1e-3, &Bounds::default(), Loss::Square).unwrap();
        assert!((fit.parameters[0] - 0.011).abs() < 5e-5, "{}", fit.parameters[0]);
        assert!(fit.std(0) > 5e-4);
    }

    #[test]
    fn nothing_comes_of_nothing() {
        assert!(fit(Shape::BIAS, &[], 1e-3, &Bounds::default(), Loss::Square).is_err());
    }

    #[test]
    fn six_exact_faces_determine_what_it_makes_of_gravity() {
        let bias = Vector3::new(0.01, -0.02, 0.005);
        let cross = Matrix3::new(1e-4, 2e-4, -1e-4, 3e-4, -2e-4, 1e-4, 0.0, 1e-4, 2e-4);
        let squares = Vector3::new(1e-5, -2e-5, 3e-5);
        let readings: Vec<_> = crate::fit::Fixture::cube()
            .faces()
            .iter()
            .map(|face| {
                let force = face.normal * 9.8;
                seen(bias + cross * force + squares.component_mul(&force.component_mul(&force)), force, 1e-10)
            })
            .collect();
        let shape = Shape::GYROSCOPE_AT_REST;
        let fit = fit(shape, &readings, 1e-4, &Bounds::default(), Loss::Square).unwrap();
        assert!(fit.condition < 2.5, "{}", fit.condition);
        assert!((fit.calibration().bias - bias).amax() < 1e-12);
        assert!((shape.cross(&fit.parameters).unwrap() - cross).amax() < 1e-12);
        assert!((shape.squares(&fit.parameters).unwrap() - squares).amax() < 1e-12);
    }
}
