//! Content of the summary section, read ahead of time: when the framing is lost, or a message's channel is unknown. In
//! its turn, the section is read by [`read_summary`](super::read_summary).

use crc32fast::Hasher;
use mcap::MAGIC;

use crate::record::footer::{CLOSING, Footer};
use crate::record::frame_window::{Frame, FrameWindow, Stop};
use crate::record::limits::Limits;
use crate::record::records::{AttachmentIndex, ChunkIndex, MetadataIndex};
use crate::record::wire::{DATA_END, FRAME, op};
use crate::record::{Channel, Schema};

/// Most landmarks that are kept: those of a recording of 2 TB in chunks of 1 MB.
const LANDMARKS: usize = 1 << 21;

/// Places of whole records. Empty if the recording has no valid summary.
#[derive(Debug, Default)]
pub(super) struct EarlySummary {
    /// Landmarks in file order, none within another.
    landmarks: Vec<Landmark>,
    /// Whether the chunks are among them, so that there is nothing to search between landmarks.
    pub(super) indexed: bool,
    /// Offset of the end of the data section.
    data_end: Option<u64>,
}

/// A record that the summary names.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landmark {
    pub(super) offset: u64,
    /// Length of the whole record, in bytes.
    pub(super) length: u64,
    pub(super) opcode: u8,
}

impl EarlySummary {
    /// Landmark that contains `offset`, or else the next one after it.
    pub(super) fn at_or_behind(&self, offset: u64) -> Option<Landmark> {
        self.landmarks
            .get(self.landmarks.partition_point(|mark| mark.offset.saturating_add(mark.length) <= offset))
            .copied()
    }

    /// First landmark that begins after `offset`.
    pub(super) fn behind(&self, offset: u64) -> Option<Landmark> {
        self.landmarks.get(self.landmarks.partition_point(|mark| mark.offset <= offset)).copied()
    }

    /// Whether an offset lies in the summary section.
    pub(super) fn is_behind_data(&self, offset: u64) -> bool {
        self.data_end.is_some_and(|end| offset >= end)
    }

    fn settle(&mut self, data: u64) {
        self.landmarks.sort_unstable_by_key(|mark| mark.offset);
        let mut free = MAGIC.len() as u64;
        for mark in &self.landmarks {
            let end = mark.offset.checked_add(mark.length).filter(|&end| end <= data && mark.offset >= free);
            let Some(end) = end else {
                *self = Self::default();
                return;
            };
            free = end;
        }
    }
}

/// Summary that is being read.
pub(super) struct Asking {
    /// Offset at which to continue afterwards.
    pub(super) back: u64,
    /// Footer, once it was read.
    footer: Option<Footer>,
    crc: Hasher,
    found: EarlySummary,
    /// Memory of the records below, in bytes.
    kept: u64,
    schemas: Vec<Schema>,
    channels: Vec<Channel>,
    limits: Limits,
}

impl Asking {
    pub(super) fn new(back: u64, limits: Limits) -> Self {
        let (found, schemas, channels) = Default::default();
        Self { back, footer: None, crc: Hasher::new(), found, kept: 0, schemas, channels, limits }
    }

    /// Reads on. Returns whether the whole section is in order.
    pub(super) fn read(&mut self, window: &mut FrameWindow) -> Result<bool, Stop> {
        let length = window.extent().length;
        let Footer { section, crc: stored, .. } = match &self.footer {
            Some(footer) => footer.clone(),
            None => {
                let Some(offset) = length.checked_sub(CLOSING as u64) else { return Ok(false) };
                window.seek(offset);
                let Some(footer) = Footer::parse(window.peek(CLOSING)?, offset) else { return Ok(false) };
                window.seek(footer.section.start);
                self.footer.insert(footer).clone()
            }
        };
        let footer = section.end;
        while window.offset() < footer {
            let frame = window.frame()?;
            if frame.length > self.limits.record || frame.end() > footer {
                return Ok(false);
            }
            let whole = window.peek(FRAME + frame.length as usize)?;
            self.crc.update(whole);
            if self.note(frame, whole.get(FRAME..).unwrap_or_default()).is_none() {
                return Ok(false);
            }
            window.skip(frame.end() - frame.offset);
        }
        // The CRC covers the footer up to the CRC itself.
        self.crc.update(window.peek(FRAME + 16)?);
        Ok(stored == 0 || stored == self.crc.clone().finalize())
    }

    fn note(&mut self, frame: Frame, body: &[u8]) -> Option<()> {
        self.kept += if matches!(frame.opcode, op::SCHEMA | op::CHANNEL) { frame.length + 256 } else { 0 };
        if self.kept > self.limits.definitions.saturating_mul(2) {
            return None;
        }
        let (offset, length, opcode) = match frame.opcode {
            op::SCHEMA => {
                self.schemas.push(Schema::parse(body)?);
                return Some(());
            }
            op::CHANNEL => {
                self.channels.push(Channel::parse(body)?);
                return Some(());
            }
            op::CHUNK_INDEX => ChunkIndex::parse(body).map(|index| (index.offset, index.length, op::CHUNK))?,
            op::ATTACHMENT_INDEX => {
                AttachmentIndex::parse(body).map(|index| (index.offset, index.length, op::ATTACHMENT))?
            }
            op::METADATA_INDEX => MetadataIndex::parse(body).map(|index| (index.offset, index.length, op::METADATA))?,
            _ => return Some(()),
        };
        self.found.indexed |= opcode == op::CHUNK;
        self.found.landmarks.push(Landmark { offset, length, opcode });
        (self.found.landmarks.len() <= LANDMARKS).then_some(())
    }

    pub(super) fn into_parts(mut self) -> (EarlySummary, Vec<Schema>, Vec<Channel>) {
        let start = self.footer.as_ref().map_or(DATA_END, |footer| footer.section.start);
        let data = start - DATA_END;
        self.found.landmarks.push(Landmark { offset: data, length: DATA_END, opcode: op::DATA_END });
        self.found.data_end = Some(start);
        self.found.settle(start);
        (self.found, self.schemas, self.channels)
    }
}
