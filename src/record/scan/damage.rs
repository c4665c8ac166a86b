//! Reaction of the scan to damage: it continues after a record whose framing is sound, [searches](super::resync) where
//! the framing is lost, or ends.

use mcap::MAGIC;

use super::Scan;
use super::event::Damage;
use super::search::Search;
use super::stage::{Stage, Step};
use crate::record::frame_window::{Frame, Stop};
use crate::record::plausibility::Measure;
use crate::record::wire::{FRAME, op};

impl Scan {
    /// Handles a record that runs past the end of the recording: it was cut off, or its length is corrupt.
    pub(super) fn cut(&mut self, claimed: u64) -> Result<(), Stop> {
        let Ok(head) = self.window.peek(FRAME) else {
            return self.end("the recording ends in the midst of a record: it was cut off");
        };
        let frame =
            Frame { offset: self.window.offset(), opcode: head.first().copied().unwrap_or_default(), length: claimed };
        let content = self.measured(frame, u64::MAX)?;
        let left = self.window.extent().length - frame.offset - FRAME as u64;
        let is_attachment = frame.opcode == op::ATTACHMENT && self.attachment_begins()?;
        match (frame.opcode, content) {
            (op::CHUNK, _) if claimed == u64::MAX => self.end("the recording ends in a chunk that was never closed"),
            // Both lengths agree, so the record was merely cut off.
            (op::CHUNK | op::ATTACHMENT, Measure::Says(length)) if length == claimed => self.end(cut_off(claimed)),
            (_, Measure::Says(length)) if is_attachment && length > left => self.end(cut_off(claimed)),
            (opcode, content) => self.lose(Search::behind(frame, content).saying(cut_off(claimed)), opcode),
        }
    }

    pub(super) fn damage(&mut self, offset: u64, length: u64, what: impl Into<String>) {
        self.inventory.damage += 1;
        let mut what = what.into();
        if offset == MAGIC.len() as u64 && offset.saturating_add(length) < self.window.extent().length {
            what.push_str(
                " (in the place of the header: who insists on one, as Foxglove does, opens no copy of this either)",
            );
        }
        self.queue.push_back(Step::Damage(Damage { offset, length, what }));
    }

    /// Rejects a damaged record whose framing is sound.
    pub(super) fn reject(&mut self, frame: Frame, what: impl Into<String>) {
        self.inventory.lose(frame.offset..frame.end());
        self.damage(frame.offset, frame.end() - frame.offset, what);
    }

    /// Ends the scan, since nothing can be read from here on. In a growing recording, once it is finished: until then it
    /// is unknown how much is lost.
    pub(super) fn end(&mut self, what: impl Into<String>) -> Result<(), Stop> {
        if !self.window.extent().finished {
            return Err(Stop::Wait);
        }
        if self.close_chunk(None) {
            return Ok(());
        }
        self.accept_summary();
        let offset = self.window.offset();
        self.damage(offset, self.window.extent().length.saturating_sub(offset), what);
        self.queue.push_back(Step::End);
        self.stage = Stage::Done;
        Ok(())
    }
}

fn cut_off(claimed: u64) -> String {
    format!("a record of {claimed} bytes runs past the end of the recording: it was cut off, or the length is corrupt")
}
