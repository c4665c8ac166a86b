//! Running mean and covariance of vectors by Welford's update, exact to rounding at any offset.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Count, mean and scatter of vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    count: u64,
    /// Share of one vector in the mean: one division serves everything that is averaged beside it.
    share: f64,
    mean: Vector3<f64>,
    /// Scatter matrix Σ (x − mean)(x − mean)ᵀ.
    scatter: Matrix3<f64>,
}

impl Moments {
    /// Adds one vector (Welford 1962).
    pub fn push(&mut self, value: &Vector3<f64>) {
        self.count += 1;
        self.share = 1.0 / self.count as f64;
        let before = value - self.mean;
        self.mean += before * self.share;
        self.scatter += before * (value - self.mean).transpose();
    }

    /// Number of vectors.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Reciprocal of the number of vectors, zero if there are none.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Mean of the vectors, zero if there are none.
    pub fn mean(&self) -> Vector3<f64> {
        self.mean
    }

    /// Sample covariance of the vectors (divisor n − 1), zero for fewer than two.
    pub fn covariance(&self) -> Matrix3<f64> {
        if self.count < 2 { Matrix3::zeros() } else { self.scatter / (self.count - 1) as f64 }
    }

    /// Sum of the sample variances of the axes.
    pub fn variance(&self) -> f64 {
        if self.count < 2 { 0.0 } else { self.scatter.trace() / (self.count - 1) as f64 }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn vectors() -> impl Strategy<Value = Vec<Vector3<f64>>> {
        proptest::collection::vec((-10.0..10.0, -10.0..10.0, 990.0..1010.0), 0..60)
            .prop_map(|rows| rows.into_iter().map(|(x, y, z): (f64, f64, f64)| Vector3::new(x, y, z)).collect())
    }

    fn moments(values: &[Vector3<f64>]) -> Moments {
        let mut moments = Moments::default();
        values.iter().for_each(|v| moments.push(v));
        moments
    }

    proptest! {
        #[test]
        fn covariance_equals_the_textbook_formula(a in vectors()) {
            prop_assume!(a.len() > 1);
            let mean = a.iter().sum::<Vector3<f64>>() / a.len() as f64;
            let covariance: Matrix3<f64> =
                a.iter().map(|v| (v - mean) * (v - mean).transpose()).sum::<Matrix3<f64>>() / (a.len() - 1) as f64;
            prop_assert!((moments(&a).covariance() - covariance).norm() < 1e-9);
        }
    }
}
