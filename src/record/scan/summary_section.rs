//! What the summary section says, kept until its CRC is known. What the data section says about itself is worth more.

use crc32fast::Hasher;

use crate::record::{Channel, Schema};

/// What the summary section says, kept until its CRC is known.
#[derive(Default)]
pub(super) struct SummarySection {
    /// Whether DataEnd has been passed.
    pub(super) begun: bool,
    /// What the records below take, in bytes.
    pub(super) kept: u64,
    pub(super) crc: Hasher,
    pub(super) schemas: Vec<Schema>,
    pub(super) channels: Vec<Channel>,
    pub(super) private: Vec<(u8, Vec<u8>)>,
}
