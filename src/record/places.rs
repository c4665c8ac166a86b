//! Places of the chunks and attachments of a recording, by its summary: for readers to whom every look at the data is dear.
//! The [`Scan`](super::Scan) reads the bytes that no chunk index covers.

use std::collections::BTreeMap;
use std::ops::Range;

use crc32fast::Hasher;
use mcap::MAGIC;

use super::footer::Footer;
use super::frame_window::Frame;
use super::records::{AttachmentIndex, ChunkHeader, ChunkIndex};
use super::walk::{ReadAt, Walk, footer, read};
use super::wire::{DATA_END, FRAME, op};
use super::{Channel, Error, Schema};

/// Longest summary that is read, in bytes (48 MiB), since all of it is held: that of some 100 GB in chunks of 1 MB.
const LIMIT: u64 = 48 << 20;
/// Length of a message index without entries, and of an entry, in bytes.
const EMPTY: u64 = FRAME as u64 + 2 + 4;
const ENTRY: u64 = 16;

/// Chunks and attachments that a whole summary lists, in file order, none within another.
#[derive(Debug, Default)]
pub struct Places {
    chunks: Vec<KnownChunk>,
    attachments: BTreeMap<u64, AttachmentIndex>,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
}

/// A chunk, by its index alone.
#[derive(Debug)]
pub(super) struct KnownChunk {
    pub(super) index: ChunkIndex,
    /// Whether the message indexes of the chunk are where and as long as the chunk index says.
    sound: bool,
}

impl KnownChunk {
    /// Offset of the first byte behind the message indexes.
    pub(super) fn end(&self) -> u64 {
        self.index.offset + self.index.length + self.index.message_indexes_length
    }

    /// The chunk record.
    pub(super) fn frame(&self) -> Frame {
        Frame { offset: self.index.offset, opcode: op::CHUNK, length: self.index.length - FRAME as u64 }
    }

    /// The chunk's header, as far as the index tells it.
    pub(super) fn header(&self) -> ChunkHeader<'_> {
        let ChunkIndex { start_time, end_time, uncompressed_size, compressed_size, .. } = self.index;
        let compression = &self.index.compression;
        ChunkHeader { start_time, end_time, uncompressed_size, uncompressed_crc: 0, compression, compressed_size }
    }

    /// Number of messages by channel; `None` if the index does not tell it.
    pub(super) fn counts(&self) -> Option<BTreeMap<u16, u64>> {
        self.sound.then(|| counts(&self.index)).flatten()
    }

    /// Channels of its messages; `None` if the index does not tell them.
    pub(super) fn channels(&self) -> Option<Vec<u16>> {
        self.sound.then(|| self.index.message_indexes.keys().copied().collect())
    }
}

/// Number of messages by channel: the lengths of the message indexes, each of which ends where the next one begins.
fn counts(index: &ChunkIndex) -> Option<BTreeMap<u16, u64>> {
    let start = index.offset.checked_add(index.length)?;
    let mut end = start.checked_add(index.message_indexes_length)?;
    let mut places: Vec<_> = index.message_indexes.iter().map(|(&channel, &offset)| (offset, channel)).collect();
    places.sort_unstable_by(|a, b| b.cmp(a));
    let mut found = BTreeMap::new();
    for (offset, channel) in places {
        let entries = end.checked_sub(offset)?.checked_sub(EMPTY)?;
        found.insert(channel, (entries % ENTRY == 0).then_some(entries / ENTRY)?);
        end = offset;
    }
    (end == start && !found.is_empty()).then_some(found)
}

impl Places {
    /// Reads the summary of a recording of this length; `None` if it is absent, not whole, or lists no chunks.
    ///
    /// # Errors
    /// If the recording cannot be read.
    pub fn of(file: &mut impl ReadAt, length: u64) -> Result<Option<Self>, Error> {
        let Some(footer) = footer(file, length)? else { return Ok(None) };
        let Footer { section, crc, .. } = footer;
        let until = length - MAGIC.len() as u64 - 4;
        if section.is_empty() || until - section.start > LIMIT {
            return Ok(None);
        }
        // In one piece, since each may be a request.
        let bytes = read(file, section.start..until)?;
        let mut computed = Hasher::new();
        computed.update(&bytes);
        if crc != 0 && crc != computed.finalize() {
            return Ok(None);
        }
        let mut walk = Walk::new(0..section.end - section.start, LIMIT);
        let (mut places, mut bytes) = (Self::default(), &bytes[..]);
        while let Some(frame) = walk.next(&mut bytes)? {
            let body = walk.body(&mut bytes, frame, LIMIT)?;
            let understood = match frame.opcode {
                op::CHUNK_INDEX => ChunkIndex::parse(body).map(|index| {
                    let sound = counts(&index).is_some();
                    places.chunks.push(KnownChunk { index, sound });
                }),
                op::ATTACHMENT_INDEX => AttachmentIndex::parse(body).map(|index| {
                    places.attachments.insert(index.offset, index);
                }),
                op::SCHEMA => Schema::parse(body).map(|schema| drop(places.schemas.insert(schema.id, schema))),
                op::CHANNEL => Channel::parse(body).map(|channel| drop(places.channels.insert(channel.id, channel))),
                _ => Some(()),
            };
            if understood.is_none() {
                return Ok(None);
            }
        }
        let data_end = section.start - DATA_END;
        Ok((walk.offset() == section.end - section.start && places.settle(data_end)).then_some(places))
    }

    /// Sorts the places. Returns whether none overlaps another and all lie within the data.
    fn settle(&mut self, data_end: u64) -> bool {
        self.chunks.sort_unstable_by_key(|place| place.index.offset);
        let long = |length: u64| length >= FRAME as u64;
        let mut free = MAGIC.len() as u64;
        for KnownChunk { index, .. } in &self.chunks {
            let end =
                index.offset.checked_add(index.length).and_then(|end| end.checked_add(index.message_indexes_length));
            match end.filter(|&end| long(index.length) && index.offset >= free && end <= data_end) {
                Some(end) => free = end,
                None => return false,
            }
        }
        let apart = |index: &AttachmentIndex| {
            let end = index.offset.checked_add(index.length).filter(|&end| long(index.length) && end <= data_end);
            end.is_some_and(|end| self.from(index.offset).next().is_none_or(|place| place.index.offset >= end))
        };
        !self.chunks.is_empty() && self.attachments.values().all(apart)
    }

    /// The chunks that end behind an offset, in order.
    fn from(&self, offset: u64) -> impl Iterator<Item = &KnownChunk> {
        self.chunks.iter().skip(self.chunks.partition_point(|place| place.end() <= offset))
    }

    /// The chunk that begins at an offset.
    pub(super) fn chunk(&self, offset: u64) -> Option<&KnownChunk> {
        self.from(offset).next().filter(|place| place.index.offset == offset)
    }

    /// The attachment that begins at an offset.
    pub(super) fn attachment(&self, offset: u64) -> Option<&AttachmentIndex> {
        self.attachments.get(&offset)
    }

    /// The first chunk at or behind an offset.
    pub(super) fn next(&self, offset: u64) -> Option<&KnownChunk> {
        self.from(offset).find(|place| place.index.offset >= offset)
    }

    /// Definition of a channel, and its schema if it has one; `None` if the summary does not define both.
    pub(super) fn definition(&self, channel: u16) -> Option<(Option<&Schema>, &Channel)> {
        let channel = self.channels.get(&channel)?;
        match channel.schema_id {
            0 => Some((None, channel)),
            id => Some((Some(self.schemas.get(&id)?), channel)),
        }
    }

    /// Whether the summary defines a channel.
    pub fn defines(&self, channel: u16) -> bool {
        self.definition(channel).is_some()
    }

    /// Range of the chunk that begins at an offset, with its message indexes.
    pub fn range(&self, offset: u64) -> Option<Range<u64>> {
        self.chunk(offset).map(|place| offset..place.end())
    }

    /// Offset of the first chunk, or of its end if it is so short that it costs nothing to read it along.
    pub fn start_with_little(&self) -> u64 {
        const LITTLE: u64 = 128 << 10;
        let first = self.chunks.first();
        first.map_or(0, |place| if place.index.length <= LITTLE { place.end() } else { place.index.offset })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::sync::Arc;

    use super::*;
    use crate::record::{Event, Inventory, Scan, Supply};
    use crate::simulate::{Scenario, record};

    fn demo() -> Vec<u8> {
        let mut bytes = Vec::new();
        record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
        bytes
    }

    fn places(bytes: &[u8]) -> Option<Places> {
        Places::of(&mut &bytes[..], bytes.len() as u64).unwrap()
    }

    /// Scan that needs no chunk but the first. Returns also the number of bytes that it read, and of chunks.
    fn scan(bytes: &[u8], known: Option<Places>) -> (Inventory, u64, u64) {
        let mut scan = Scan::finished(bytes.len() as u64).offering_chunks();
        if let Some(known) = known {
            scan = scan.knowing(Arc::new(known));
        }
        let (mut read, mut ends, mut first) = (0, 0, true);
        loop {
            match scan.next_event().unwrap() {
                Event::Read { offset, length } => {
                    scan.insert(length).copy_from_slice(&bytes[offset as usize..][..length]);
                    scan.notify_read(length);
                    read += length as u64;
                }
                Event::Chunk { .. } => {
                    scan.supply(if std::mem::take(&mut first) { Supply::Absent } else { Supply::Unread });
                }
                Event::ChunkEnd => ends += 1,
                Event::End => return (scan.into_inventory(), read, ends),
                _ => {}
            }
        }
    }

    #[test]
    fn what_is_known_by_the_summary_is_passed_unread_and_counts_the_same() {
        let bytes = demo();
        let ((mut known, few, ends), (mut walked, many, all)) = (scan(&bytes, places(&bytes)), scan(&bytes, None));
        assert_eq!((ends, known.damage()), (all, 0));
        let counts =
            |inventory: &Inventory| inventory.channels().keys().map(|&id| inventory.messages(id)).collect::<Vec<_>>();
        assert_eq!((counts(&known), known.span()), (counts(&walked), walked.span()));
        assert_eq!((known.prefix(), known.opened()), (walked.prefix(), walked.opened()));
        assert_eq!(known.summary.take_indexes(), walked.summary.take_indexes());
        assert!(few < many, "{few} of {many} bytes");
    }

    #[test]
    fn a_summary_that_is_damaged_or_missing_is_not_believed() {
        let bytes = demo();
        assert!(places(&bytes).is_some());
        assert!(places(&bytes[..bytes.len() - 1]).is_none(), "cut off");
        let mut flipped = bytes.clone();
        let at = flipped.len() - 100;
        flipped[at] ^= 1;
        assert!(places(&flipped).is_none());
    }
}
