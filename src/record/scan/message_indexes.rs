//! Message-index check: the chunk whose indexes may follow, and what they must say. Indexing its messages anew is left
//! to [`Reindexed`](crate::record::reindex::Reindexed).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::record::records::{ChunkIndex, parse_message_index};
use crate::record::shape::{Measure, measure};
use crate::record::survey::Tally;
use crate::record::wire::op;

/// What is known of the message indexes that follow.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct IndexCheck {
    /// The chunk whose message indexes are being collected.
    pub(super) chunk: Option<OpenChunk>,
    /// Message indexes that follow belong to a chunk that does not count.
    pub(super) orphans: bool,
}

/// A chunk whose message indexes may follow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct OpenChunk {
    pub(super) index: ChunkIndex,
    /// Its messages, by channel; `None` of a chunk that is not read.
    pub(super) tallies: Option<BTreeMap<u16, Tally>>,
    /// First and last log time by the indexes of a chunk that is not read.
    pub(super) span: Option<(u64, u64)>,
    /// Whether something that may have been a message index stood behind it, in order or not.
    pub(super) followed: bool,
}

impl OpenChunk {
    /// The channel that a message index is about, if what it says of its messages is true. Of a chunk that is not read,
    /// it is believed.
    pub(super) fn agrees(&self, body: &[u8]) -> Option<u16> {
        let (channel, entries) = parse_message_index(body)?;
        let Some(tallies) = &self.tallies else { return Some(channel) };
        let mut told = Tally::default();
        entries.for_each(|(log_time, offset)| told.add(log_time, offset));
        (tallies.get(&channel).copied().unwrap_or_default() == told).then_some(channel)
    }

    /// Whether a record has no other content than the index of some of its messages.
    pub(super) fn is_indexed_by(&self, body: &[u8]) -> bool {
        measure(op::MESSAGE_INDEX, body) == Measure::Says(body.len() as u64)
            && self
                .agrees(body)
                .zip(self.tallies.as_ref())
                .is_some_and(|(channel, tallies)| tallies.contains_key(&channel))
    }
}

/// A chunk to be opened again.
pub(super) struct ChunkReindexing {
    pub(super) chunk: ChunkIndex,
    /// Where to go on afterwards.
    pub(super) back: u64,
}

impl ChunkReindexing {
    pub(super) fn of(chunk: ChunkIndex, back: u64) -> Self {
        Self { chunk, back }
    }
}
