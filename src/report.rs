//! What was learned, for people and for the programs they use: findings, reports, and the formats that others read.
//!
//! Pure like the layers beneath: text and numbers in, text out. Files are left to the [shell](crate::run), what people
//! read on a terminal to the program.

mod drift;
mod envelope;
mod export;
mod findings;
mod import;
mod json;
mod layout;
mod page;
mod parameters;
mod plot;
mod timeline;
mod words;
pub(crate) mod yaml;

pub use drift::{Change, Drift, drift, same};
pub use envelope::{Envelope, Range};
pub use export::{Axes, ExportError, Exported, Format, Options, RandomWalk, Readings, export};
pub use findings::Findings;
pub use import::{ImportError, import};
pub use json::{coverage, drifts, imus, rests, triad};
pub use layout::{LayoutImu, layout, quoted};
pub use page::Page;
pub use parameters::Parameters;
pub use timeline::Timeline;
pub use words::{estimate, model};

use nalgebra::{Matrix3, Vector3};

use crate::Stamp;
use crate::fit::Calibration;
use crate::messages::triad::Status;
use crate::messages::{self, Segment, Triad};

/// Bias and sensitivity of a triad, if they are determined. A sensitivity that was not estimated is the identity.
pub fn calibration(triad: &Triad) -> Option<Calibration> {
    let bias = triad.bias.as_ref().filter(|_| triad.status() != Status::Undetermined)?;
    let sensitivity = matrix(&triad.sensitivity).unwrap_or_else(Matrix3::identity);
    Some(Calibration { bias: vector(bias), sensitivity })
}

/// The nine numbers of a row-major matrix; `None` if it was not estimated.
fn matrix(row_major: &[f64]) -> Option<Matrix3<f64>> {
    (row_major.len() == 9).then(|| Matrix3::from_row_slice(row_major))
}

fn vector(v: &messages::Vector3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn row_major(matrix: &Matrix3<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// Seconds from `origin` to a stamp of a message.
pub fn seconds(stamp: &Option<prost_types::Timestamp>, origin: Stamp) -> f64 {
    Stamp::from_nanos(nanos(stamp)).seconds_since(origin)
}

/// How long a rest lasted, in seconds.
pub fn length(rest: &Segment) -> f64 {
    seconds(&rest.end, Stamp::from_nanos(nanos(&rest.start)))
}

/// Nanoseconds since the epoch; 0 for no stamp, and saturating.
fn nanos(stamp: &Option<prost_types::Timestamp>) -> i64 {
    let nanos = |t: &prost_types::Timestamp| t.seconds.saturating_mul(1_000_000_000).saturating_add(t.nanos.into());
    stamp.as_ref().map_or(0, nanos)
}
