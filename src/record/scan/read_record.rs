//! Beginning of a recording, and its records one by one.

use mcap::MAGIC;

use super::Scan;
use super::bounds::Bounds;
use super::search::ZEROS;
use super::stage::Stage;
use super::swallowed::LOOK;
use crate::record::Error;
use crate::record::frame_window::{Frame, Stop};
use crate::record::wire::{FRAME, op};

impl Scan {
    pub(super) fn magic(&mut self) -> Result<Result<(), Stop>, Error> {
        match self.window.peek(MAGIC.len()) {
            Ok(found) if found == MAGIC => {
                self.data_crc.begin();
                self.consume(MAGIC.len() as u64);
                self.inventory.prefix = MAGIC.len() as u64;
                self.look_at_end();
                Ok(Ok(()))
            }
            Ok(found) => Err(Error::NotMcap { found: found.to_vec() }),
            Err(Stop::End) => Err(Error::Empty),
            Err(Stop::Cut { .. }) => Err(Error::NotMcap { found: self.window.buffered().to_vec() }),
            Err(stop) => Ok(Err(stop)),
        }
    }

    pub(super) fn record(&mut self) -> Result<(), Stop> {
        if self.window.extent().finished && !self.recognised {
            self.look_at_end();
            return Ok(());
        }
        if self.leaves_original() || self.pass_known() {
            return Ok(());
        }
        let frame = match self.window.frame() {
            Err(Stop::Cut { claimed }) if !self.summary.begun => return self.cut(claimed),
            frame => frame?,
        };
        if self.pass_told(frame) {
            return Ok(());
        }
        let bounds = self.bounds(frame)?;
        let is_in_disguise = self.is_index_in_disguise(frame)?;
        if let Some(chunk) = &mut self.indexes.chunk {
            chunk.followed |= is_in_disguise || frame.opcode == op::MESSAGE_INDEX;
        }
        if is_in_disguise {
            self.reject(frame, "a message index whose opcode is wrong");
            self.pass(frame);
            return Ok(());
        }
        let is_lost = matches!(bounds, Bounds::Lost(_)) || frame.opcode == 0;
        if is_lost && !self.window.extent().finished {
            // It may still become a record, even one that belongs to the previous chunk.
            return Err(Stop::Wait);
        }
        if frame.opcode == 0 && !self.summary.begun && self.ends_in_a_few_zeros(frame)? {
            return self.end(ZEROS);
        }
        if self.awaits_filling(frame)? {
            return Err(Stop::Wait);
        }
        if frame.opcode != op::MESSAGE_INDEX && self.close_chunk(matches!(bounds, Bounds::Sound).then_some(frame)) {
            return Ok(());
        }
        match bounds {
            Bounds::Sound if self.summary.begun => self.summary_record(frame),
            Bounds::Sound => self.data_record(frame),
            Bounds::Ends(next) => {
                self.sync.looked += frame.length.min(LOOK);
                self.indexes.orphans = true;
                self.inventory.lose(frame.offset..next);
                self.damage(
                    frame.offset,
                    next - frame.offset,
                    format!("a record of opcode {} whose length is wrong", frame.opcode),
                );
                self.window.seek(next);
                Ok(())
            }
            Bounds::Lost(search) => self.lose(search, frame.opcode),
        }
    }

    /// Whether only zeros are left of the recording, so few that each would pass for a record.
    fn ends_in_a_few_zeros(&self, frame: Frame) -> Result<bool, Stop> {
        let left = self.window.extent().length - frame.offset;
        Ok(left <= 8 * FRAME as u64 && self.window.peek(left as usize)?.iter().all(|&byte| byte == 0))
    }

    /// Whether a recorder that reserved room may still be filling in this record: the recording grows, and zeros follow.
    fn awaits_filling(&self, frame: Frame) -> Result<bool, Stop> {
        let extent = self.window.extent();
        let is_judged = !extent.finished && frame.end() < extent.length;
        if !is_judged || frame.length > self.limits.record.max(self.limits.chunk) {
            return Ok(false);
        }
        let followed = self.window.peek(FRAME + frame.length as usize + 1)?;
        Ok(followed.last() == Some(&0))
    }

    /// Continues after a record. The prefix extends through the last record before DataEnd.
    pub(super) fn pass(&mut self, frame: Frame) {
        self.consume(frame.end() - self.window.offset());
        if !self.summary.begun {
            self.inventory.prefix = frame.end();
        }
        self.stage = Stage::Record;
    }
}
