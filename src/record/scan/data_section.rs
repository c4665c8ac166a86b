//! The records in front of DataEnd: chunks, messages, attachments, metadata.

use std::collections::BTreeMap;
use std::ops::Range;

use crc32fast::Hasher;
use serde::{Deserialize, Serialize};

use super::data_crc::DataCrc;
use super::reindexing::Reindexing;
use super::search::HEAD;
use super::{Scan, Stage, Step, Supply, within};
use crate::record::Message;
use crate::record::chunk::{Content, Inflate, LIMIT, Opened, Place, locate};
use crate::record::horizon::{Frame, Horizon, Stop};
use crate::record::inventory::Learned;
use crate::record::records::{AttachmentIndex, ChunkIndex, Header, MetadataIndex, parse_message_index, parse_metadata};
use crate::record::shape::{Measure, measure};
use crate::record::survey::{Survey, Tally};
use crate::record::wire::{FRAME, Fields, op};

/// How far the log time of a message outside the chunks may lie from theirs, in nanoseconds (a day).
const DAY: u64 = 86_400_000_000_000;

/// Records in order, from which messages are told.
pub(super) struct Telling {
    pub(super) frame: Frame,
    /// The bytes that hold the records, in front of the horizon or in `opened`.
    pub(super) data: Range<usize>,
    pub(super) place: Place,
    /// The chunk, if somebody else opened it.
    pub(super) opened: Option<Opened>,
    /// The record that is being told, within the records.
    pub(super) at: Range<usize>,
    /// Whether the end of a chunk is to be told.
    pub(super) ends: bool,
}

/// A chunk whose message indexes may follow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct OpenChunk {
    index: ChunkIndex,
    /// Its messages, by channel; `None` of a chunk that is not read.
    tallies: Option<BTreeMap<u16, Tally>>,
    /// First and last log time by the indexes of a chunk that is not read.
    span: Option<(u64, u64)>,
    /// Whether something that may have been a message index stood behind it, in order or not.
    pub(super) followed: bool,
}

impl OpenChunk {
    /// The channel that a message index is about, if what it says of its messages is true. Of a chunk that is not read,
    /// it is believed.
    fn agrees(&self, body: &[u8]) -> Option<u16> {
        let (channel, entries) = parse_message_index(body)?;
        let Some(tallies) = &self.tallies else { return Some(channel) };
        let mut told = Tally::default();
        entries.for_each(|(log_time, offset)| told.add(log_time, offset));
        (tallies.get(&channel).copied().unwrap_or_default() == told).then_some(channel)
    }

    /// Whether a record has no other content than the index of some of its messages.
    fn is_indexed_by(&self, body: &[u8]) -> bool {
        measure(op::MESSAGE_INDEX, body) == Measure::Says(body.len() as u64)
            && self
                .agrees(body)
                .zip(self.tallies.as_ref())
                .is_some_and(|(channel, tallies)| tallies.contains_key(&channel))
    }
}

impl Telling {
    /// The records from which is told.
    pub(super) fn records<'a>(&'a self, inflate: &'a Inflate, horizon: &'a Horizon) -> &'a [u8] {
        match &self.opened {
            Some(opened) => opened.records(self.place, &self.data),
            None => inflate.records(self.place, within(horizon, &self.data)),
        }
    }

    /// Goes on to the next message, if there is one.
    pub(super) fn advance(&mut self, inflate: &Inflate, horizon: &Horizon) -> bool {
        loop {
            let records = self.records(inflate, horizon);
            let mut rest = Fields(records.get(self.at.end..).unwrap_or_default());
            let before = rest.0.len();
            let Some((opcode, _)) = rest.record() else { return false };
            self.at = self.at.end..self.at.end + before - rest.0.len();
            if opcode == op::MESSAGE {
                return true;
            }
        }
    }
}

/// An attachment whose CRC is being computed; it is never held in memory.
pub(super) struct Attaching {
    frame: Frame,
    index: AttachmentIndex,
    crc: Hasher,
    left: u64,
}

impl Attaching {
    /// Takes what is buffered, until all attached bytes have been seen and the stored CRC is buffered.
    pub(super) fn hash(&mut self, horizon: &mut Horizon, data: &mut DataCrc) -> Result<(), Stop> {
        while self.left > 0 {
            horizon.peek(1)?;
            let buffered = horizon.buffered();
            let taken = buffered.get(..self.left.min(buffered.len() as u64) as usize).unwrap_or_default();
            self.crc.update(taken);
            data.update(Some(taken));
            let taken = taken.len() as u64;
            self.left -= taken;
            horizon.skip(taken);
        }
        horizon.peek(4).map(|_| ())
    }
}

impl Scan {
    pub(super) fn data_record(&mut self, frame: Frame) -> Result<(), Stop> {
        if frame.opcode != op::MESSAGE_INDEX {
            self.orphans = false;
        }
        match frame.opcode {
            op::CHUNK => return self.chunk_record(frame),
            op::ATTACHMENT => return self.attachment_record(frame),
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::MESSAGE_INDEX | op::METADATA
                if frame.length > LIMIT =>
            {
                self.reject(frame, format!("a record of {} bytes", frame.length));
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE => return self.loose_record(frame),
            op::HEADER => self.header_record(frame)?,
            op::MESSAGE_INDEX => self.message_index_record(frame)?,
            op::METADATA => self.metadata_record(frame)?,
            op::DATA_END => {
                let stored = Fields(self.horizon.body(frame, 4)?).u32().unwrap_or_default();
                self.check_data_crc(frame, stored);
                self.inventory.data_crc = Some(stored);
                self.summary.begun = true;
            }
            op::FOOTER => {
                self.damage(frame.offset, 0, "a footer, but the end of the data was not marked");
                self.summary.begun = true;
                return self.summary_record(frame);
            }
            // Records of private opcodes are none of our business.
            0x80.. => {}
            op::CHUNK_INDEX | op::ATTACHMENT_INDEX | op::STATISTICS | op::METADATA_INDEX | op::SUMMARY_OFFSET => {
                return self.stray_record(frame);
            }
            opcode => self.reject(frame, format!("a record of opcode {opcode}, which does not belong here")),
        }
        self.pass(frame);
        Ok(())
    }

    /// A record that belongs into the summary: the end of the data is damaged, unless it is the record itself.
    fn stray_record(&mut self, frame: Frame) -> Result<(), Stop> {
        match &self.guide {
            None => self.ask(),
            Some(guide) if guide.is_behind_data(frame.offset) => {
                self.damage(frame.offset, 0, "the end of the data was not marked");
                self.summary.begun = true;
                self.summary_record(frame)
            }
            Some(_) => {
                self.reject(frame, format!("a record of opcode {}, which does not belong here", frame.opcode));
                self.pass(frame);
                Ok(())
            }
        }
    }

    fn header_record(&mut self, frame: Frame) -> Result<(), Stop> {
        match Header::parse(self.horizon.body(frame, LIMIT)?) {
            Some(header) if self.inventory.header.is_none() => {
                self.inventory.header = Some(header);
                self.queue.push_back(Step::Header);
            }
            Some(_) => {}
            None => self.reject(frame, "a malformed header record"),
        }
        Ok(())
    }

    /// A schema, channel or message outside a chunk is treated as a chunk of one record.
    fn loose_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let size = FRAME + frame.length as usize;
        let whole = self.horizon.peek(size)?;
        let message = Message::parse(whole.get(FRAME..).unwrap_or_default()).filter(|_| frame.opcode == op::MESSAGE);
        let (channel, incredible) = match &message {
            Some(message) => (Some(message.channel), !self.is_credible_message(message)),
            None => (None, false),
        };
        match Survey::of(whole) {
            Ok(survey) if self.guide.is_none() && self.is_at_a_loss(&survey) => return self.ask(),
            Ok(_) if incredible => {
                self.reject(frame, "a message outside the chunks that fits nothing else");
                self.pass(frame);
            }
            Ok(survey) => {
                let ends = frame.opcode == op::MESSAGE;
                self.inventory.loose |= ends;
                if let Some(channel) = channel {
                    let (last, longest) = self.lengths.entry(channel).or_default();
                    (*last, *longest) = (frame.length, frame.length.max(*longest));
                }
                self.admit(frame, survey);
                self.stage =
                    Stage::Telling(Telling { frame, data: 0..size, place: Place::Plain, opened: None, at: 0..0, ends });
            }
            Err(what) => {
                self.reject(frame, what);
                self.pass(frame);
            }
        }
        Ok(())
    }

    /// Whether a message outside the chunks is one. Beside chunks there rarely are any, so that it is more likely to be
    /// another record whose opcode is damaged, unless it is like the messages in the chunks.
    fn is_credible_message(&self, message: &Message<'_>) -> bool {
        let known = self.inventory.channels().contains_key(&message.channel);
        match self.inventory.span() {
            Some((from, until)) if self.has_chunks() => {
                known && (from.saturating_sub(DAY)..=until.saturating_add(DAY)).contains(&message.log_time)
            }
            _ => known || !self.inventory.channels().is_empty(),
        }
    }

    /// Whether messages stand in chunks.
    pub(super) fn has_chunks(&self) -> bool {
        self.inventory.has_chunks() || self.guide.as_ref().is_some_and(|guide| guide.indexed)
    }

    /// Whether there are messages of channels that neither these records nor those before them define.
    fn is_at_a_loss(&self, survey: &Survey) -> bool {
        let known = |id: &u16| {
            self.inventory.channels().contains_key(id) || survey.channels.iter().any(|channel| channel.id == *id)
        };
        !survey.tallies.keys().all(known)
    }

    fn chunk_record(&mut self, frame: Frame) -> Result<(), Stop> {
        self.data_crc.chunk();
        let (opened, content) = match self.supply.take() {
            None if self.offering => {
                self.stage = Stage::Offering(frame);
                return Ok(());
            }
            Some(Supply::Unread) => return self.unread_chunk(frame),
            Some(Supply::Opened(mut opened)) if opened.length() == frame.length => {
                let content = opened.content.take().unwrap_or_else(|| Err("a chunk that was not opened".to_owned()));
                (Some(opened), content.map(|content| *content))
            }
            Some(Supply::Opened(_) | Supply::Absent) | None => (None, self.open_chunk(frame)?),
        };
        match content {
            Ok(Content { survey, .. }) if self.guide.is_none() && self.is_at_a_loss(&survey) => return self.ask(),
            Ok(Content { data, place, mut index, survey }) => {
                index.offset = frame.offset;
                index.length = frame.end() - frame.offset;
                let tallies = Some(survey.tallies.clone());
                self.admit(frame, survey);
                self.chunk = Some(OpenChunk { index, tallies, span: None, followed: false });
                self.stage = Stage::Telling(Telling { frame, data, place, opened, at: 0..0, ends: true });
            }
            Err(what) => {
                self.horizon.may_change(frame.end())?;
                self.spent = opened;
                self.reject(frame, what);
                self.orphans = true;
                self.pass(frame);
            }
        }
        Ok(())
    }

    pub(super) fn open_chunk(&mut self, frame: Frame) -> Result<Result<Content, String>, Stop> {
        let body = self.horizon.body(frame, HEAD)?;
        let data = match locate(body, frame.length) {
            Ok((_, data)) => FRAME + data.start..FRAME + data.end,
            Err(what) => return Ok(Err(what)),
        };
        self.horizon.peek(data.end)?;
        let body = self.horizon.body(frame, HEAD)?;
        Ok(locate(body, frame.length).and_then(|(header, _)| {
            let bytes = within(&self.horizon, &data);
            Content::of(&header, data, bytes, &mut self.inflate)
        }))
    }

    /// A chunk that is passed over: what is in it is what its message indexes say.
    fn unread_chunk(&mut self, frame: Frame) -> Result<(), Stop> {
        // Its head is short, whatever its compression is called.
        let head = self.horizon.body(frame, 128)?;
        match locate(head, frame.length).map(|(header, _)| header.index()) {
            Ok(index) => {
                let index = ChunkIndex { offset: frame.offset, length: frame.end() - frame.offset, ..index };
                self.chunk = Some(OpenChunk { index, tallies: None, span: None, followed: false });
                self.queue.push_back(Step::ChunkEnd);
            }
            Err(what) => {
                self.reject(frame, what);
                self.orphans = true;
            }
        }
        self.pass(frame);
        Ok(())
    }

    /// Notes what records in order define and hold.
    fn admit(&mut self, frame: Frame, survey: Survey) {
        self.inventory.count(&survey);
        for schema in survey.schemas {
            let id = schema.id;
            match self.inventory.learn_schema(schema) {
                Learned::New => self.queue.push_back(Step::Schema(id)),
                Learned::Known => {}
                Learned::Contradicted => {
                    self.damage(frame.offset, 0, format!("schema {id} is defined twice, differently"))
                }
            }
        }
        for channel in survey.channels {
            let id = channel.id;
            match self.inventory.learn_channel(channel) {
                Learned::New => self.queue.push_back(Step::Channel(id)),
                Learned::Known => {}
                Learned::Contradicted => {
                    self.damage(frame.offset, 0, format!("channel {id} is defined twice, differently"));
                }
            }
        }
    }

    fn message_index_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let body = self.horizon.body(frame, LIMIT)?;
        let about = parse_message_index(body).map(|(channel, _)| channel);
        let agrees = self.chunk.as_ref().is_some_and(|chunk| chunk.agrees(body).is_some());
        let Some(channel) = about else {
            self.reject(frame, "a malformed message index");
            return Ok(());
        };
        self.inventory.mentioned.insert(channel);
        match &mut self.chunk {
            Some(OpenChunk { index, tallies, span, .. }) if agrees => {
                if tallies.is_none() && !index.message_indexes.contains_key(&channel) {
                    let (count, times) = extent(body);
                    *span = span.iter().chain(&times).copied().reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
                    self.inventory.count_unread(channel, count, times);
                }
                // Readers take all indexes of a chunk in one piece, so that those behind a wrong one are not named.
                if frame.offset == index.offset + index.length + index.message_indexes_length {
                    index.message_indexes.insert(channel, frame.offset);
                    index.message_indexes_length += frame.end() - frame.offset;
                }
            }
            Some(_) => {
                self.reject(frame, format!("a message index of channel {channel} that does not agree with its chunk"))
            }
            None if self.orphans => {}
            None => {
                self.orphans = true;
                self.reject(frame, "a message index without its chunk");
            }
        }
        Ok(())
    }

    /// Whether what looks like something else is a message index, of which the opcode alone is damaged.
    pub(super) fn is_index_in_disguise(&self, frame: Frame) -> Result<bool, Stop> {
        let Some(chunk) = &self.chunk else { return Ok(false) };
        if frame.opcode == op::MESSAGE_INDEX || !(6..=LIMIT).contains(&frame.length) {
            return Ok(false);
        }
        match measure(op::MESSAGE_INDEX, self.horizon.body(frame, 6)?) == Measure::Says(frame.length) {
            true => Ok(chunk.is_indexed_by(self.horizon.body(frame, LIMIT)?)),
            false => Ok(false),
        }
    }

    /// All message indexes of the last chunk have been seen, and this record follows, if it is known. Whether the chunk
    /// must be looked at again before going on: behind damaged or missing indexes, or a recording's end.
    pub(super) fn close_chunk(&mut self, next: Option<Frame>) -> bool {
        let Some(OpenChunk { mut index, tallies, span, followed }) = self.chunk.take() else { return false };
        (index.start_time, index.end_time) = span.unwrap_or((index.start_time, index.end_time));
        let is_missing = |channel| !index.message_indexes.contains_key(channel);
        let is_incomplete = tallies.iter().flat_map(BTreeMap::keys).any(is_missing);
        let by_choice = !followed && next.is_some_and(|next| is_usual_behind_chunk(next.opcode));
        self.inventory.unindexed |= is_incomplete && by_choice;
        match is_incomplete && !by_choice {
            true => self.stage = Stage::Reindexing(Box::new(Reindexing::of(index, self.horizon.offset()))),
            false => self.inventory.summary.index(&index),
        }
        is_incomplete && !by_choice
    }

    fn metadata_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let length = frame.end() - frame.offset;
        match parse_metadata(self.horizon.body(frame, LIMIT)?) {
            Some((name, _)) => {
                self.inventory.summary.metadata.push(MetadataIndex { offset: frame.offset, length, name });
            }
            None => self.reject(frame, "a malformed metadata record"),
        }
        Ok(())
    }

    fn attachment_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let head = self.horizon.body(frame, HEAD)?;
        let mut fields = Fields(head);
        let index = AttachmentIndex::parse_attachment(&mut fields, frame.offset, frame.end() - frame.offset);
        let size = head.len() - fields.0.len();
        let room = frame.length.checked_sub(size as u64 + 4);
        match index.filter(|index| room.is_some_and(|room| index.data_size <= room)) {
            Some(index) => {
                let mut crc = Hasher::new();
                crc.update(head.get(..size).unwrap_or_default());
                self.consume((FRAME + size) as u64);
                let left = index.data_size;
                self.stage = Stage::Attaching(Attaching { frame, index, crc, left });
            }
            None => {
                self.reject(frame, "a malformed attachment record");
                self.pass(frame);
            }
        }
        Ok(())
    }

    /// All of an attachment has been seen.
    pub(super) fn attached(&mut self) {
        let Stage::Attaching(Attaching { frame, index, crc, .. }) = std::mem::take(&mut self.stage) else { return };
        let stored = Fields(self.horizon.buffered()).u32().unwrap_or_default();
        if stored == 0 || stored == crc.finalize() {
            self.inventory.summary.attachments.push(index);
        } else {
            self.reject(frame, format!("attachment `{}`: its CRC does not hold", index.name));
        }
        self.pass(frame);
    }
}

/// Whether a record of this opcode stands behind a chunk where a recorder writes no message indexes.
fn is_usual_behind_chunk(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END)
}

/// How many messages a message index names, and their first and last log time.
fn extent(body: &[u8]) -> (u64, Option<(u64, u64)>) {
    let entries = parse_message_index(body).map(|(_, entries)| entries);
    entries.into_iter().flatten().fold((0, None), |(count, span), (time, _)| {
        let (from, until) = span.unwrap_or((time, time));
        (count + 1, Some((from.min(time), until.max(time))))
    })
}
