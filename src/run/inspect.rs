//! Contents of a recording, for people: its topics, its findings, and the original in an annotated one.

mod findings;
mod look;
mod rate;
mod report_data;
mod strip;
pub(crate) mod topics;

pub use findings::{Found, findings};
pub use report_data::{ReportData, report_data};
pub use strip::strip;
pub use topics::{Channels, Use, channels};
