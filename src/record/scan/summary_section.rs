//! Content of the summary section, kept until its CRC is known. In a conflict, the data section is trusted more.

use crc32fast::Hasher;

use crate::record::{Channel, Schema};

/// Content of the summary section, kept until its CRC is known.
#[derive(Default)]
pub(super) struct SummarySection {
    /// Whether DataEnd has been passed.
    pub(super) begun: bool,
    /// Memory of the records below, in bytes.
    pub(super) kept: u64,
    pub(super) crc: Hasher,
    pub(super) schemas: Vec<Schema>,
    pub(super) channels: Vec<Channel>,
    pub(super) private: Vec<(u8, Vec<u8>)>,
}
