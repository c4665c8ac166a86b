//! Information from turns about the accelerometer.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::fit::student_t::NORMAL_95;

/// Entries of the accelerometer's S below the diagonal: row y column x, z x, z y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffDiagonals {
    /// Values of the entries.
    pub value: Vector3<f64>,
    /// Covariance of the entries, stretched so that 1.96 standard deviations are half of a 95 % interval.
    pub covariance: Matrix3<f64>,
}

impl OffDiagonals {
    /// Row and column of each entry.
    pub const ENTRIES: [(usize, usize); 3] = [(1, 0), (2, 0), (2, 1)];

    /// Index of each entry among the nine parameters of the accelerometer.
    pub(super) const PARAMETERS: [usize; 3] = [4, 6, 7];

    /// Half-width of the widest 95 % interval.
    pub fn half_width(&self) -> f64 {
        NORMAL_95 * self.covariance.diagonal().max().max(0.0).sqrt()
    }
}

/// Information from turns about an accelerometer with a lower-triangular S, in the order of its parameters, independent
/// of its rests.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Inverse covariance, reduced by Student's quantile.
    pub information: SMatrix<f64, 9, 9>,
    /// Inverse covariance times the parameters by the turns alone.
    pub moment: SVector<f64, 9>,
}

impl From<&OffDiagonals> for Told {
    /// Converts these entries, without information on the others.
    fn from(entries: &OffDiagonals) -> Self {
        let mut told = Self { information: SMatrix::zeros(), moment: SVector::zeros() };
        let Some(information) = entries.covariance.try_inverse() else { return told };
        let moment = information * entries.value;
        for (i, row) in OffDiagonals::PARAMETERS.into_iter().enumerate() {
            told.moment[row] = moment[i];
            for (j, column) in OffDiagonals::PARAMETERS.into_iter().enumerate() {
                told.information[(row, column)] = information[(i, j)];
            }
        }
        told
    }
}
