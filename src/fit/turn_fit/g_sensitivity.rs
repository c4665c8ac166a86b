//! G-sensitivity of a gyroscope, from its mean rates at rest.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::session::{RestSeen, TurnSession};
use crate::fit::calibration::Calibration;
use crate::fit::student_t::{NORMAL_95, student_95};

/// G-sensitivity of a gyroscope at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct GSensitivity {
    /// Bias without specific force, rad/s.
    pub bias: Vector3<f64>,
    /// Rate for a unit vector along specific force, rad/s.
    pub by_up: Matrix3<f64>,
    /// Covariance of the bias and the row of each axis, stretched as above.
    pub covariance: [SMatrix<f64, 4, 4>; 3],
}

impl GSensitivity {
    /// Regresses the mean rates on direction and time; `None` unless that explains their differences.
    pub(super) fn of(session: &TurnSession, calibration: &Calibration) -> Option<Self> {
        /// Fewest rests, and least ratio of explained squares to those left over.
        const LEAST: usize = 8;
        const CLEAR: f64 = 8.0;
        let count = session.rests.len();
        if count < LEAST {
            return None;
        }
        let middle = session.rests.iter().map(|rest| rest.time).sum::<f64>() / count as f64;
        let span = session.rests.iter().map(|rest| (rest.time - middle).abs()).fold(1.0, f64::max);
        let regressor = |rest: &RestSeen| {
            let up = calibration.correct(&((rest.force[0] + rest.force[1]) / 2.0));
            let up = up.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
            SVector::<f64, 5>::from([1.0, up.x, up.y, up.z, (rest.time - middle) / span])
        };
        let steady = |rest: &RestSeen| rest.rate - rest.rate_taken_off;
        let information: SMatrix<f64, 5, 5> =
            session.rests.iter().map(|rest| regressor(rest) * regressor(rest).transpose()).sum();
        let scaled = information.symmetric_eigenvalues();
        if scaled.min() < 0.05 * count as f64 / 6.0 {
            return None;
        }
        let inverse = information.try_inverse()?;
        let freedom = (count - 5) as f64;
        let mut found = Self { bias: Vector3::zeros(), by_up: Matrix3::zeros(), covariance: [SMatrix::zeros(); 3] };
        let (mut explained, mut left) = (0.0, 0.0);
        for axis in 0..3 {
            let moment: SVector<f64, 5> = session.rests.iter().map(|rest| regressor(rest) * steady(rest)[axis]).sum();
            let line = inverse * moment;
            let mean = session.rests.iter().map(|rest| steady(rest)[axis]).sum::<f64>() / count as f64;
            let noise = session.rests.iter().map(|rest| rest.rate_noise[axis]).sum::<f64>() / count as f64;
            let of = |error: f64| error * error;
            let squares: f64 =
                session.rests.iter().map(|rest| of(steady(rest)[axis] - regressor(rest).dot(&line))).sum();
            let total: f64 = session.rests.iter().map(|rest| of(steady(rest)[axis] - mean)).sum();
            let variance = (squares / freedom).max(noise);
            explained += (total - squares) / variance / 4.0;
            left += 1.0;
            found.bias[axis] = line[0];
            found.by_up.set_row(axis, &line.fixed_rows::<3>(1).transpose());
            let stretch = (student_95(freedom) / NORMAL_95).powi(2);
            found.covariance[axis] = inverse.fixed_view::<4, 4>(0, 0) * (variance * stretch);
        }
        (explained / left > CLEAR).then_some(found)
    }
}
