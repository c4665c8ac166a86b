//! Initial guess of an accelerometer's calibration, good enough to determine which way up each rest was.

use nalgebra::Vector3;

use super::calibration::Calibration;

/// Guesses from raw means at rest (m/s²) and the magnitude of gravity.
///
/// With a large bias the raw mean points the wrong way (on one real MPU-9250, in 17 of 40 rests). Once both faces of an
/// axis were seen, its bias is the middle of its range; until then, the smallest bias that explains the readings.
pub fn guess<'a>(means: impl Iterator<Item = &'a Vector3<f64>> + Clone, gravity: f64) -> Calibration {
    let mut guess = Calibration::default();
    for axis in 0..3 {
        let values = means.clone().map(|mean| mean[axis]);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            continue;
        }
        let (middle, range) = ((low + high) / 2.0, high - low);
        if range > 1.5 * gravity {
            guess.bias[axis] = middle;
            guess.sensitivity[(axis, axis)] = range / (2.0 * gravity);
        } else {
            // Every reading lies within 1 g of the bias: the value nearest to zero that allows it.
            guess.bias[axis] = 0.0_f64.clamp(high - gravity, low + gravity);
        }
    }
    guess
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.80665;

    #[test]
    fn a_bias_of_half_a_g_does_not_hide_the_faces() {
        let truth = Vector3::new(4.1, -4.9, 7.9);
        let faces = [Vector3::x(), Vector3::y(), Vector3::z()];
        let means: Vec<_> = faces.iter().flat_map(|n| [truth + n * G, truth - n * G]).collect();
        let guess = guess(means.iter(), G);
        assert!((guess.bias - truth).norm() < 1e-9);
        assert!((guess.sensitivity - nalgebra::Matrix3::identity()).norm() < 1e-9);
    }

    #[test]
    fn one_small_reading_needs_no_bias() {
        let guess = guess([Vector3::new(0.3, -0.2, 9.9)].iter(), G);
        assert_eq!(guess.bias.xy(), Vector3::zeros().xy());
        assert!(guess.bias.z.abs() < 0.1);
    }
}
