//! Scan events in, annotation blocks and findings out: a recording's messages through [`imu`](crate::imu),
//! [`engine`](crate::engine) and [`annotate`](crate::annotate), the same for batch, tail and whatever else reads one.

pub(crate) mod channel_ids;
pub(crate) mod correction;
pub(crate) mod correction_pass;
pub(crate) mod events;
pub(crate) mod learner;

pub use events::{Ending, News, Progress, Tell};
