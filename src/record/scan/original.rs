//! The original inside an annotated recording, scanned as if it stood alone: what its records are taken for must not
//! depend on what was written behind them. A record that was cut off would swallow that, otherwise.
//! Who wrote a file is told by [`own`](crate::record::own) with more care.

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::MAGIC;

use super::{Scan, Stage};
use crate::record::fold::{COMPLETED, METADATA, PREFIX, RECOVERED, TAIL, WHOLE};
use crate::record::horizon::{Extent, Frame, Horizon, Stop};
use crate::record::records::{AttachmentIndex, MetadataIndex, parse_metadata};
use crate::record::wire::{CLOSING, DATA_END, FRAME, Fields, op};

/// Most bytes of a group of indexes, or of a metadata record, that are looked through (1 MiB).
const LIMIT: u64 = 1 << 20;
/// The same of the offsets of such groups: of each opcode there is one.
const OFFSETS: u64 = 256 * (FRAME as u64 + 17);

/// What stands where in an annotated recording.
#[derive(Clone, Debug)]
pub(super) struct Ours {
    /// Whether the original is being scanned: offsets are those in it, then.
    within: bool,
    /// Of the original, what stands in its own place.
    prefix: u64,
    /// Where the rest of it is kept.
    tail: Range<u64>,
    /// The last whole record of the original ends here.
    whole: u64,
    /// Once more what is whole in that rest.
    recovered: Range<u64>,
    /// Of the file, which may still be said to grow.
    extent: Extent,
}

impl Ours {
    /// Length of the original.
    fn original(&self) -> u64 {
        self.prefix + (self.tail.end - self.tail.start)
    }

    fn of(
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

/// The end of the recording, while it is looked through for traces of ours.
#[derive(Default)]
pub(super) struct Recognising {
    /// Where to go on afterwards.
    back: u64,
    /// Where the data section and the groups of the summary end, once the footer has been seen.
    ends: Option<(u64, u64)>,
    /// The groups of attachment and metadata indexes, once their offsets have been seen.
    groups: Option<[Range<u64>; 2]>,
    kept: Option<AttachmentIndex>,
    metadata: Option<MetadataIndex>,
}

impl Recognising {
    /// Reads on; `None` in the end if it is not ours.
    fn read(&mut self, horizon: &mut Horizon) -> Result<Option<Ours>, Stop> {
        let length = horizon.extent().length;
        let Some(footer) = length.checked_sub(CLOSING) else { return Ok(None) };
        let (data_end, offsets) = match self.ends {
            Some(ends) => ends,
            None => {
                let closing = bytes(horizon, footer..length)?;
                let mut fields = Fields(closing);
                let is_footer = (fields.u8(), fields.u64()) == (Some(op::FOOTER), Some(20)) && closing.ends_with(MAGIC);
                let (Some(start), Some(offsets)) = (fields.u64(), fields.u64()) else { return Ok(None) };
                let data_end =
                    start.checked_sub(DATA_END).filter(|_| is_footer && start <= offsets && offsets <= footer);
                let Some(data_end) = data_end.filter(|_| footer - offsets <= OFFSETS) else { return Ok(None) };
                *self.ends.insert((data_end, offsets))
            }
        };
        if self.groups.is_none() {
            let mut groups = [0..0, 0..0];
            let mut fields = Fields(bytes(horizon, offsets..footer)?);
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
                |group: &Range<u64>| data_end < group.start && group.end <= offsets && group.end - group.start <= LIMIT;
            if !groups.iter().all(sound) {
                return Ok(None);
            }
            self.groups = Some(groups);
        }
        let Some([attachments, groups]) = &self.groups else { return Ok(None) };
        if self.metadata.is_none() {
            let mut fields = Fields(bytes(horizon, groups.clone())?);
            let entries = std::iter::from_fn(|| fields.record().and_then(|(_, body)| MetadataIndex::parse(body)));
            let last = entries.filter(|entry| entry.name == METADATA).max_by_key(|entry| entry.offset);
            let ours = |entry: &MetadataIndex| entry.length <= LIMIT && entry.offset < data_end;
            let Some(last) = last.filter(ours) else { return Ok(None) };
            self.metadata = Some(last);
        }
        let Some(metadata) = &self.metadata else { return Ok(None) };
        if self.kept.is_none() {
            let mut fields = Fields(bytes(horizon, attachments.clone())?);
            let mut entries = std::iter::from_fn(|| fields.record().and_then(|(_, body)| AttachmentIndex::parse(body)));
            let in_front = |entry: &AttachmentIndex| entry.offset.checked_add(entry.length) == Some(metadata.offset);
            let Some(kept) = entries.find(|entry| entry.name == TAIL && in_front(entry)) else { return Ok(None) };
            self.kept = Some(kept);
        }
        let Some(kept) = &self.kept else { return Ok(None) };
        let record = bytes(horizon, metadata.offset..metadata.offset + metadata.length)?;
        let body = Fields(record).record().filter(|&(opcode, _)| opcode == op::METADATA).map(|(_, body)| body);
        let settings = body.and_then(parse_metadata).filter(|(name, _)| name == METADATA);
        let ours = settings.and_then(|(_, settings)| Ours::of(&settings, metadata, kept, data_end));
        Ok(ours.map(|ours| Ours { extent: horizon.extent(), ..ours }))
    }
}

/// The bytes in a range of the file.
fn bytes(horizon: &mut Horizon, range: Range<u64>) -> Result<&[u8], Stop> {
    horizon.seek(range.start);
    horizon.peek((range.end - range.start) as usize)
}

impl Scan {
    /// Looks whether we annotated the recording, which its end tells, and comes back here.
    pub(super) fn look_at_end(&mut self) {
        self.recognised = self.horizon.extent().finished;
        let back = self.horizon.offset();
        self.stage = match self.ours {
            Some(_) => Stage::Record,
            None => Stage::Recognising(Box::new(Recognising { back, ..Recognising::default() })),
        };
    }

    pub(super) fn recognise(&mut self) -> Result<(), Stop> {
        let Stage::Recognising(mut recognising) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let back = recognising.back;
        let ours = match recognising.read(&mut self.horizon) {
            Err(stop @ Stop::Read { .. }) => {
                self.stage = Stage::Recognising(recognising);
                return Err(stop);
            }
            ours => ours.unwrap_or_default(),
        };
        self.horizon.jump(back);
        self.stage = Stage::Record;
        self.ours = ours.filter(|ours| back <= ours.prefix);
        if let Some(ours) = &self.ours {
            self.horizon.set_extent(Extent { length: ours.original(), finished: true });
        }
        Ok(())
    }

    /// Whether an original is being scanned in a file of this length. One that grows was no annotated recording.
    pub(super) fn is_still(&mut self, length: u64) -> bool {
        let Some(ours) = self.within().cloned() else { return false };
        if ours.extent.length != length {
            self.horizon.jump(self.horizon.offset().min(ours.prefix));
            self.horizon.set_extent(ours.extent);
            self.ours = None;
        }
        ours.extent.length == length
    }

    /// The file will not grow any more.
    pub(super) fn finish_ours(&mut self) {
        self.ours.iter_mut().for_each(|ours| ours.extent.finished = true);
    }

    /// The original that is being scanned, if it stands inside an annotated recording.
    fn within(&self) -> Option<&Ours> {
        self.ours.as_ref().filter(|ours| ours.within)
    }

    /// Where a byte of what is being scanned stands in the file.
    pub(super) fn place(&self, offset: u64) -> u64 {
        match self.within() {
            Some(ours) if offset >= ours.prefix => offset - ours.prefix + ours.tail.start,
            _ => offset,
        }
    }

    /// How many bytes from there on stand in one piece.
    pub(super) fn room(&self, offset: u64) -> u64 {
        match self.within() {
            Some(ours) if offset < ours.prefix => ours.prefix - offset,
            Some(ours) => ours.original().saturating_sub(offset),
            None => u64::MAX,
        }
    }

    /// Whether the offsets in a record are those in the file.
    pub(super) fn stands_in_place(&self, frame: Frame) -> bool {
        self.within().is_none_or(|ours| frame.end() <= ours.prefix)
    }

    /// Whether we wrote a record behind the original.
    pub(super) fn is_ours(&self, frame: Frame) -> bool {
        self.ours.as_ref().is_some_and(|ours| !ours.within && frame.offset >= ours.prefix)
    }

    /// All that is whole in the original has been told: goes on with what stands behind its prefix.
    pub(super) fn leaves_original(&mut self) -> bool {
        let Some(ours) = self.within().filter(|ours| self.horizon.offset() >= ours.whole).cloned() else {
            return false;
        };
        let in_one_piece = ours.whole == ours.prefix;
        if !in_one_piece && self.close_chunk(None) {
            return true;
        }
        self.horizon.set_extent(ours.extent);
        self.horizon.jump(ours.prefix);
        (self.guide, self.found, self.trusted, self.orphans) = Default::default();
        self.inventory.prefix = ours.prefix;
        if !in_one_piece {
            // For whoever takes the file for an original, nothing is lost, and the records are where they are kept.
            self.data_crc.update(None);
            self.inventory.lost.clear();
            let further = ours.tail.start - ours.prefix;
            self.inventory.summary.relocate(|offset| if offset < ours.prefix { offset } else { offset + further });
        }
        self.ours = Some(Ours { within: false, ..ours });
        true
    }

    /// Passes over a record that was told where it is kept; what it defines counts here, too.
    pub(super) fn pass_told(&mut self, frame: Frame) -> bool {
        let told = self.ours.as_ref().filter(|ours| !ours.within && ours.recovered.contains(&frame.offset));
        let Some(end) = told.map(|ours| ours.recovered.end) else { return false };
        if matches!(frame.opcode, op::SCHEMA | op::CHANNEL) && frame.end() <= end {
            return false;
        }
        self.horizon.seek(frame.end().min(end));
        self.inventory.prefix = self.horizon.offset();
        true
    }
}
