//! Scan events in, annotation blocks and findings out: a recording's messages through [`imu`](crate::imu),
//! [`engine`](crate::engine) and [`annotate`](crate::annotate), the same for batch, tail and all other readers.

pub(crate) mod annotated_before;
pub(crate) mod annotations;
pub(crate) mod channel_table;
pub(crate) mod correction;
pub(crate) mod correction_pass;
pub(crate) mod damages;
pub(crate) mod events;
pub(crate) mod learner;
pub(crate) mod no_imu;
pub(crate) mod sources;
pub(crate) mod time_merge;
pub(crate) mod time_order;
pub(crate) mod timelines;

pub use events::{Ending, Notice, Notify, Progress};
