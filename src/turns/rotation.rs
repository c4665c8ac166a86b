//! Rotations by rotation vectors.

use nalgebra::{Matrix3, Vector3};

/// Coefficients of the skew matrix and its square in the exponential and in the right Jacobian.
fn coefficients(squared: f64) -> [f64; 3] {
    /// Angle below which the series are exact to the last bit, rad.
    const SMALL: f64 = 1e-2;
    if squared < SMALL * SMALL {
        let t = squared;
        return [
            1.0 - t / 6.0 * (1.0 - t / 20.0 * (1.0 - t / 42.0)),
            0.5 - t / 24.0 * (1.0 - t / 30.0 * (1.0 - t / 56.0)),
            1.0 / 6.0 - t / 120.0 * (1.0 - t / 42.0 * (1.0 - t / 72.0)),
        ];
    }
    let angle = squared.sqrt();
    let (sin, cos) = libm::sincos(angle);
    [sin / angle, (1.0 - cos) / squared, (angle - sin) / (squared * angle)]
}

/// Rotation matrix of a rotation vector, rad.
pub fn exp(vector: &Vector3<f64>) -> Matrix3<f64> {
    exp_and_right_jacobian(vector).0
}

/// Right Jacobian: `exp(v + δ) ≈ exp(v) exp(right_jacobian(v) δ)` (Chirikjian, "Stochastic models, information theory,
/// and Lie groups", vol. 2, 2012).
pub fn right_jacobian(vector: &Vector3<f64>) -> Matrix3<f64> {
    exp_and_right_jacobian(vector).1
}

/// Rotation matrix and right Jacobian of a rotation vector.
pub fn exp_and_right_jacobian(vector: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let [first, second, third] = coefficients(vector.norm_squared());
    let skew = vector.cross_matrix();
    let square = skew * skew;
    let one = Matrix3::identity();
    (one + skew * first + square * second, one - skew * second + square * third)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn any_vector(length: f64) -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-length..length).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn the_exponential_is_the_rotation(vector in prop_oneof![any_vector(3.0), any_vector(0.01), any_vector(1e-5)]) {
            let expected = nalgebra::Rotation3::from_scaled_axis(vector).into_inner();
            prop_assert!((exp(&vector) - expected).amax() < 1e-13);
        }

        #[test]
        fn the_right_jacobian_is_the_derivative(vector in any_vector(2.5), step in any_vector(1e-5)) {
            let moved = exp(&(vector + step));
            let expected = exp(&vector) * exp(&(right_jacobian(&vector) * step));
            prop_assert!((moved - expected).amax() < 1e-9);
        }
    }
}
