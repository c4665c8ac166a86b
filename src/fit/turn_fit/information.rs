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

impl Told {
    /// Allows for biases that differ between the turns and the lengths of readings by this standard deviation, m/s²: a
    /// quadratic nonlinearity adds to the reading along the vertical alone.
    pub(in crate::fit) fn allowing_for(&self, bias_std: f64) -> Self {
        // (I⁻¹ + U V Uᵀ)⁻¹ = I − I U (V⁻¹ + Uᵀ I U)⁻¹ Uᵀ I, which exists for a singular I, too (Woodbury 1950).
        let of_biases = self.information.fixed_view::<3, 3>(0, 0) + Matrix3::identity() / bias_std.powi(2);
        let Some(inverse) = of_biases.try_inverse() else { return self.clone() };
        let taken = self.information.fixed_columns::<3>(0) * inverse;
        let information = self.information - taken * self.information.fixed_rows::<3>(0);
        let moment = self.moment - taken * self.moment.fixed_rows::<3>(0);
        Self { information, moment }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_allowed_for_adds_to_the_covariance_and_leaves_the_values() {
        let root = SMatrix::<f64, 9, 9>::from_fn(|i, j| if i == j { 3.0 } else { ((i * 7 + j * 3) % 5) as f64 * 0.2 });
        let value = SVector::<f64, 9>::from_fn(|i, _| i as f64 - 4.0);
        let information = root * root.transpose();
        let allowed = Told { information, moment: information * value }.allowing_for(0.5);
        let covariance = allowed.information.try_inverse().unwrap();
        let mut expected = information.try_inverse().unwrap();
        (0..3).for_each(|i| expected[(i, i)] += 0.25);
        assert!((covariance - expected).amax() < 1e-12);
        assert!((covariance * allowed.moment - value).amax() < 1e-12);
    }
}
