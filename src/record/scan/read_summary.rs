//! Records after DataEnd, and the end of the recording.

use mcap::MAGIC;

use super::Scan;
use super::stage::{Stage, Step};
use super::summary_section::{CrcVerdict, RecordVerdict, SummarySection};
use crate::record::frame_window::{Frame, Stop};
use crate::record::inventory::Learned;
use crate::record::wire::{FRAME, op};
use crate::record::{Channel, Schema};

impl Scan {
    pub(super) fn summary_record(&mut self, frame: Frame) -> Result<(), Stop> {
        if frame.length > self.limits.record {
            return self.end(format!("a record of {} bytes in the summary (limits.record_mib)", frame.length));
        }
        let kept = match self.summary.room_for(frame, &self.limits) {
            Ok(kept) => kept,
            Err(what) => return self.end(what),
        };
        let whole = self.window.peek(FRAME + frame.length as usize)?;
        if frame.opcode == op::FOOTER {
            let verdict = self.summary.close(whole);
            self.footer(frame, verdict);
            return Ok(());
        }
        match self.summary.take_record(frame.opcode, whole, &self.inventory) {
            RecordVerdict::Kept => self.summary.kept = kept,
            RecordVerdict::Passed => {}
            RecordVerdict::Malformed => self.reject(frame, "a malformed record in the summary"),
        }
        self.pass(frame);
        Ok(())
    }

    fn footer(&mut self, frame: Frame, verdict: CrcVerdict) {
        match verdict {
            CrcVerdict::Malformed => self.reject(frame, "a malformed footer"),
            CrcVerdict::Wrong => {
                self.damage(frame.offset, 0, "the summary's CRC does not hold: what only the summary says is not used");
                self.summary = SummarySection { begun: true, ..SummarySection::default() };
            }
            CrcVerdict::Sound => {}
        }
        self.accept_summary();
        self.pass(frame);
        self.stage = Stage::EndMagic;
    }

    /// Learns what only the summary defines.
    pub(super) fn accept_summary(&mut self) {
        let SummarySection { schemas, channels, private, .. } = std::mem::take(&mut self.summary);
        self.summary.begun = true;
        let offset = self.window.offset();
        for what in self.learn_from_summary(schemas, channels) {
            self.damage(offset, 0, what);
        }
        for (opcode, record) in private {
            self.inventory.summary.private.entry(opcode).or_default().extend(record);
        }
    }

    /// Learns schemas and channels that only the summary defines, as far as the limits allow. Returns what is wrong with
    /// the others, where it contradicts the data for instance.
    pub(super) fn learn_from_summary(&mut self, schemas: Vec<Schema>, channels: Vec<Channel>) -> Vec<String> {
        let (mut faults, mut refused) = (Vec::new(), None);
        let contradicts = |what: String| format!("the summary contradicts the data on {what}");
        for schema in schemas {
            let id = schema.id;
            if let Some(what) = self.inventory.refuses_schema(&schema, &self.limits) {
                refused = refused.or(Some(what));
                continue;
            }
            match self.inventory.learn_schema(schema) {
                Learned::New => {
                    self.inventory.summary_only.schemas.push(id);
                    self.queue.push_back(Step::Schema(id));
                }
                Learned::Known => {}
                Learned::Contradicted => faults.push(contradicts(format!("schema {id}"))),
            }
        }
        for channel in channels {
            let id = channel.id;
            if let Some(what) = self.inventory.refuses_channel(&channel, &self.limits) {
                refused = refused.or(Some(what));
                continue;
            }
            match self.inventory.learn_channel(channel) {
                Learned::New => {
                    self.inventory.summary_only.channels.push(id);
                    self.queue.push_back(Step::Channel(id));
                }
                Learned::Known => {}
                Learned::Contradicted => faults.push(contradicts(format!("channel {id}"))),
            }
        }
        faults.extend(refused);
        faults
    }

    /// Reports bytes after the closing magic, which no reader reads.
    fn behind_the_end(&mut self) -> Result<(), Stop> {
        let end = self.window.offset() + MAGIC.len() as u64;
        let left = self.window.extent().length.saturating_sub(end);
        if left == 0 {
            return Ok(());
        }
        let seen = left.min(MAGIC.len() as u64) as usize;
        let what = match self.window.peek(MAGIC.len() + seen)?.get(MAGIC.len()..) {
            // Room that its recorder is about to give back.
            Some(bytes) if !self.window.extent().finished && bytes.iter().all(|&byte| byte == 0) => {
                return Err(Stop::Wait);
            }
            Some(MAGIC) => format!(
                "another recording of {left} bytes begins behind the end of this one: cut it off with `tail -c +{}`, and \
                 annotate both",
                end + 1
            ),
            _ if left == 1 => "1 byte behind the end of the recording, which is not read".to_owned(),
            _ => format!("{left} bytes behind the end of the recording, which are not read"),
        };
        self.damage(end, left, what);
        Ok(())
    }

    pub(super) fn end_magic(&mut self) -> Result<(), Stop> {
        match self.window.peek(MAGIC.len()) {
            Ok(found) if found == MAGIC => {
                self.behind_the_end()?;
                self.inventory.finished = true;
                self.queue.push_back(Step::End);
                self.stage = Stage::Done;
            }
            Err(stop @ (Stop::Read { .. } | Stop::Wait)) => return Err(stop),
            Ok(_) | Err(_) => return self.end("the closing magic is missing behind the footer"),
        }
        Ok(())
    }
}
