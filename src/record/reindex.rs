//! New message indexes for whole chunks whose own are damaged or missing. Readers that rely on them (the JavaScript one
//! refuses a chunk without) would miss the messages otherwise. [`Scan`](super::Scan) finds such chunks,
//! [`Fold`](super::Fold) places the indexes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::Message;
use super::records::{ChunkIndex, parse_message_index, write_message_index};
use super::wire::{FRAME, Fields, Put, op};

/// A whole chunk of which some messages are not indexed after it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Reindexed {
    /// Chunk index. It names the message indexes that do follow the chunk without a gap.
    pub(super) chunk: ChunkIndex,
    /// One encoded message index record for each channel with messages in the chunk.
    pub(super) records: BTreeMap<u16, Vec<u8>>,
}

impl Reindexed {
    /// Indexes the messages in the records of a chunk.
    pub(super) fn of(chunk: ChunkIndex, records: &[u8]) -> Self {
        let mut entries: BTreeMap<u16, Vec<(u64, u64)>> = BTreeMap::new();
        let mut fields = Fields(records);
        loop {
            let offset = (records.len() - fields.0.len()) as u64;
            let Some((opcode, body)) = fields.record() else { break };
            if let Some(message) = Message::parse(body).filter(|_| opcode == op::MESSAGE) {
                entries.entry(message.channel).or_default().push((message.log_time, offset));
            }
        }
        let encode = |(channel, mut entries): (u16, Vec<(u64, u64)>)| {
            entries.sort_by_key(|&(log_time, _)| log_time);
            let mut record = Vec::new();
            write_message_index(&mut record, channel, &entries);
            (channel, record)
        };
        Self { chunk, records: entries.into_iter().map(encode).collect() }
    }

    /// Offset of the end of the chunk and the indexes that follow it.
    pub(super) fn end(&self) -> u64 {
        self.chunk.offset + self.chunk.length + self.chunk.message_indexes_length
    }

    /// Appends the missing records, to be placed after those that are there. Returns the completed chunk index.
    pub(super) fn complete(mut self, out: &mut Vec<u8>) -> ChunkIndex {
        let (end, start) = (self.end(), out.len());
        self.records.retain(|channel, _| !self.chunk.message_indexes.contains_key(channel));
        for (channel, record) in self.records {
            self.chunk.message_indexes.insert(channel, end + (out.len() - start) as u64);
            out.put(&record);
        }
        self.chunk.message_indexes_length += (out.len() - start) as u64;
        self.chunk
    }

    /// Appends all records, to be placed at byte `place` of the file. Returns the chunk index that points there.
    pub(super) fn replace(self, mut place: u64, out: &mut Vec<u8>) -> ChunkIndex {
        let (message_indexes, message_indexes_length) = Default::default();
        let mut chunk = ChunkIndex { message_indexes, message_indexes_length, ..self.chunk };
        for (channel, record) in self.records {
            chunk.message_indexes.insert(channel, place);
            chunk.message_indexes_length += record.len() as u64;
            place += record.len() as u64;
            out.put(&record);
        }
        chunk
    }

    /// Length of its records, in bytes.
    fn length(&self) -> u64 {
        self.records.values().map(|record| record.len() as u64).sum()
    }

    fn write(&self, out: &mut Vec<u8>) {
        self.chunk.write(out);
        self.records.values().for_each(|record| out.put(record));
    }
}

/// Reindexed chunks of a recording, in order. If most chunks lost their indexes there are many, so a caller that can
/// keep them elsewhere takes them from time to time and gives them back to the fold.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reindexing {
    /// Length of all message index records except those of the last chunk, in bytes.
    pub(super) length: u64,
    kept: Vec<u8>,
    /// Last chunk. Its missing indexes can still be written directly after it, if nothing follows.
    pub(super) last: Option<Reindexed>,
}

impl Reindexing {
    pub(super) fn push(&mut self, chunk: Reindexed) {
        self.settle();
        self.last = Some(chunk);
    }

    /// Moves the last chunk to the others, since something follows it.
    pub(super) fn settle(&mut self) {
        if let Some(last) = self.last.take() {
            self.length += last.length();
            last.write(&mut self.kept);
        }
    }

    pub(super) fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.kept)
    }
}

/// Parses the bytes that [`take`](Reindexing::take) returned.
pub(super) fn read(taken: &[u8]) -> impl Iterator<Item = Reindexed> {
    let mut fields = Fields(taken);
    std::iter::from_fn(move || {
        let (_, body) = fields.record().filter(|&(opcode, _)| opcode == op::CHUNK_INDEX)?;
        let mut chunk = Reindexed { chunk: ChunkIndex::parse(body)?, records: BTreeMap::new() };
        loop {
            let mut ahead = fields.clone();
            let Some((op::MESSAGE_INDEX, body)) = ahead.record() else { return Some(chunk) };
            let record = fields.bytes(FRAME + body.len())?;
            chunk.records.insert(parse_message_index(body)?.0, record.to_vec());
            fields = ahead;
        }
    })
}
