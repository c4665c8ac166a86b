//! The original inside an annotated recording, scanned as if it stood alone: the meaning of its records must not depend
//! on what was written after them. Otherwise a record that was cut off would swallow the annotations.
//! [`provenance`](crate::record::own) determines more carefully who wrote a file.

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::MAGIC;

use crate::record::footer::{CLOSING, Footer};
use crate::record::frame_window::{Extent, FrameWindow, Stop};
use crate::record::marks::{COMPLETED, METADATA, PREFIX, RECOVERED, TAIL, WHOLE};
use crate::record::records::{AttachmentIndex, MetadataIndex, parse_metadata};
use crate::record::wire::{DATA_END, FRAME, Fields, op};

/// Longest metadata record that is read, in bytes (1 MiB).
const LIMIT: u64 = 1 << 20;
/// Longest group of indexes that is read, in bytes (32 MiB): twice what a recording may have by default.
const GROUP: u64 = 32 << 20;
/// Longest sequence of the offsets of such groups, in bytes: one for each opcode.
const OFFSETS: u64 = 256 * (FRAME as u64 + 17);

/// Layout of an annotated recording.
#[derive(Clone, Debug)]
pub(super) struct Ours {
    /// Whether the original is being scanned. If so, offsets refer to the original.
    pub(super) within: bool,
    /// Length of the original's prefix, which is at its own place, in bytes.
    pub(super) prefix: u64,
    /// Range of the file that keeps the rest of the original.
    pub(super) tail: Range<u64>,
    /// Offset in the original of the end of its last whole record.
    pub(super) whole: u64,
    /// Range of the file that repeats the whole records of that rest, after definitions that they need.
    pub(super) recovered: Range<u64>,
    /// Extent of the file, which may still be reported to grow.
    pub(super) extent: Extent,
}

impl Ours {
    /// Length of the original, in bytes.
    pub(super) fn original(&self) -> u64 {
        self.prefix + (self.tail.end - self.tail.start)
    }

    pub(super) fn of(
        settings: &BTreeMap<String, String>,
        metadata: &MetadataIndex,
        kept: &AttachmentIndex,
        data_end: u64,
    ) -> Option<Self> {
        let number = |key| settings.get(key).map_or(Some(0), |number| number.parse::<u64>().ok());
        let (prefix, completed) = (number(PREFIX)?, number(COMPLETED)?);
        let magic = MAGIC.len() as u64;
        if prefix < magic || prefix.checked_add(completed)? != kept.offset && prefix != magic {
            return None;
        }
        let end = metadata.offset.checked_sub(4)?;
        let tail = end.checked_sub(kept.data_size)?..end;
        if kept.offset.checked_add(kept.length)? != metadata.offset || tail.start <= kept.offset {
            return None;
        }
        let start = metadata.offset.checked_add(metadata.length)?;
        let recovered = start..start.checked_add(number(RECOVERED)?).filter(|&end| end <= data_end)?;
        let whole = if recovered.is_empty() { prefix } else { number(WHOLE)? };
        let original = prefix.checked_add(kept.data_size)?;
        (prefix..=original).contains(&whole).then_some(Self {
            within: true,
            prefix,
            tail,
            whole,
            recovered,
            extent: Extent::default(),
        })
    }
}

/// Search for traces of Stillpoint at the end of the recording.
#[derive(Default)]
pub(super) struct Recognising {
    /// Offset at which to continue afterwards.
    pub(super) back: u64,
    /// Offsets of the ends of the data section and of the summary's groups, once the footer was read.
    pub(super) ends: Option<(u64, u64)>,
    /// Ranges of the attachment and metadata indexes, once their offsets were read.
    pub(super) groups: Option<[Range<u64>; 2]>,
    pub(super) kept: Option<AttachmentIndex>,
    pub(super) metadata: Option<MetadataIndex>,
}

impl Recognising {
    /// Reads on; `None` in the end if Stillpoint did not write it.
    pub(super) fn read(&mut self, window: &mut FrameWindow) -> Result<Option<Ours>, Stop> {
        let length = window.extent().length;
        let Some(footer) = length.checked_sub(CLOSING as u64) else { return Ok(None) };
        let (data_end, offsets) = match self.ends {
            Some(ends) => ends,
            None => {
                let found = Footer::parse(bytes(window, footer..length)?, footer);
                let Some(Footer { section, offsets, .. }) = found else { return Ok(None) };
                if !(section.start..=footer).contains(&offsets) || footer - offsets > OFFSETS {
                    return Ok(None);
                }
                let data_end = section.start - DATA_END;
                *self.ends.insert((data_end, offsets))
            }
        };
        if self.groups.is_none() {
            let mut groups = [0..0, 0..0];
            let mut fields = Fields(bytes(window, offsets..footer)?);
            while let Some((op::SUMMARY_OFFSET, body)) = fields.record() {
                let mut body = Fields(body);
                let (Some(opcode), Some(start), Some(size)) = (body.u8(), body.u64(), body.u64()) else { break };
                let range = start..start.saturating_add(size);
                let [attachments, metadata] = &mut groups;
                match opcode {
                    op::ATTACHMENT_INDEX => *attachments = range,
                    op::METADATA_INDEX => *metadata = range,
                    _ => {}
                }
            }
            let sound =
                |group: &Range<u64>| data_end < group.start && group.end <= offsets && group.end - group.start <= GROUP;
            if !groups.iter().all(sound) {
                return Ok(None);
            }
            self.groups = Some(groups);
        }
        let Some([attachments, groups]) = &self.groups else { return Ok(None) };
        if self.metadata.is_none() {
            let mut fields = Fields(bytes(window, groups.clone())?);
            let entries = std::iter::from_fn(|| fields.record().and_then(|(_, body)| MetadataIndex::parse(body)));
            let last = entries.filter(|entry| entry.name == METADATA).max_by_key(|entry| entry.offset);
            let ours = |entry: &MetadataIndex| entry.length <= LIMIT && entry.offset < data_end;
            let Some(last) = last.filter(ours) else { return Ok(None) };
            self.metadata = Some(last);
        }
        let Some(metadata) = &self.metadata else { return Ok(None) };
        if self.kept.is_none() {
            let mut fields = Fields(bytes(window, attachments.clone())?);
            let mut entries = std::iter::from_fn(|| fields.record().and_then(|(_, body)| AttachmentIndex::parse(body)));
            let in_front = |entry: &AttachmentIndex| entry.offset.checked_add(entry.length) == Some(metadata.offset);
            let Some(kept) = entries.find(|entry| entry.name == TAIL && in_front(entry)) else { return Ok(None) };
            self.kept = Some(kept);
        }
        let Some(kept) = &self.kept else { return Ok(None) };
        let record = bytes(window, metadata.offset..metadata.offset + metadata.length)?;
        let body = Fields(record).record().filter(|&(opcode, _)| opcode == op::METADATA).map(|(_, body)| body);
        let settings = body.and_then(parse_metadata).filter(|(name, _)| name == METADATA);
        let ours = settings.and_then(|(_, settings)| Ours::of(&settings, metadata, kept, data_end));
        Ok(ours.map(|ours| Ours { extent: window.extent(), ..ours }))
    }
}

/// Bytes in a range of the file.
fn bytes(window: &mut FrameWindow, range: Range<u64>) -> Result<&[u8], Stop> {
    window.seek(range.start);
    window.peek((range.end - range.start) as usize)
}
