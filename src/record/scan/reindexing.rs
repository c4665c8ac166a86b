//! A second look at a chunk behind which message indexes are damaged or missing. Indexing its messages is left to
//! [`Reindexed`].

use super::{Scan, Stage, within};
use crate::record::horizon::Stop;
use crate::record::records::ChunkIndex;
use crate::record::reindex::Reindexed;

/// A chunk to be opened again.
pub(super) struct Reindexing {
    chunk: ChunkIndex,
    /// Where to go on afterwards.
    back: u64,
}

impl Reindexing {
    pub(super) fn of(chunk: ChunkIndex, back: u64) -> Self {
        Self { chunk, back }
    }
}

impl Scan {
    pub(super) fn reindex(&mut self) -> Result<(), Stop> {
        let Stage::Reindexing(reindexing) = &self.stage else { return Ok(()) };
        self.horizon.seek(reindexing.chunk.offset);
        let frame = self.horizon.frame()?;
        let content = self.open_chunk(frame)?;
        let Stage::Reindexing(reindexing) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let Reindexing { chunk, back } = *reindexing;
        match content {
            Ok(content) => {
                let records = self.inflate.records(content.place, within(&self.horizon, &content.data));
                self.inventory.summary.index_later(Reindexed::of(chunk, records));
            }
            // It was in order a moment ago.
            Err(_) => self.inventory.summary.index(&chunk),
        }
        self.horizon.seek(back);
        self.stage = Stage::Record;
        Ok(())
    }
}
