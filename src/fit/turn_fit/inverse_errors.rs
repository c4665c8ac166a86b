//! Errors of the sensitivity S from those of its inverse C.

use nalgebra::{Matrix3, SMatrix};

use super::equations::Square;

/// Derivatives of the entries of S with respect to those of C, row by row: δS = −S δC S.
pub(super) fn by_inverse(sensitivity: &Matrix3<f64>) -> SMatrix<f64, 9, 9> {
    SMatrix::from_fn(|entry, k| -sensitivity[(entry / 3, k / 3)] * sensitivity[(k % 3, entry % 3)])
}

/// Covariance of S from that of C.
pub(super) fn of_sensitivity(sensitivity: &Matrix3<f64>, covariance: &Square) -> SMatrix<f64, 9, 9> {
    let by = by_inverse(sensitivity);
    by * covariance.fixed_view::<9, 9>(0, 0) * by.transpose()
}
