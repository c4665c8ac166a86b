//! Calibration of the gyroscope from its readings at rest: its bias and, where specific force is known, its
//! g-sensitivity. Needs no faces, only rests.

use nalgebra::{DMatrix, DVector};

use super::bound::Bounds;
use super::config::Loss;
use super::error::Error;
use super::estimate::Estimate;
use super::gravity::EARTH_RATE;
use super::linear_system::limits;
use super::parameterisation::{Parameterisation, Truth};
use super::placement_scatter::Assumed;
use super::regression::{Reading, Regression, regress};
use super::uncertainty::Sharing;

/// Regresses readings on the specific forces (m/s²) that their truths hold as the other quantity. Placements scatter by
/// `assumed_std` (rad/s) until they show otherwise.
///
/// # Errors
/// If the placements do not determine the parameters, or the solver fails.
pub fn fit(
    shape: Parameterisation,
    readings: &[Reading],
    assumed_std: f64,
    bounds: &Bounds,
    loss: Loss,
) -> Result<Estimate, Error> {
    let assumed = Assumed { placement: assumed_std, leak: 0.0 };
    let limits = limits(shape, |term| bounds.gyroscope(term));
    let regression = regress(shape, readings, assumed, Sharing::ByAxis, &limits, loss)?;
    let other = by_earth(shape, readings, &regression);
    Ok(regression.estimate(&other.into(), f64::INFINITY))
}

/// Variance of each parameter from the part of the Earth's rotation that is not known, since north is not. The vertical
/// component turns every placement alike, and is known where the latitude is. The horizontal component may point the
/// same way in the sensor frame at every placement, so that it never averages out. Without even the vertical component,
/// all of the rotation may point anywhere.
fn by_earth(shape: Parameterisation, readings: &[Reading], regression: &Regression) -> DMatrix<f64> {
    let influence: Vec<_> = regression.solved.influence(&regression.gain).collect();
    let (mut along, mut across) = (DVector::zeros(shape.unknowns()), DVector::<f64>::zeros(shape.unknowns()));
    for (axes, reading) in influence.chunks_exact(3).zip(readings) {
        let by_mean = &axes[0] + &axes[1] + &axes[2];
        let Truth { own: known, other: force } = reading.truth;
        let of_direction = EARTH_RATE / 3_f64.sqrt();
        let vertical = known.try_normalize(0.0).or(force.try_normalize(f64::MIN_POSITIVE)).unwrap_or_default();
        let (upright, level) = match known.norm_squared() {
            0.0 => (of_direction, of_direction),
            known => (0.0, ((EARTH_RATE * EARTH_RATE - known).max(0.0) / 2.0).sqrt()),
        };
        let by_vertical = &by_mean * vertical;
        for (i, row) in by_mean.row_iter().enumerate() {
            across[i] += level * (row.norm_squared() - by_vertical[i].powi(2)).max(0.0).sqrt();
        }
        along += by_vertical * upright;
    }
    DMatrix::from_diagonal(&along.zip_map(&across, |along: f64, across| along * along + across * across))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    fn seen(mean: Vector3<f64>, force: Vector3<f64>, noise: f64) -> Reading {
        let truth = Truth { own: Vector3::zeros(), other: force };
        Reading { mean, noise: Vector3::repeat(noise), truth, truth_noise: Matrix3::zeros() }
    }

    #[test]
    fn the_bias_is_the_mean_over_placements_not_over_samples() {
        let seen = |x: f64, noise: f64| seen(Vector3::repeat(x), Vector3::zeros(), noise);
        // A long rest has less noise, but its placement scatters like that of any other.
        let fit = fit(
            Parameterisation::BIAS,
            &[seen(0.010, 1e-12), seen(0.012, 1e-8)],
            1e-3,
            &Bounds::default(),
            Loss::Square,
        )
        .unwrap();
        assert!((fit.parameters[0] - 0.011).abs() < 5e-5, "{}", fit.parameters[0]);
        assert!(fit.std(0) > 5e-4);
    }

    #[test]
    fn nothing_comes_of_nothing() {
        assert!(fit(Parameterisation::BIAS, &[], 1e-3, &Bounds::default(), Loss::Square).is_err());
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
        let shape = Parameterisation::GYROSCOPE_AT_REST;
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
        let learn =
            |known| fit(Parameterisation::BIAS, &[reading(known); 3], 1e-6, &Bounds::default(), Loss::Square).unwrap();
        let (known, unknown) = (learn(turning), learn(Vector3::zeros()));
        assert!((known.parameters.fixed_rows::<3>(0) - bias).amax() < 1e-12);
        assert!((unknown.parameters[2] - bias.z).abs() > 6e-5);
        // What is left lies across the vertical.
        assert!(known.std(2) < known.std(0) && known.std(0) < unknown.std(0) && unknown.std(2) > 4e-5);
    }

    #[test]
    fn what_the_earth_adds_about_the_vertical_averages_out_over_opposite_faces() {
        let faces = crate::fit::Fixture::cube();
        let readings: Vec<_> =
            faces.faces().iter().map(|face| seen(Vector3::zeros(), face.normal * 9.8, 1e-14)).collect();
        let learn = |readings: &[Reading]| {
            fit(Parameterisation::BIAS, readings, 1e-7, &Bounds::default(), Loss::Square).unwrap().std(2)
        };
        let anywhere = EARTH_RATE / 3_f64.sqrt();
        // Of six faces an axis lies level on four, all of which may face the same way.
        assert!((learn(&readings) / anywhere - 2.0 / 3.0).abs() < 0.01, "{}", learn(&readings) / anywhere);
        assert!((learn(&readings[4..5]) / anywhere - 1.0).abs() < 0.01);
    }
}
