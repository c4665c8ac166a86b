//! Records before DataEnd. [`check_indexes`](super::check_indexes) reads what follows a chunk,
//! [`read_attachment`](super::read_attachment) attachments.

use std::collections::BTreeSet;

use super::Scan;
use super::emission::Emission;
use super::message_indexes::OpenChunk;
use super::search::HEAD;
use super::stage::{Stage, Step};
use super::supply::Supply;
use crate::record::Message;
use crate::record::chunk::{Content, Storage, locate};
use crate::record::chunk_check::ChunkCheck;
use crate::record::frame_window::{Frame, Stop};
use crate::record::inventory::{Learned, NamedRecord};
use crate::record::records::{ChunkHeader, ChunkIndex, Header, MetadataIndex, parse_metadata};
use crate::record::wire::{FRAME, Fields, op};

/// Largest plausible distance of a log time from those already seen, in nanoseconds (one day).
const DAY: u64 = 86_400_000_000_000;

/// Number of bytes read of the head of a skipped chunk.
const SHORT_HEAD: u64 = 128;

impl Scan {
    pub(super) fn data_record(&mut self, frame: Frame) -> Result<(), Stop> {
        if frame.opcode != op::MESSAGE_INDEX {
            self.indexes.orphans = false;
        }
        match frame.opcode {
            op::CHUNK => return self.chunk_record(frame),
            op::ATTACHMENT => return self.attachment_record(frame),
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::MESSAGE_INDEX | op::METADATA
                if frame.length > self.limits.record =>
            {
                let (length, most) = (frame.length, self.limits.record);
                let what = "are not read (limits.record_mib)";
                self.reject(frame, format!("a record of {length} bytes: those of more than {most} {what}"));
            }
            op::METADATA if frame.length > self.limits.definition => {
                self.reject(frame, self.limits.refuse_definition(frame.opcode, frame.length));
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE => return self.loose_record(frame),
            op::HEADER => self.header_record(frame)?,
            op::MESSAGE_INDEX => self.message_index_record(frame)?,
            op::METADATA => self.metadata_record(frame)?,
            op::DATA_END if !self.is_end_of_data(frame)? => {
                self.reject(frame, "an end of the data, behind which the data goes on");
            }
            op::DATA_END => {
                let stored = Fields(self.window.body(frame, 4)?).u32().unwrap_or_default();
                self.check_data_crc(frame, stored);
                self.inventory.data_crc = Some(stored);
                self.summary.begun = true;
            }
            op::FOOTER => {
                self.damage(frame.offset, 0, "a footer, but the end of the data was not marked");
                self.summary.begun = true;
                return self.summary_record(frame);
            }
            // Records of private opcodes are skipped.
            0x80.. => {}
            op::CHUNK_INDEX | op::ATTACHMENT_INDEX | op::STATISTICS | op::METADATA_INDEX | op::SUMMARY_OFFSET => {
                return self.stray_record(frame);
            }
            opcode => self.reject(frame, format!("a record of opcode {opcode}, which does not belong here")),
        }
        self.pass(frame);
        Ok(())
    }

    /// Handles a record that belongs to the summary: either the DataEnd record is damaged, or the record itself is.
    fn stray_record(&mut self, frame: Frame) -> Result<(), Stop> {
        match &self.early_summary {
            None => self.ask(),
            Some(summary) if summary.is_behind_data(frame.offset) => {
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
        match Header::parse(self.window.body(frame, self.limits.record)?) {
            Some(header) if self.inventory.header.is_none() => {
                self.inventory.header = Some(header);
                self.queue.push_back(Step::Header);
            }
            Some(_) => {}
            None => self.reject(frame, "a malformed header record"),
        }
        Ok(())
    }

    /// Treats a schema, channel or message outside chunks as a chunk of one record.
    fn loose_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let size = FRAME + frame.length as usize;
        let whole = self.window.peek(size)?;
        let message = Message::parse(whole.get(FRAME..).unwrap_or_default()).filter(|_| frame.opcode == op::MESSAGE);
        let (channel, incredible) = match &message {
            Some(message) => (Some(message.channel), !self.is_ours(frame) && !self.is_credible_message(message)),
            None => (None, false),
        };
        let survey = ChunkCheck::of(whole, &self.limits).and_then(|survey| {
            match self.inventory.refuses(&survey, &self.limits_at(frame)) {
                Some(what) => Err(what),
                None => Ok(survey),
            }
        });
        match survey {
            Ok(survey) if self.early_summary.is_none() && self.is_at_a_loss(&survey) => return self.ask(),
            Ok(_) if incredible => {
                self.inventory.mentioned.extend(channel);
                self.reject(frame, "a message outside the chunks that fits nothing else");
                self.pass(frame);
            }
            Ok(survey) => {
                let ends = frame.opcode == op::MESSAGE;
                self.inventory.loose |= ends;
                if let Some(channel) = channel {
                    self.sync.note_length(channel, frame.length);
                }
                self.admit(frame, survey);
                self.stage = Stage::Emission(Emission {
                    frame,
                    data: 0..size,
                    place: Storage::Plain,
                    opened: None,
                    at: 0..0,
                    ends,
                });
            }
            Err(what) => {
                self.reject(frame, what);
                self.pass(frame);
            }
        }
        Ok(())
    }

    /// Whether a message outside chunks is plausible. In a recording with chunks it is more likely another record with
    /// a damaged opcode, unless it resembles the messages in the chunks.
    fn is_credible_message(&self, message: &Message<'_>) -> bool {
        let known = self.inventory.channels().contains_key(&message.channel);
        match self.has_chunks() && self.inventory.span().is_some() {
            true => known && self.is_of_the_time(message.log_time),
            false => known || !self.inventory.channels().is_empty(),
        }
    }

    /// Whether a log time is near those already seen.
    pub(super) fn is_of_the_time(&self, log_time: u64) -> bool {
        let near = |(from, until): (u64, u64)| from.saturating_sub(DAY)..=until.saturating_add(DAY);
        self.inventory.span().is_some_and(|span| near(span).contains(&log_time))
    }

    /// Whether the recording has chunks.
    pub(super) fn has_chunks(&self) -> bool {
        self.inventory.has_chunks() || self.early_summary.as_ref().is_some_and(|summary| summary.indexed)
    }

    /// Whether there are messages on channels that neither these records nor earlier ones define.
    fn is_at_a_loss(&self, survey: &ChunkCheck) -> bool {
        let channels = self.inventory.channels();
        let mut new = survey.tallies.keys().filter(|id| !channels.contains_key(id)).peekable();
        if new.peek().is_none() {
            return false;
        }
        let defined: BTreeSet<u16> = survey.channels.iter().map(|channel| channel.id).collect();
        !new.all(|id| defined.contains(id))
    }

    fn chunk_record(&mut self, frame: Frame) -> Result<(), Stop> {
        self.data_crc.chunk();
        let supply = self.supply.take().filter(|(at, _)| *at == frame.offset).map(|(_, supply)| supply);
        if supply.is_none() && self.offering && self.stands_in_place(frame) {
            self.stage = Stage::Offering(frame);
            return Ok(());
        }
        let supplied = match &supply {
            Some(Supply::Opened(opened)) if opened.length() == frame.length => Some(opened.body()),
            _ => None,
        };
        // Less is read of a skipped chunk, however long the name of its compression.
        let most = if matches!(supply, Some(Supply::Unread)) { SHORT_HEAD } else { HEAD };
        let head = supplied.map_or_else(|| self.window.body(frame, most), Ok)?;
        // The claimed size counts, whoever opened the chunk and whether or not it is read.
        let (size, refused) = match ChunkHeader::parse(&mut Fields(head)) {
            Some(header) => match self.limits.refuse_chunk(&header, self.inventory.opened, frame.end()) {
                Ok(()) => (header.inflated(), None),
                Err(what) => (0, Some(what)),
            },
            None => (0, None),
        };
        let (opened, content) = match (supply, refused) {
            (supply, Some(what)) => (supply.and_then(Supply::into_opened), Err(what)),
            (Some(Supply::Unread), None) => {
                self.inventory.opened = self.inventory.opened.saturating_add(size);
                return self.unread_chunk(frame);
            }
            (Some(Supply::Opened(mut opened)), None) if opened.length() == frame.length => {
                let content = opened.content.take().unwrap_or_else(|| Err("a chunk that was not opened".to_owned()));
                (Some(opened), content.map(|content| *content))
            }
            (Some(Supply::Opened(_) | Supply::Absent) | None, None) => (None, self.open_chunk(frame)?),
        };
        let content =
            content.and_then(|content| match self.inventory.refuses(&content.survey, &self.limits_at(frame)) {
                Some(what) => Err(what),
                None => Ok(content),
            });
        match content {
            Ok(Content { survey, .. }) if self.early_summary.is_none() && self.is_at_a_loss(&survey) => {
                return self.ask();
            }
            Ok(Content { data, place, mut index, survey, more }) => {
                if more {
                    let what = "a chunk that opens to more than it claims: what is beyond is not used";
                    self.damage(frame.offset, 0, what);
                }
                index.offset = frame.offset;
                index.length = frame.end() - frame.offset;
                let tallies = Some(survey.tallies.clone());
                self.admit(frame, survey);
                self.inventory.opened = self.inventory.opened.saturating_add(size);
                self.indexes.chunk = Some(OpenChunk { index, tallies, span: None, followed: false });
                self.stage = Stage::Emission(Emission { frame, data, place, opened, at: 0..0, ends: true });
            }
            Err(what) => {
                self.window.may_change(frame.end())?;
                self.inventory.opened = self.inventory.opened.saturating_add(size);
                self.spent = opened;
                self.reject(frame, what);
                self.indexes.orphans = true;
                self.pass(frame);
            }
        }
        Ok(())
    }

    pub(super) fn open_chunk(&mut self, frame: Frame) -> Result<Result<Content, String>, Stop> {
        let body = self.window.body(frame, HEAD)?;
        let data = match locate(body, frame.length, &self.limits) {
            Ok((_, data)) => FRAME + data.start..FRAME + data.end,
            Err(what) => return Ok(Err(what)),
        };
        self.window.peek(data.end)?;
        let body = self.window.body(frame, HEAD)?;
        Ok(locate(body, frame.length, &self.limits).and_then(|(header, _)| {
            let bytes = self.window.within(&data);
            Content::of(&header, data, bytes, &mut self.inflate, &self.limits)
        }))
    }

    /// Skips a chunk. Its content is taken from its message indexes.
    fn unread_chunk(&mut self, frame: Frame) -> Result<(), Stop> {
        let head = self.window.body(frame, SHORT_HEAD)?;
        match locate(head, frame.length, &self.limits).map(|(header, _)| header.index()) {
            Ok(index) => {
                let index = ChunkIndex { offset: frame.offset, length: frame.end() - frame.offset, ..index };
                self.indexes.chunk = Some(OpenChunk { index, tallies: None, span: None, followed: false });
                self.queue.push_back(Step::ChunkEnd);
            }
            Err(what) => {
                self.reject(frame, what);
                self.indexes.orphans = true;
            }
        }
        self.pass(frame);
        Ok(())
    }

    /// Notes the definitions and messages of records that are in order.
    pub(super) fn admit(&mut self, frame: Frame, survey: ChunkCheck) {
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

    fn metadata_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let length = frame.end() - frame.offset;
        match parse_metadata(self.window.body(frame, self.limits.definition)?) {
            Some((name, _)) => {
                self.place_record(frame, NamedRecord::Metadata(MetadataIndex { offset: frame.offset, length, name }));
            }
            None => self.reject(frame, "a malformed metadata record"),
        }
        Ok(())
    }
}
