//! Where a scan stands between two records, saved and taken up again.

use serde::{Deserialize, Serialize};

use super::message_indexes::IndexCheck;
use super::search::Synchronisation;
use crate::record::Inventory;

/// Where a scan stands between two records in front of the summary, to be taken up again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Position {
    pub(super) offset: u64,
    pub(super) inventory: Inventory,
    pub(super) indexes: IndexCheck,
    pub(super) sync: Synchronisation,
    pub(super) data_crc: Option<u32>,
}

impl Position {
    /// The profile that the recording's header states.
    pub fn profile(&self) -> &str {
        self.inventory.profile()
    }
}
