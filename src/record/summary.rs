//! Contents of a data section, collected record by record, and the summary section that lists them. Collecting is left
//! to [`Inventory`](super::Inventory) for an original and to [`Emitter`](super::emitter) for annotations.

use std::collections::BTreeMap;

use crc32fast::Hasher;
use mcap::MAGIC;
use serde::{Deserialize, Serialize};

use super::records::{AttachmentIndex, ChunkIndex, MetadataIndex};
use super::reindex::{Reindexed, Reindexing};
use super::wire::{Put, op, record};
use super::{Channel, Piece, Schema};

/// Contents of a data section.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Summary {
    pub(super) schemas: BTreeMap<u16, Schema>,
    pub(super) channels: BTreeMap<u16, Channel>,
    /// Number of messages of each channel that has any.
    pub(super) counts: BTreeMap<u16, u64>,
    /// First and last log time, in nanoseconds.
    pub(super) span: Option<(u64, u64)>,
    pub(super) chunks: u32,
    indexes: Indexes,
    /// Chunks not indexed yet, because their message indexes must be written anew.
    pub(super) reindexing: Reindexing,
    /// Offset of the last chunk with messages of a channel, by its message indexes.
    pub(super) last_chunks: BTreeMap<u16, u64>,
    pub(super) attachments: Vec<AttachmentIndex>,
    pub(super) metadata: Vec<MetadataIndex>,
    /// Encoded records of the original's summary that MCAP does not define, by opcode.
    pub(super) private: BTreeMap<u8, Vec<u8>>,
}

impl Summary {
    /// Adds `count` messages of a channel.
    pub(super) fn count(&mut self, channel: u16, count: u64) {
        *self.counts.entry(channel).or_default() += count;
    }

    /// Extends the span of log times.
    pub(super) fn cover(&mut self, (from, until): (u64, u64)) {
        self.span = Some(match self.span {
            None => (from, until),
            Some((start, end)) => (start.min(from), end.max(until)),
        });
    }

    /// Adds a chunk and its index.
    pub(super) fn index(&mut self, chunk: &ChunkIndex) {
        self.hold(chunk.offset, chunk.message_indexes.keys());
        chunk.write(&mut self.indexes.kept);
    }

    /// Adds a chunk that is indexed once its message indexes have a place.
    pub(super) fn index_later(&mut self, chunk: Reindexed) {
        self.hold(chunk.chunk.offset, chunk.records.keys());
        self.reindexing.push(chunk);
    }

    /// Indexes a chunk that was already added.
    pub(super) fn index_now(&mut self, chunk: &ChunkIndex) {
        chunk.write(&mut self.indexes.kept);
    }

    fn hold<'a>(&mut self, chunk: u64, channels: impl Iterator<Item = &'a u16>) {
        self.chunks += 1;
        self.last_chunks.extend(channels.map(|&channel| (channel, chunk)));
    }

    /// Splits off the attachments and metadata from byte `from` of the file on.
    pub(super) fn split_off(&mut self, from: u64) -> Self {
        let attachments = self.attachments.extract_if(.., |entry| entry.offset >= from).collect();
        let metadata = self.metadata.extract_if(.., |entry| entry.offset >= from).collect();
        Self { attachments, metadata, ..Self::default() }
    }

    /// Moves attachments, metadata and last chunks to new offsets.
    pub(super) fn relocate(&mut self, place: impl Fn(u64) -> u64) {
        let attachments = self.attachments.iter_mut().map(|entry| &mut entry.offset);
        let metadata = self.metadata.iter_mut().map(|entry| &mut entry.offset);
        let offsets = attachments.chain(metadata).chain(self.last_chunks.values_mut());
        offsets.for_each(|offset| *offset = place(*offset));
    }

    /// Takes the chunk indexes added since the last call.
    pub(super) fn take_indexes(&mut self) -> Vec<u8> {
        self.indexes.take()
    }

    /// Everything after the DataEnd record, which ends at byte `start` of the file.
    ///
    /// Without `indexed`, chunks are counted but not indexed, since readers that find an index look nowhere else.
    pub(super) fn write(self, start: u64, indexed: bool) -> Vec<Piece> {
        let mut groups = Groups { start, ..Groups::default() };
        groups.group(op::SCHEMA, |out| self.schemas.values().for_each(|schema| schema.write(out)));
        groups.group(op::CHANNEL, |out| self.channels.values().for_each(|channel| channel.write(out)));
        groups.group(op::STATISTICS, |out| self.write_statistics(out));
        if indexed {
            groups.indexes(&self.indexes);
        }
        groups.group(op::ATTACHMENT_INDEX, |out| self.attachments.iter().for_each(|entry| entry.write(out)));
        groups.group(op::METADATA_INDEX, |out| self.metadata.iter().for_each(|entry| entry.write(out)));
        for (&opcode, records) in &self.private {
            groups.group(opcode, |out| out.put(records));
        }
        groups.close()
    }

    fn write_statistics(&self, out: &mut Vec<u8>) {
        let (from, until) = self.span.unwrap_or_default();
        record(out, op::STATISTICS, |out| {
            out.put_u64(self.counts.values().sum());
            out.put_u16(self.schemas.len() as u16);
            out.put_u32(self.channels.len() as u32);
            out.put_u32(self.attachments.len() as u32);
            out.put_u32(self.metadata.len() as u32);
            out.put_u32(self.chunks);
            out.put_u64(from);
            out.put_u64(until);
            out.put_u32(10 * self.counts.len() as u32);
            for (&channel, &count) in &self.counts {
                out.put_u16(channel);
                out.put_u64(count);
            }
        });
    }
}

/// Encoded chunk indexes, in file order. A long recording has many, so a caller that can keep them elsewhere takes them
/// from time to time and writes them in the place of [`Piece::Indexes`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Indexes {
    /// Length and CRC-32 of the indexes taken so far.
    taken: (u64, u32),
    kept: Vec<u8>,
}

impl Indexes {
    fn take(&mut self) -> Vec<u8> {
        let (length, crc) = self.taken;
        let mut hasher = Hasher::new_with_initial(crc);
        hasher.update(&self.kept);
        self.taken = (length + self.kept.len() as u64, hasher.finalize());
        std::mem::take(&mut self.kept)
    }
}

/// A summary section under construction: records grouped by opcode.
#[derive(Default)]
struct Groups {
    start: u64,
    pieces: Vec<Piece>,
    /// Length (`passed`) and CRC-32 (`crc`) of the finished pieces.
    passed: u64,
    crc: Hasher,
    /// Piece being written.
    out: Vec<u8>,
    /// Opcode, offset and length of each group.
    offsets: Vec<(u8, u64, u64)>,
}

impl Groups {
    fn here(&self) -> u64 {
        self.start + self.passed + self.out.len() as u64
    }

    /// Adds a group. A group without records gets no entry.
    fn group(&mut self, opcode: u8, fill: impl FnOnce(&mut Vec<u8>)) {
        let start = self.here();
        fill(&mut self.out);
        self.note(opcode, start);
    }

    fn note(&mut self, opcode: u8, start: u64) {
        let length = self.here() - start;
        if length > 0 {
            self.offsets.push((opcode, start, length));
        }
    }

    /// Adds the group of the chunk indexes, most of which may be kept elsewhere.
    fn indexes(&mut self, indexes: &Indexes) {
        let start = self.here();
        let (length, crc) = indexes.taken;
        if length > 0 {
            self.flush();
            self.pieces.push(Piece::Indexes(length));
            self.passed += length;
            self.crc.combine(&Hasher::new_with_initial_len(crc, length));
        }
        self.out.put(&indexes.kept);
        self.note(op::CHUNK_INDEX, start);
    }

    fn flush(&mut self) {
        self.crc.update(&self.out);
        self.passed += self.out.len() as u64;
        self.pieces.push(Piece::Bytes(std::mem::take(&mut self.out)));
    }

    /// Adds the offsets of the groups, the footer and the magic.
    fn close(mut self) -> Vec<Piece> {
        let offsets_start = self.here();
        for (opcode, start, length) in std::mem::take(&mut self.offsets) {
            record(&mut self.out, op::SUMMARY_OFFSET, |out| {
                out.put(&[opcode]);
                out.put_u64(start);
                out.put_u64(length);
            });
        }
        record(&mut self.out, op::FOOTER, |out| {
            out.put_u64(self.start);
            out.put_u64(offsets_start);
            out.put_u32(0);
        });
        // The CRC covers the footer up to the CRC itself, so it can be filled in only now.
        self.out.truncate(self.out.len() - 4);
        self.flush();
        let mut end = self.crc.finalize().to_le_bytes().to_vec();
        end.put(MAGIC);
        self.pieces.push(Piece::Bytes(end));
        self.pieces
    }
}
