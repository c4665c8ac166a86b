//! Numbers and times from messages.

use nalgebra::{Matrix3, Vector3};

use crate::Stamp;
use crate::fit::Calibration;
use crate::messages::triad::Status;
use crate::messages::{self, Segment, Triad};

/// Bias and sensitivity of a triad, if determined. A sensitivity that was not estimated is the identity.
pub fn calibration(triad: &Triad) -> Option<Calibration> {
    let bias = triad.bias.as_ref().filter(|_| triad.status() != Status::Undetermined)?;
    let sensitivity = matrix(&triad.sensitivity).unwrap_or_else(Matrix3::identity);
    Some(Calibration { bias: vector(bias), sensitivity })
}

/// Matrix from its nine row-major numbers; `None` if it was not estimated.
pub(crate) fn matrix(row_major: &[f64]) -> Option<Matrix3<f64>> {
    (row_major.len() == 9).then(|| Matrix3::from_row_slice(row_major))
}

pub(crate) fn vector(v: &messages::Vector3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

pub(crate) fn row_major(matrix: &Matrix3<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// Seconds from `origin` to a stamp of a message.
pub fn seconds(stamp: &Option<prost_types::Timestamp>, origin: Stamp) -> f64 {
    Stamp::from_nanos(nanos(stamp)).seconds_since(origin)
}

/// Length of a rest, in seconds.
pub fn length(rest: &Segment) -> f64 {
    seconds(&rest.end, Stamp::from_nanos(nanos(&rest.start)))
}

/// Nanoseconds since the epoch, saturating; 0 without a stamp.
pub fn nanos(stamp: &Option<prost_types::Timestamp>) -> i64 {
    let nanos = |t: &prost_types::Timestamp| t.seconds.saturating_mul(1_000_000_000).saturating_add(t.nanos.into());
    stamp.as_ref().map_or(0, nanos)
}
