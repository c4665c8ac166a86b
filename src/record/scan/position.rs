//! Where a scan stands, saved and taken up again.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::data_crc::DataCrc;
use super::message_indexes::OpenChunk;
use super::{Scan, Stage};
use crate::record::Inventory;

/// Where a scan stands between two records in front of the summary, to be taken up again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Position {
    offset: u64,
    inventory: Inventory,
    chunk: Option<OpenChunk>,
    orphans: bool,
    lengths: BTreeMap<u16, (u64, u64)>,
    trusted: Option<u64>,
    data_crc: Option<u32>,
}

impl Position {
    /// The profile that the recording's header states.
    pub fn profile(&self) -> &str {
        self.inventory.profile()
    }
}

impl Scan {
    /// A scan of a recording that may grow, from where another one stood. Its length is 0 as with [`Scan::new`].
    pub fn resume(position: Position) -> Self {
        let Position { offset, inventory, chunk, orphans, lengths, trusted, data_crc } = position;
        let (stage, data_crc) = (Stage::Record, DataCrc::resume(data_crc));
        let mut scan = Self { inventory, chunk, orphans, lengths, trusted, stage, data_crc, ..Self::default() };
        scan.horizon.skip(offset);
        scan
    }

    /// Where it stands; `None` unless everything in front has been told, and the summary has not begun. An annotated
    /// recording does not grow, so that there is nothing to take up.
    pub fn position(&self) -> Option<Position> {
        let at_a_record = matches!(self.stage, Stage::Record) && self.queue.is_empty();
        let between = at_a_record && !self.summary.begun && self.ours.is_none();
        between.then(|| Position {
            offset: self.horizon.offset(),
            inventory: self.inventory.clone(),
            chunk: self.chunk.clone(),
            orphans: self.orphans,
            lengths: self.lengths.clone(),
            trusted: self.trusted,
            data_crc: self.data_crc.value(),
        })
    }
}
