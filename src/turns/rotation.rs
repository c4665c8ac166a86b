//! Rotations by rotation vectors.

use nalgebra::{Matrix3, Vector3};

/// Coefficients of the skew matrix and its square in the exponential and in the right Jacobian.
fn coefficients(squared: f64) -> [f64; 3] {
    /// Angle below which the series are exact to the last bit, rad: a piece of a turn is seldom longer.
    const SMALL: f64 = 0.4;
    if squared < SMALL * SMALL {
        // Of sin θ / θ, (1 − cos θ) / θ² and (θ − sin θ) / θ³: each factor is θ² over two successive numbers.
        let series = |first: f64| (0..7).rev().fold(1.0, |sum, k| 1.0 - sum * squared * reciprocal(first, k));
        return [series(2.0), 0.5 * series(3.0), series(4.0) / 6.0];
    }
    let angle = squared.sqrt();
    let (sin, cos) = libm::sincos(angle);
    [sin / angle, (1.0 - cos) / squared, (angle - sin) / (squared * angle)]
}

/// Reciprocal of the product of `first` + 2k and the next number.
#[inline(always)]
fn reciprocal(first: f64, k: u32) -> f64 {
    let n = first + 2.0 * f64::from(k);
    1.0 / (n * (n + 1.0))
}

/// The vector in the axes after a rotation: the rotation matrix, transposed, times it.
pub fn seen_after(vector: &Vector3<f64>, fixed: &Vector3<f64>) -> Vector3<f64> {
    let [first, second, _] = coefficients(vector.norm_squared());
    let across = vector.cross(fixed);
    fixed - across * first + vector.cross(&across) * second
}

/// `one` · I + `skew` · [v]× + `square` · v vᵀ.
fn combination(v: &Vector3<f64>, one: f64, skew: f64, square: f64) -> Matrix3<f64> {
    let (s, q) = (v * skew, v * square);
    Matrix3::new(
        one + q.x * v.x,
        q.x * v.y - s.z,
        q.x * v.z + s.y,
        q.y * v.x + s.z,
        one + q.y * v.y,
        q.y * v.z - s.x,
        q.z * v.x - s.y,
        q.z * v.y + s.x,
        one + q.z * v.z,
    )
}

/// Rotation matrix of a rotation vector, and its right Jacobian: `exp(v + δ) ≈ exp(v) exp(right_jacobian(v) δ)`
/// (Chirikjian, "Stochastic models, information theory, and Lie groups", vol. 2, 2012).
pub fn exp_and_right_jacobian(vector: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let squared = vector.norm_squared();
    let [first, second, third] = coefficients(squared);
    // The square of a skew matrix is v vᵀ − ‖v‖² I.
    let rotation = combination(vector, 1.0 - second * squared, first, second);
    (rotation, combination(vector, 1.0 - third * squared, -second, third))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn exp(vector: &Vector3<f64>) -> Matrix3<f64> {
        exp_and_right_jacobian(vector).0
    }

    fn any_vector(length: f64) -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-length..length).prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn the_exponential_is_the_rotation(vector in prop_oneof![any_vector(3.0), any_vector(0.3), any_vector(0.01), any_vector(1e-5)]) {
            let expected = nalgebra::Rotation3::from_scaled_axis(vector).into_inner();
            prop_assert!((exp(&vector) - expected).amax() < 1e-13);
            let fixed = Vector3::new(0.3, -2.0, 0.7);
            prop_assert!((seen_after(&vector, &fixed) - expected.tr_mul(&fixed)).amax() < 1e-13);
        }

        #[test]
        fn the_right_jacobian_is_the_derivative(vector in any_vector(2.5), step in any_vector(1e-5)) {
            let moved = exp(&(vector + step));
            let (rotation, jacobian) = exp_and_right_jacobian(&vector);
            let expected = rotation * exp(&(jacobian * step));
            prop_assert!((moved - expected).amax() < 1e-9);
        }
    }
}
