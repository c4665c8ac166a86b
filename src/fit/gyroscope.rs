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
    let up = readings.iter().map(|reading| reading.truth.other.norm()).fold(0.0, f64::max).max(1.0);
    let count = readings.len().max(1) as f64;
    let unknown =
        |part: fn(&Reading, usize) -> f64, axis| readings.iter().map(|seen| part(seen, axis)).sum::<f64>() / count;
    for (i, term) in shape.terms().iter().enumerate() {
        // However often the IMU is placed, it may face the same way. What the Earth does about the vertical looks like
        // sensitivity to gravity, what it does across like that to gravity on another axis.
        other[(i, i)] = match *term {
            Term::Bias(axis) => unknown(earth, axis),
            Term::Other(row, column) if row == column => unknown(vertical, row) / (up * up),
            Term::Other(row, _) => 0.5 * unknown(earth, row) / (up * up),
            _ => 0.0,
        };
    }
    Ok(regression.estimate(&other, f64::INFINITY))
}

/// Variance of what the Earth adds to an axis beyond the true rate that is known. Of that about the vertical the rest lies
/// across it, in any direction; where none is known, all of it may lie anywhere.
fn earth(reading: &Reading, axis: usize) -> f64 {
    let known = reading.truth.own.norm_squared();
    if known == 0.0 {
        return EARTH_RATE * EARTH_RATE / 3.0;
    }
    let along = reading.truth.own[axis].powi(2) / known;
    (EARTH_RATE * EARTH_RATE - known).max(0.0) / 2.0 * (1.0 - along)
}

/// The same about the vertical alone.
fn vertical(reading: &Reading, _: usize) -> f64 {
    if reading.truth.own.norm_squared() == 0.0 { EARTH_RATE * EARTH_RATE / 3.0 } else { 0.0 }
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

    #[test]
    fn what_the_earth_is_known_to_add_is_no_bias() {
        let bias = Vector3::new(0.01, -0.02, 0.005);
        let turning = Vector3::z() * (0.9 * EARTH_RATE);
        let reading = |known: Vector3<f64>| Reading {
            truth: Truth { own: known, ..Truth::default() },
            ..seen(bias + turning, Vector3::zeros(), 1e-14)
        };
        let learn = |known| fit(Shape::BIAS, &[reading(known); 3], 1e-6, &Bounds::default(), Loss::Square).unwrap();
        let (known, unknown) = (learn(turning), learn(Vector3::zeros()));
        assert!((known.parameters.fixed_rows::<3>(0) - bias).amax() < 1e-12);
        assert!((unknown.parameters[2] - bias.z).abs() > 6e-5);
        // What is left lies across the vertical.
        assert!(known.std(2) < known.std(0) && known.std(0) < unknown.std(0) && unknown.std(2) > 4e-5);
    }
}
