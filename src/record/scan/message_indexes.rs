//! Message-index check: the chunk whose indexes may follow, and their expected content.
//! [`Reindexed`](crate::record::reindex::Reindexed) indexes them anew.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::record::chunk_check::Tally;
use crate::record::plausibility::{Measure, measure};
use crate::record::records::{ChunkIndex, parse_message_index};
use crate::record::wire::op;

/// State of the message-index check.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct IndexCheck {
    /// Chunk whose message indexes are being collected.
    pub(super) chunk: Option<OpenChunk>,
    /// Whether message indexes that follow belong to a rejected chunk.
    pub(super) orphans: bool,
}

/// A chunk whose message indexes may follow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct OpenChunk {
    pub(super) index: ChunkIndex,
    /// Its messages, by channel; `None` for a chunk that is not read.
    pub(super) tallies: Option<BTreeMap<u16, Tally>>,
    /// First and last log time, in nanoseconds, by the indexes of a chunk that is not read.
    pub(super) span: Option<(u64, u64)>,
    /// Whether a possible message index followed it, valid or not.
    pub(super) followed: bool,
}

impl OpenChunk {
    /// Channel of a message index, if the index agrees with the chunk's messages. For a chunk that is not read, any
    /// index is accepted.
    pub(super) fn agrees(&self, body: &[u8]) -> Option<u16> {
        let (channel, entries) = parse_message_index(body)?;
        let Some(tallies) = &self.tallies else { return Some(channel) };
        let mut told = Tally::default();
        entries.for_each(|(log_time, offset)| told.add(log_time, offset));
        (tallies.get(&channel).copied().unwrap_or_default() == told).then_some(channel)
    }

    /// Whether the content of a record is exactly an index of messages in this chunk.
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
    /// Offset at which to continue afterwards.
    pub(super) back: u64,
}

impl ChunkReindexing {
    pub(super) fn of(chunk: ChunkIndex, back: u64) -> Self {
        Self { chunk, back }
    }
}
