//! Results of a recording.

use crate::annotate::Annotator;
use crate::imu::ChannelRole;
use crate::record::{Channel, Damage};
use crate::report::Findings;

/// Results of a recording.
#[derive(Debug)]
pub(crate) struct Learned {
    pub(crate) imus: Vec<Findings>,
    /// All channels, and their roles.
    pub(crate) channels: Vec<(Channel, ChannelRole)>,
    /// Refusals, one line each.
    pub(crate) notes: Vec<String>,
    /// Topics that the configuration names and the recording lacks, one line each.
    pub(crate) missing: Vec<String>,
    /// Whether an IMU's channels follow each other in the file and were not read in time order.
    pub(crate) apart: bool,
    /// First damages.
    pub(crate) damage: Vec<Damage>,
    pub(crate) damages: u64,
    /// Annotator with all topics, which can continue.
    pub(crate) annotator: Annotator,
}
