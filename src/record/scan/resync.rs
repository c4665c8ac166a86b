//! Resynchronisation: the next whole record is where the summary's index says, or else at the first place where bytes
//! look like a record that another one follows. Attachments are skipped, since one may contain records.

use super::Scan;
use super::search::{HEAD, REACH, Search, ZEROS};
use super::stage::{Stage, Step};
use super::swallowed::LOOK;
use crate::record::chunk::knows;
use crate::record::frame_window::{Frame, Stop};
use crate::record::plausibility::{Measure, SPARE, end, fits, head};
use crate::record::records::{AttachmentIndex, ChunkHeader, parse_metadata};
use crate::record::wire::{DATA_END, FRAME, Fields, op};
use crate::record::{Channel, Schema};

impl Scan {
    /// Handles lost framing. A growing recording is not read any further until it is finished.
    pub(super) fn lose(&mut self, mut search: Search, opcode: u8) -> Result<(), Stop> {
        if !self.window.extent().finished {
            return Err(self.window.wait());
        }
        if self.early_summary.is_none() {
            return self.ask();
        }
        if self.close_chunk(None) {
            return Ok(());
        }
        self.indexes.orphans = true;
        let length = self.window.extent().length;
        search.tries.retain(|&offset| offset <= length);
        if opcode == op::ATTACHMENT && self.attachment_begins()? {
            // Never search inside an attachment, whatever ends here.
            search.from = search.tries.last().copied().unwrap_or(length);
        }
        self.stage = Stage::Searching(search);
        Ok(())
    }

    /// Whether an attachment begins here, by its times, names and sizes: its opcode alone may be any byte of a message.
    pub(super) fn attachment_begins(&self) -> Result<bool, Stop> {
        let left = self.window.extent().length.saturating_sub(self.window.offset());
        let bytes = self.window.peek(left.min(FRAME as u64 + HEAD) as usize)?;
        let mut fields = Fields(bytes.get(FRAME..).unwrap_or_default());
        let head = AttachmentIndex::parse_attachment(&mut fields, 0, 0);
        Ok(head.is_some_and(|head| fits(op::ATTACHMENT, head.data_size.saturating_add(36))))
    }

    pub(super) fn search(&mut self) -> Result<(), Stop> {
        let Stage::Searching(mut search) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let found = match self.tried(&mut search) {
            Ok(None) => self.next_whole(&mut search),
            found => found,
        };
        match found {
            Ok(found) => self.go_on(search, found),
            // There is nothing to wait for, since the recording is finished.
            Err(stop @ Stop::Read { .. }) => {
                self.stage = Stage::Searching(search);
                return Err(stop);
            }
            Err(_) => self.go_on(search, None),
        }
        Ok(())
    }

    fn go_on(&mut self, search: Search, found: Option<u64>) {
        let next = found.unwrap_or(self.window.extent().length);
        if search.confirming.contains(&next) {
            self.sync.trusted = Some(search.offset);
            self.window.seek(search.offset);
            self.stage = Stage::Record;
            return;
        }
        self.inventory.lose(search.offset..next);
        let what = if search.blank && found.is_none() { ZEROS.to_owned() } else { search.what };
        self.damage(search.offset, next - search.offset, what);
        match found {
            Some(next) => {
                self.window.seek(next);
                self.stage = Stage::Record;
            }
            None => {
                self.accept_summary();
                self.queue.push_back(Step::End);
                self.stage = Stage::Done;
            }
        }
    }

    /// First of the possible ends of the record that another record follows.
    fn tried(&mut self, search: &mut Search) -> Result<Option<u64>, Stop> {
        while let Some(&offset) = search.tries.first() {
            self.window.seek(offset);
            if self.goes_on_at(offset)? {
                return Ok(Some(offset));
            }
            search.tries.remove(0);
        }
        Ok(None)
    }

    fn next_whole(&mut self, search: &mut Search) -> Result<Option<u64>, Stop> {
        if let Some(found) = self.sync.found_from(search.from) {
            search.blank = false;
            return Ok(found);
        }
        search.at = search.at.max(search.from);
        let found = loop {
            if search.at >= self.window.extent().length {
                break None;
            }
            self.window.seek(search.at);
            let landmark = self.early_summary.as_ref().and_then(|summary| summary.at_or_behind(search.at));
            match landmark {
                Some(landmark) if landmark.offset == search.at && self.stands(landmark.opcode, landmark.length)? => {
                    break Some(search.at);
                }
                Some(landmark) if landmark.offset <= search.at && landmark.opcode == op::ATTACHMENT => {
                    search.at = landmark.offset + landmark.length;
                    continue;
                }
                _ => {}
            }
            let indexed = self.early_summary.as_ref().is_some_and(|summary| summary.indexed);
            let next =
                self.early_summary.as_ref().and_then(|summary| summary.behind(search.at)).map(|next| next.offset);
            search.blank &= !indexed;
            match (indexed, next) {
                (true, Some(next)) => search.at = next,
                (true, None) => break None,
                (false, next) => {
                    let until = next.unwrap_or(self.window.extent().length);
                    let candidate = self.candidate(until, &mut search.blank);
                    search.at = self.window.offset();
                    if let Some(offset) = candidate? {
                        break Some(offset);
                    }
                }
            }
        };
        self.sync.note_found(search.from, found);
        Ok(found)
    }

    /// Whether a record with this opcode and this total length begins here.
    fn stands(&self, opcode: u8, length: u64) -> Result<bool, Stop> {
        let found = self.window.peek(FRAME).map(head)?;
        Ok(found.is_some_and(|(found, body)| found == opcode && end(0, body) == length))
    }

    /// Offset of the next credible record before `until`. Without one, the window is at `until`. Notes whether what was
    /// passed is blank.
    fn candidate(&mut self, until: u64, blank: &mut bool) -> Result<Option<u64>, Stop> {
        while self.window.offset() < until {
            self.window.peek(FRAME)?;
            let room = until - self.window.offset();
            let places = self.window.buffered().windows(FRAME).take(room as usize);
            let could = |bytes: &[u8]| head(bytes).is_some_and(|(opcode, length)| fits(opcode, length));
            match places.clone().position(could) {
                Some(ahead) => {
                    *blank = false;
                    self.window.skip(ahead as u64);
                }
                None => {
                    let passed = places.len();
                    let bytes = self.window.buffered().get(..passed + FRAME - 1).unwrap_or_default();
                    *blank = *blank && bytes.iter().all(|&byte| byte == 0);
                    self.window.skip(passed as u64);
                    continue;
                }
            }
            if self.is_credible(until)? {
                return Ok(Some(self.window.offset()));
            }
            self.window.skip(1);
        }
        Ok(None)
    }

    fn is_credible(&mut self, until: u64) -> Result<bool, Stop> {
        let frame = match self.window.frame() {
            Ok(frame) if frame.end() <= until => frame,
            Ok(_) | Err(Stop::Cut { .. }) => return Ok(false),
            Err(stop) => return Err(stop),
        };
        // In a recording with chunks, a message outside is probably inside a chunk that lost its head.
        let loose = !self.has_chunks();
        match frame.opcode {
            op::MESSAGE => return Ok(loose && frame.length <= LOOK && self.chain_at(frame.end())?),
            op::SCHEMA | op::CHANNEL | op::METADATA
                if frame.length > HEAD && self.sync.has_doubted_enough(frame.offset) =>
            {
                return Ok(false);
            }
            op::SCHEMA | op::CHANNEL if loose => {}
            op::CHUNK | op::MESSAGE_INDEX | op::ATTACHMENT | op::METADATA | op::DATA_END | op::FOOTER => {}
            _ => return Ok(false),
        }
        match self.measured(frame, frame.length)? {
            Measure::Says(length) if length == frame.length => {}
            // Unknown fields may follow if a record follows them.
            Measure::Says(length)
                if length < frame.length && frame.length - length <= SPARE && self.chain_at(frame.end())? => {}
            _ => return Ok(false),
        }
        let most = if matches!(frame.opcode, op::CHUNK | op::ATTACHMENT) { HEAD } else { REACH };
        let body = self.window.body(frame, most)?;
        let mut fields = Fields(body);
        let looked_at = body.len() as u64;
        let credible = match frame.opcode {
            op::CHUNK => ChunkHeader::parse(&mut fields).is_some_and(|header| {
                knows(header.compression)
                    && header.uncompressed_size <= self.limits.chunk
                    && header.start_time <= header.end_time
            }),
            op::ATTACHMENT => AttachmentIndex::parse_attachment(&mut fields, 0, 0).is_some(),
            op::MESSAGE_INDEX => frame.length % 16 == 6 && self.begins_at(frame.end())?,
            // Cheap check first.
            op::METADATA => self.begins_at(frame.end())? && parse_metadata(body).is_some(),
            op::SCHEMA => self.begins_at(frame.end())? && Schema::parse(body).is_some(),
            op::CHANNEL => self.begins_at(frame.end())? && Channel::parse(body).is_some(),
            op::FOOTER => frame.end() + 8 == self.window.extent().length,
            _ => {
                let behind = self.look(frame.end())?.and_then(|bytes| bytes.first().copied());
                behind.is_none_or(may_follow_data) && self.chain_at(frame.end())?
            }
        };
        if !credible {
            self.sync.doubted += looked_at;
        }
        Ok(credible)
    }

    /// Whether a DataEnd record is real. A message or private record with a wrong opcode may look like one; data
    /// follows then.
    pub(super) fn is_end_of_data(&self, frame: Frame) -> Result<bool, Stop> {
        /// Most definitions skipped to find what follows, since they may belong to the summary or to the data.
        const DEFINITIONS: usize = 256;
        let is_usual = frame.length == DATA_END - FRAME as u64;
        let mut place = frame.end();
        let mut behind = self.look(place)?;
        for _ in 0..if is_usual { 0 } else { DEFINITIONS } {
            let definition = |&(opcode, length): &(u8, u64)| is_definition(opcode) && fits(opcode, length);
            let Some((_, length)) = behind.and_then(head).filter(definition) else { break };
            place = end(place, length);
            behind = self.look(place)?;
        }
        if behind.and_then(|bytes| bytes.first().copied()).is_none_or(may_follow_data) {
            return Ok(true);
        }
        if !is_usual {
            return Ok(false);
        }
        // A record of the usual length is real unless data follows beyond doubt.
        let data = |bytes: &[u8]| head(bytes).filter(|&(opcode, length)| is_data(opcode) && fits(opcode, length));
        let Some((_, length)) = behind.and_then(data) else { return Ok(true) };
        let next = self.look(end(frame.end(), length))?;
        Ok(next.and_then(data).is_none())
    }
}

/// Whether a record of this opcode occurs in both the data and the summary.
fn is_definition(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL)
}

/// Whether a record of this opcode may begin the summary section.
fn may_follow_data(opcode: u8) -> bool {
    opcode != 0 && opcode != op::HEADER && !is_data(opcode)
}

/// Whether a record of this opcode occurs before the summary section only.
fn is_data(opcode: u8) -> bool {
    matches!(opcode, op::MESSAGE | op::CHUNK | op::MESSAGE_INDEX | op::ATTACHMENT | op::METADATA | op::DATA_END)
}
