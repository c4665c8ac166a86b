//! The records in front of DataEnd: chunks, messages, attachments, metadata.

use std::ops::Range;

use crc32fast::Hasher;

use super::{Scan, Stage, Step, within};
use crate::record::chunk::{LIMIT, Place};
use crate::record::horizon::{Frame, Horizon, Stop};
use crate::record::inventory::Learned;
use crate::record::records::{AttachmentIndex, ChunkHeader, ChunkIndex, Header, MetadataIndex, parse_metadata};
use crate::record::survey::Survey;
use crate::record::wire::{FRAME, Fields, op};

/// Most bytes that the head of a chunk or attachment may take: times, sizes and two names.
const HEAD: u64 = 1 << 16;

/// Records in order, from which messages are told.
pub(super) struct Telling {
    pub(super) frame: Frame,
    /// The bytes that hold the records, in front of the horizon.
    pub(super) data: Range<usize>,
    pub(super) place: Place,
    /// The record that is being told, within the records.
    pub(super) at: Range<usize>,
    /// Whether the end of a chunk is to be told.
    pub(super) ends: bool,
}

impl Telling {
    /// Goes on to the next message, if there is one.
    pub(super) fn advance(&mut self, records: &[u8]) -> bool {
        loop {
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
    pub(super) fn hash(&mut self, horizon: &mut Horizon) -> Result<(), Stop> {
        while self.left > 0 {
            horizon.peek(1)?;
            let buffered = horizon.buffered();
            let taken = buffered.get(..self.left.min(buffered.len() as u64) as usize).unwrap_or_default();
            self.crc.update(taken);
            let taken = taken.len() as u64;
            self.left -= taken;
            horizon.skip(taken);
        }
        horizon.peek(4).map(|_| ())
    }
}

impl Scan {
    pub(super) fn data_record(&mut self, frame: Frame) -> Result<(), Stop> {
        match frame.opcode {
            op::CHUNK => return self.chunk_record(frame),
            op::ATTACHMENT => return self.attachment_record(frame),
            op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::MESSAGE_INDEX | op::METADATA
                if frame.length > LIMIT =>
            {
                self.damage(frame.offset, format!("a record of {} bytes", frame.length));
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE => return self.loose_record(frame),
            op::HEADER => self.header_record(frame)?,
            op::MESSAGE_INDEX => self.message_index_record(frame)?,
            op::METADATA => self.metadata_record(frame)?,
            op::DATA_END => {
                self.inventory.data_crc = Some(Fields(self.horizon.body(frame, 4)?).u32().unwrap_or_default());
                self.summary.begun = true;
            }
            op::FOOTER => {
                self.damage(frame.offset, "a footer, but the end of the data was not marked");
                self.summary.begun = true;
                return self.summary_record(frame);
            }
            _ => {}
        }
        self.pass(frame);
        Ok(())
    }

    fn header_record(&mut self, frame: Frame) -> Result<(), Stop> {
        match Header::parse(self.horizon.body(frame, LIMIT)?) {
            Some(header) if self.inventory.header.is_none() => {
                self.inventory.header = Some(header);
                self.queue.push_back(Step::Header);
            }
            Some(_) => {}
            None => self.damage(frame.offset, "a malformed header record"),
        }
        Ok(())
    }

    /// A schema, channel or message outside a chunk is treated as a chunk of one record.
    fn loose_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let size = FRAME + frame.length as usize;
        match Survey::of(self.horizon.peek(size)?) {
            Ok(survey) => {
                let ends = frame.opcode == op::MESSAGE;
                self.inventory.loose |= ends;
                self.admit(frame, survey);
                self.stage = Stage::Telling(Telling { frame, data: 0..size, place: Place::Plain, at: 0..0, ends });
            }
            Err(what) => {
                self.damage(frame.offset, what);
                self.pass(frame);
            }
        }
        Ok(())
    }

    fn chunk_record(&mut self, frame: Frame) -> Result<(), Stop> {
        match self.open_chunk(frame)? {
            Ok((telling, index, survey)) => {
                self.admit(frame, survey);
                self.chunk = Some(index);
                self.stage = Stage::Telling(telling);
            }
            Err(what) => {
                self.damage(frame.offset, what);
                self.pass(frame);
            }
        }
        Ok(())
    }

    fn open_chunk(&mut self, frame: Frame) -> Result<Result<(Telling, ChunkIndex, Survey), String>, Stop> {
        let mut fields = Fields(self.horizon.body(frame, HEAD)?);
        let size = fields.0.len();
        let Some(header) = ChunkHeader::parse(&mut fields) else {
            return Ok(Err("a malformed chunk record".to_owned()));
        };
        let start = FRAME + size - fields.0.len();
        let room = FRAME as u64 + frame.length - start as u64;
        if header.compressed_size > room.min(LIMIT) {
            return Ok(Err(format!("a chunk that claims {} bytes but has {room}", header.compressed_size)));
        }
        let data = start..start + header.compressed_size as usize;
        self.horizon.peek(data.end)?;

        let bytes = within(&self.horizon, &data);
        let opened = self.inflate.open(&header, bytes).and_then(|place| {
            let survey = Survey::of(self.inflate.records(place, bytes))?;
            let (start_time, end_time) = survey.span.unwrap_or((header.start_time, header.end_time));
            let index = ChunkIndex {
                start_time,
                end_time,
                offset: frame.offset,
                length: frame.end() - frame.offset,
                message_indexes: Default::default(),
                message_indexes_length: 0,
                compression: header.compression.to_owned(),
                compressed_size: header.compressed_size,
                uncompressed_size: header.uncompressed_size,
            };
            Ok((Telling { frame, data, place, at: 0..0, ends: true }, index, survey))
        });
        Ok(opened)
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
                    self.damage(frame.offset, format!("schema {id} is defined twice, differently"))
                }
            }
        }
        for channel in survey.channels {
            let id = channel.id;
            match self.inventory.learn_channel(channel) {
                Learned::New => self.queue.push_back(Step::Channel(id)),
                Learned::Known => {}
                Learned::Contradicted => {
                    self.damage(frame.offset, format!("channel {id} is defined twice, differently"));
                }
            }
        }
    }

    fn message_index_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let mut fields = Fields(self.horizon.body(frame, LIMIT)?);
        let (Some(channel), Some(_)) = (fields.u16(), fields.blob()) else {
            self.damage(frame.offset, "a malformed message index");
            return Ok(());
        };
        self.inventory.mentioned.insert(channel);
        if let Some(chunk) = &mut self.chunk {
            chunk.message_indexes.insert(channel, frame.offset);
            chunk.message_indexes_length += frame.end() - frame.offset;
        }
        Ok(())
    }

    /// All message indexes of the last chunk have been seen.
    pub(super) fn close_chunk(&mut self) {
        if let Some(chunk) = self.chunk.take() {
            self.inventory.summary.index(&chunk);
        }
    }

    fn metadata_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let length = frame.end() - frame.offset;
        match parse_metadata(self.horizon.body(frame, LIMIT)?) {
            Some((name, _)) => {
                self.inventory.summary.metadata.push(MetadataIndex { offset: frame.offset, length, name });
            }
            None => self.damage(frame.offset, "a malformed metadata record"),
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
                self.horizon.skip((FRAME + size) as u64);
                let left = index.data_size;
                self.stage = Stage::Attaching(Attaching { frame, index, crc, left });
            }
            None => {
                self.damage(frame.offset, "a malformed attachment record");
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
            self.damage(frame.offset, format!("attachment `{}`: its CRC does not hold", index.name));
        }
        self.pass(frame);
    }
}
