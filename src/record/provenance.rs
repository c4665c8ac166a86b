//! Recognition of files that Stillpoint wrote, and of the original inside an annotated recording. The shell provides
//! the bytes as [`ReadAt`].

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::ops::Range;

use crc32fast::Hasher;
use mcap::MAGIC;

use super::footer::Footer;
use super::marks::{COMPLETED, INDEXES, LIBRARY, METADATA, PREFIX, RECOVERED, TAIL, WHOLE};
use super::records::{AttachmentIndex, ChunkIndex, Header, MetadataIndex, parse_metadata};
use super::walk::{ReadAt, Walk, footer, read, summary_section};
use super::wire::{DATA_END, FRAME, Fields, op};
use super::{Channel, Error, Inventory};
use crate::topic;

/// Largest header or metadata record that can be ours, in bytes.
const LIMIT: u64 = 1 << 24;
/// Read size, in bytes.
const BLOCK: u64 = 1 << 16;

/// Kind of a file, by the program that wrote it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Written by another program; the file is an original.
    Recording,
    /// Written by Stillpoint and unchanged since.
    Annotated {
        /// Place of the recording that was annotated.
        original: Original,
        /// Settings that determined the annotations.
        settings: BTreeMap<String, String>,
        /// Whether the original is cut off or damaged where the copy is whole.
        damaged: bool,
    },
    /// Written by Stillpoint: annotations alone.
    Sidecar {
        /// Settings that determined the annotations.
        settings: BTreeMap<String, String>,
    },
    /// Written by Stillpoint, then copied, filtered or extended by another program. The original cannot be recovered.
    Edited {
        /// Inconsistency that was found.
        why: &'static str,
    },
}

/// A recording within a file: all of it, or the original inside an annotated recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Original {
    prefix: u64,
    tail: Range<u64>,
}

impl Original {
    /// Original that is the whole file, of this length in bytes.
    pub fn whole(length: u64) -> Self {
        Self { prefix: length, tail: 0..0 }
    }

    /// Length of the recording in bytes.
    pub fn length(&self) -> u64 {
        self.prefix + (self.tail.end - self.tail.start)
    }

    /// Ranges of the file that hold a range of the recording, in order.
    pub fn pieces(&self, range: Range<u64>) -> impl Iterator<Item = Range<u64>> + use<> {
        let front = range.start.min(self.prefix)..range.end.min(self.prefix);
        let place = |offset: u64| self.tail.start + offset.clamp(self.prefix, self.length()) - self.prefix;
        let back = place(range.start)..place(range.end);
        [front, back].into_iter().filter(|range| range.start < range.end)
    }
}

/// Looks for traces of Stillpoint at the end of a file. A file without a whole summary section is taken for a
/// recording, until [`recognise_scanned`] finds more.
///
/// # Errors
/// If the file cannot be read.
pub fn recognise(file: &mut impl ReadAt, length: u64) -> Result<FileKind, Error> {
    match Traces::of_summary(file, length)? {
        Some(traces) => match traces.judge(file)? {
            // Where the summary itself is damaged, what it lacks was taken by nobody.
            FileKind::Edited { .. } if !is_summary_sound(file, length)? => Ok(FileKind::Recording),
            kind => Ok(kind),
        },
        None => Ok(FileKind::Recording),
    }
}

/// Whether the CRC of the summary holds, as far as there is one.
fn is_summary_sound(file: &mut impl ReadAt, length: u64) -> Result<bool, Error> {
    let Some(Footer { section, crc, .. }) = footer(file, length)? else { return Ok(false) };
    let mut computed = Hasher::new();
    // It covers the footer up to the CRC itself.
    let (mut at, end) = (section.start, section.end + FRAME as u64 + 16);
    while at < end {
        let until = end.min(at + BLOCK);
        computed.update(&read(file, at..until)?);
        at = until;
    }
    Ok(crc == 0 || crc == computed.finalize())
}

/// Looks for traces of Stillpoint in the result of a scan, for files that lost their end.
///
/// # Errors
/// If the file cannot be read.
pub fn recognise_scanned(file: &mut impl ReadAt, inventory: &Inventory) -> Result<FileKind, Error> {
    Traces::of_inventory(inventory).judge(file)
}

/// Entries of a file that show who wrote it.
#[derive(Default)]
struct Traces {
    /// Last records of our names: the kept tail, the message indexes, the metadata.
    tail: Option<AttachmentIndex>,
    indexes: Option<AttachmentIndex>,
    metadata: Option<MetadataIndex>,
    /// Channels of our topics.
    ours: BTreeSet<u16>,
    /// Offset of the last chunk that holds messages of other programs.
    last_foreign_chunk: u64,
    /// Offset of the end of the data section.
    data_end: u64,
}

impl Traces {
    fn of_summary(file: &mut impl ReadAt, length: u64) -> Result<Option<Self>, Error> {
        let Some(section) = summary_section(file, length)? else { return Ok(None) };
        let mut traces = Self { data_end: section.start - DATA_END, ..Self::default() };
        let mut walk = Walk::new(section, BLOCK);
        while let Some(frame) = walk.next(file)? {
            if frame.length <= LIMIT {
                let body = walk.body(file, frame, LIMIT)?;
                traces.note(frame.opcode, body);
            }
        }
        Ok(Some(traces))
    }

    fn of_inventory(inventory: &Inventory) -> Self {
        let mut traces = Self { data_end: inventory.prefix, ..Self::default() };
        inventory.summary.attachments.iter().for_each(|index| traces.note_attachment(index));
        inventory.summary.metadata.iter().for_each(|index| traces.note_metadata(index));
        inventory.channels().values().for_each(|channel| traces.note_channel(channel));
        let foreign = inventory.summary.last_chunks.iter().filter(|(channel, _)| !traces.ours.contains(channel));
        traces.last_foreign_chunk = foreign.map(|(_, &offset)| offset).max().unwrap_or_default();
        traces
    }

    fn note(&mut self, opcode: u8, body: &[u8]) {
        match opcode {
            op::CHANNEL => Channel::parse(body).iter().for_each(|channel| self.note_channel(channel)),
            op::ATTACHMENT_INDEX => AttachmentIndex::parse(body).iter().for_each(|index| self.note_attachment(index)),
            op::METADATA_INDEX => MetadataIndex::parse(body).iter().for_each(|index| self.note_metadata(index)),
            op::CHUNK_INDEX => {
                if let Some(chunk) = ChunkIndex::parse(body)
                    && chunk.message_indexes.keys().any(|channel| !self.ours.contains(channel))
                {
                    self.last_foreign_chunk = self.last_foreign_chunk.max(chunk.offset);
                }
            }
            _ => {}
        }
    }

    fn note_channel(&mut self, channel: &Channel) {
        if topic::is_annotation(&channel.topic) {
            self.ours.insert(channel.id);
        }
    }

    fn note_attachment(&mut self, index: &AttachmentIndex) {
        let last = match index.name.as_str() {
            TAIL => &mut self.tail,
            INDEXES => &mut self.indexes,
            _ => return,
        };
        if last.as_ref().is_none_or(|last| last.offset <= index.offset) {
            *last = Some(index.clone());
        }
    }

    fn note_metadata(&mut self, index: &MetadataIndex) {
        if index.name == METADATA && self.metadata.as_ref().is_none_or(|last| last.offset <= index.offset) {
            self.metadata = Some(index.clone());
        }
    }

    fn judge(&self, file: &mut impl ReadAt) -> Result<FileKind, Error> {
        let (kept, metadata) = match (&self.tail, &self.metadata) {
            (None, None) => return Ok(FileKind::Recording),
            (Some(_), None) => return edited("the metadata that belongs to the kept tail is missing"),
            (kept, Some(metadata)) => (kept, metadata),
        };
        let Some(mut settings) = read_settings(file, metadata)? else {
            return edited("the metadata is not where the index says");
        };
        let Some(kept) = kept else {
            return match is_sidecar(file)? {
                true => Ok(FileKind::Sidecar { settings }),
                false => edited("the original's tail is missing"),
            };
        };
        let mut length = |key| settings.remove(key).and_then(|length| length.parse::<u64>().ok());
        let (prefix, completed) = (length(PREFIX), length(COMPLETED).unwrap_or_default());
        let (recovered, whole) = (length(RECOVERED).unwrap_or_default(), length(WHOLE));
        // Before the tail there is the prefix with what completes its last chunk, or a header of ours if the original
        // was cut off after its magic.
        let stands = |prefix: u64| prefix.checked_add(completed) == Some(kept.offset) || prefix == MAGIC.len() as u64;
        let Some(prefix) = prefix.filter(|&prefix| stands(prefix)) else {
            return edited("the original's bytes are not where they were");
        };
        let tail_end = kept.offset.saturating_add(kept.length);
        let Some(tail_start) = tail_end.saturating_sub(4).checked_sub(kept.data_size) else {
            return edited("the kept tail is malformed");
        };
        if metadata.offset != tail_end || tail_start < kept.offset {
            return edited("the kept tail is not where it was");
        }
        let annotations = (tail_end + metadata.length).saturating_add(recovered)..self.data_end;
        if self.last_foreign_chunk > annotations.start || !self.are_ours(file, annotations)? {
            return edited("something was added behind the annotations");
        }
        let original = Original { prefix, tail: tail_start..tail_end - 4 };
        let end = original.tail.end.saturating_sub(MAGIC.len() as u64).max(original.tail.start)..original.tail.end;
        let damaged = whole.is_some() || completed > 0 || read(file, end)? != MAGIC;
        Ok(FileKind::Annotated { original, settings, damaged })
    }

    /// Whether a fold can have written all records in the range.
    fn are_ours(&self, file: &mut impl ReadAt, range: Range<u64>) -> Result<bool, Error> {
        let end = range.end;
        let mut walk = Walk::new(range, BLOCK);
        while let Some(frame) = walk.next(file)? {
            let ours = match frame.opcode {
                op::SCHEMA | op::CHANNEL | op::CHUNK | op::MESSAGE_INDEX => true,
                op::MESSAGE => {
                    Fields(walk.body(file, frame, 2)?).u16().is_some_and(|channel| self.ours.contains(&channel))
                }
                // There is one at most.
                op::ATTACHMENT => self.indexes.as_ref().is_some_and(|entry| entry.offset == frame.offset),
                _ => false,
            };
            if !ours {
                return Ok(false);
            }
        }
        Ok(walk.offset() == end)
    }
}

fn edited(why: &'static str) -> Result<FileKind, Error> {
    Ok(FileKind::Edited { why })
}

fn read_settings(file: &mut impl ReadAt, index: &MetadataIndex) -> Result<Option<BTreeMap<String, String>>, Error> {
    let end = index.offset.checked_add(index.length).filter(|_| index.length <= LIMIT);
    let Some(end) = end else { return Ok(None) };
    let bytes = match read(file, index.offset..end) {
        // The index leads out of the file.
        Err(Error::Read { cause, .. }) if cause.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        read => read?,
    };
    let body = Fields(&bytes).record().filter(|&(opcode, _)| opcode == op::METADATA);
    let parsed = body.and_then(|(_, body)| parse_metadata(body));
    Ok(parsed.filter(|(name, _)| name == METADATA).map(|(_, settings)| settings))
}

fn is_sidecar(file: &mut impl ReadAt) -> Result<bool, Error> {
    let start = MAGIC.len() as u64;
    let head = read(file, start..start + FRAME as u64)?;
    let mut fields = Fields(&head);
    let (Some(op::HEADER), Some(length)) = (fields.u8(), fields.u64().filter(|&length| length <= LIMIT)) else {
        return Ok(false);
    };
    let start = start + FRAME as u64;
    let header = Header::parse(&read(file, start..start + length)?);
    Ok(header.is_some_and(|header| header.library.starts_with(LIBRARY)))
}
