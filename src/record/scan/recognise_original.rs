//! Recognition of an annotated recording by its end, to scan its original as if it stood alone.

use super::Scan;
use super::original::{Ours, Recognising};
use super::stage::Stage;
use crate::record::frame_window::{Extent, Frame, Stop};
use crate::record::limits::Limits;
use crate::record::wire::op;

impl Scan {
    /// Starts to look for traces of Stillpoint at the end of the recording, to return here afterwards.
    pub(super) fn look_at_end(&mut self) {
        self.recognised = self.window.extent().finished;
        let back = self.window.offset();
        self.stage = match self.ours {
            Some(_) => Stage::Record,
            None => Stage::Recognising(Box::new(Recognising { back, ..Recognising::default() })),
        };
    }

    pub(super) fn recognise(&mut self) -> Result<(), Stop> {
        let Stage::Recognising(mut recognising) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let back = recognising.back;
        let ours = match recognising.read(&mut self.window) {
            Err(stop @ Stop::Read { .. }) => {
                self.stage = Stage::Recognising(recognising);
                return Err(stop);
            }
            ours => ours.unwrap_or_default(),
        };
        self.window.jump(back);
        self.stage = Stage::Record;
        self.ours = ours.filter(|ours| back <= ours.prefix);
        if let Some(ours) = &self.ours {
            self.window.set_extent(Extent { length: ours.original(), finished: true });
        }
        Ok(())
    }

    /// Whether an original is being scanned in a file of this length. A file that grows is not an annotated recording.
    pub(super) fn is_still(&mut self, length: u64) -> bool {
        let Some(ours) = self.within().cloned() else { return false };
        if ours.extent.length != length {
            self.window.jump(self.window.offset().min(ours.prefix));
            self.window.set_extent(ours.extent);
            self.ours = None;
        }
        ours.extent.length == length
    }

    /// Notes that the file will not grow any more.
    pub(super) fn finish_ours(&mut self) {
        self.ours.iter_mut().for_each(|ours| ours.extent.finished = true);
    }

    /// Layout of the annotated recording whose original is being scanned, if any.
    fn within(&self) -> Option<&Ours> {
        self.ours.as_ref().filter(|ours| ours.within)
    }

    /// Offset in the file of a byte of what is being scanned.
    pub(super) fn place(&self, offset: u64) -> u64 {
        match self.within() {
            Some(ours) if offset >= ours.prefix => offset - ours.prefix + ours.tail.start,
            _ => offset,
        }
    }

    /// Number of contiguous bytes from an offset on.
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

    /// Whether Stillpoint wrote this record after the original.
    pub(super) fn is_ours(&self, frame: Frame) -> bool {
        self.ours.as_ref().is_some_and(|ours| !ours.within && frame.offset >= ours.prefix)
    }

    /// Limits of definitions at a record. What Stillpoint wrote after an original has room beside what the original may take.
    pub(super) fn limits_at(&self, frame: Frame) -> Limits {
        match self.is_ours(frame) {
            true => {
                Limits { definitions: self.limits.definitions.saturating_mul(2), channels: u64::MAX, ..self.limits }
            }
            false => self.limits,
        }
    }

    /// Leaves the original after its last whole record, to continue after its prefix in the file. Returns whether it
    /// changed the stage.
    pub(super) fn leaves_original(&mut self) -> bool {
        let Some(ours) = self.within().filter(|ours| self.window.offset() >= ours.whole).cloned() else {
            return false;
        };
        let in_one_piece = ours.whole == ours.prefix;
        if !in_one_piece && self.close_chunk(None) {
            return true;
        }
        self.window.set_extent(ours.extent);
        self.window.jump(ours.prefix);
        (self.early_summary, self.sync.found, self.sync.trusted, self.indexes.orphans) = Default::default();
        self.inventory.prefix = ours.prefix;
        if !in_one_piece {
            // Seen as an original itself, the file lost nothing, and the records are in the kept tail.
            self.data_crc.update(None);
            self.inventory.lost.clear();
            let further = ours.tail.start - ours.prefix;
            self.inventory.summary.relocate(|offset| if offset < ours.prefix { offset } else { offset + further });
        }
        self.ours = Some(Ours { within: false, ..ours });
        true
    }

    /// Skips a copied record, which was already emitted at the place where it is kept, except for definitions. Returns
    /// whether it skipped anything.
    pub(super) fn pass_told(&mut self, frame: Frame) -> bool {
        let told = self.ours.as_ref().filter(|ours| !ours.within && ours.recovered.contains(&frame.offset));
        let Some(end) = told.map(|ours| ours.recovered.end) else { return false };
        if matches!(frame.opcode, op::SCHEMA | op::CHANNEL) && frame.end() <= end {
            return false;
        }
        self.window.seek(frame.end().min(end));
        self.inventory.prefix = self.window.offset();
        true
    }
}
