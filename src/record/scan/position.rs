//! Position of a scan between two records, to be saved and resumed.

use serde::{Deserialize, Serialize};

use super::message_indexes::IndexCheck;
use super::search::Synchronisation;
use crate::record::Inventory;

/// Position of a scan between two records before the summary, to be resumed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Position {
    pub(super) offset: u64,
    pub(super) inventory: Inventory,
    pub(super) indexes: IndexCheck,
    pub(super) sync: Synchronisation,
    pub(super) data_crc: Option<u32>,
}

impl Position {
    /// Profile in the recording's header.
    pub fn profile(&self) -> &str {
        self.inventory.profile()
    }
}
