//! MCAP records that scanning and folding need, parsed from bytes and written to bytes. Their order in a file is left
//! to [`Scan`](super::Scan) and [`Fold`](super::Fold).
//!
//! Every record may be extended: fields that are not known, at its end, are ignored, as the specification asks for. Only a
//! message cannot be, whose data takes what is left, nor the footer, which is found by its distance from the end.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::wire::{Fields, Put, op, record};
use super::{Channel, Message, Schema};

impl Schema {
    /// Memory that it takes, in bytes.
    pub(super) fn size(&self) -> u64 {
        (size_of::<Self>() + self.name.len() + self.encoding.len() + self.data.len()) as u64
    }

    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let id = fields.u16().filter(|&id| id != 0)?;
        Some(Self { id, name: fields.string()?, encoding: fields.string()?, data: fields.blob()?.to_vec() })
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::SCHEMA, |out| {
            out.put_u16(self.id);
            out.put_str(&self.name);
            out.put_str(&self.encoding);
            out.put_blob(&self.data);
        });
    }
}

impl Channel {
    /// Memory that it takes, in bytes.
    pub(super) fn size(&self) -> u64 {
        let metadata: usize = self.metadata.iter().map(|(key, value)| 64 + key.len() + value.len()).sum();
        (size_of::<Self>() + self.topic.len() + self.message_encoding.len() + metadata) as u64
    }

    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Self {
            id: fields.u16()?,
            schema_id: fields.u16()?,
            topic: fields.string()?,
            message_encoding: fields.string()?,
            metadata: fields.map()?,
        })
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::CHANNEL, |out| {
            out.put_u16(self.id);
            out.put_u16(self.schema_id);
            out.put_str(&self.topic);
            out.put_str(&self.message_encoding);
            out.put_map(&self.metadata);
        });
    }
}

impl<'a> Message<'a> {
    pub(super) fn parse(body: &'a [u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Self {
            channel: fields.u16()?,
            sequence: fields.u32()?,
            log_time: fields.u64()?,
            publish_time: fields.u64()?,
            data: fields.0,
        })
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::MESSAGE, |out| {
            out.put_u16(self.channel);
            out.put_u32(self.sequence);
            out.put_u64(self.log_time);
            out.put_u64(self.publish_time);
            out.put(self.data);
        });
    }
}

/// Header record: the program that wrote the recording, and its conventions.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Header {
    pub(super) profile: String,
    pub(super) library: String,
}

impl Header {
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Self { profile: fields.string()?, library: fields.string()? })
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::HEADER, |out| {
            out.put_str(&self.profile);
            out.put_str(&self.library);
        });
    }
}

/// Header of a chunk, before its records.
pub(super) struct ChunkHeader<'a> {
    pub(super) start_time: u64,
    pub(super) end_time: u64,
    pub(super) uncompressed_size: u64,
    /// CRC-32 of the decompressed records, 0 if the recorder computed none.
    pub(super) uncompressed_crc: u32,
    pub(super) compression: &'a str,
    pub(super) compressed_size: u64,
}

impl<'a> ChunkHeader<'a> {
    /// Parses the header and leaves `fields` at the compressed records.
    pub(super) fn parse(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            start_time: fields.u64()?,
            end_time: fields.u64()?,
            uncompressed_size: fields.u64()?,
            uncompressed_crc: fields.u32()?,
            compression: fields.str()?,
            compressed_size: fields.u64()?,
        })
    }

    /// Additional memory that the decompressed records take, as claimed, in bytes; 0 if they are not compressed.
    pub(super) fn inflated(&self) -> u64 {
        if self.compression.is_empty() { 0 } else { self.uncompressed_size }
    }

    /// Chunk index, as far as the header determines it.
    pub(super) fn index(&self) -> ChunkIndex {
        ChunkIndex {
            start_time: self.start_time,
            end_time: self.end_time,
            offset: 0,
            length: 0,
            message_indexes: BTreeMap::new(),
            message_indexes_length: 0,
            compression: self.compression.to_owned(),
            compressed_size: self.compressed_size,
            uncompressed_size: self.uncompressed_size,
        }
    }

    pub(super) fn put(&self, out: &mut Vec<u8>) {
        out.put_u64(self.start_time);
        out.put_u64(self.end_time);
        out.put_u64(self.uncompressed_size);
        out.put_u32(self.uncompressed_crc);
        out.put_str(self.compression);
        out.put_u64(self.compressed_size);
    }
}

/// Chunk index record: the places of a chunk and of its message indexes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ChunkIndex {
    pub(super) start_time: u64,
    pub(super) end_time: u64,
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) message_indexes: BTreeMap<u16, u64>,
    pub(super) message_indexes_length: u64,
    pub(super) compression: String,
    pub(super) compressed_size: u64,
    pub(super) uncompressed_size: u64,
}

impl ChunkIndex {
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        let (start_time, end_time, offset, length) = (fields.u64()?, fields.u64()?, fields.u64()?, fields.u64()?);
        let mut offsets = Fields(fields.blob()?);
        let mut message_indexes = BTreeMap::new();
        while !offsets.0.is_empty() {
            message_indexes.insert(offsets.u16()?, offsets.u64()?);
        }
        Some(Self {
            start_time,
            end_time,
            offset,
            length,
            message_indexes,
            message_indexes_length: fields.u64()?,
            compression: fields.string()?,
            compressed_size: fields.u64()?,
            uncompressed_size: fields.u64()?,
        })
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::CHUNK_INDEX, |out| {
            out.put_u64(self.start_time);
            out.put_u64(self.end_time);
            out.put_u64(self.offset);
            out.put_u64(self.length);
            out.put_u32(10 * self.message_indexes.len() as u32);
            for (&channel, &offset) in &self.message_indexes {
                out.put_u16(channel);
                out.put_u64(offset);
            }
            out.put_u64(self.message_indexes_length);
            out.put_str(&self.compression);
            out.put_u64(self.compressed_size);
            out.put_u64(self.uncompressed_size);
        });
    }
}

/// Parses the index of one channel's messages in a chunk: log times, and offsets into the uncompressed records.
pub(super) fn parse_message_index(body: &[u8]) -> Option<(u16, impl Iterator<Item = (u64, u64)>)> {
    let mut fields = Fields(body);
    let (channel, entries) = (fields.u16()?, fields.blob()?);
    let (entries, rest) = entries.as_chunks::<16>();
    let entry = |entry: &[u8; 16]| {
        let mut fields = Fields(entry);
        (fields.u64().unwrap_or_default(), fields.u64().unwrap_or_default())
    };
    rest.is_empty().then(|| (channel, entries.iter().map(entry)))
}

/// Appends the index of one channel's messages in a chunk: log times, and offsets into the uncompressed records.
pub(super) fn write_message_index(out: &mut Vec<u8>, channel: u16, entries: &[(u64, u64)]) {
    record(out, op::MESSAGE_INDEX, |out| {
        out.put_u16(channel);
        out.put_u32(16 * entries.len() as u32);
        for &(log_time, offset) in entries {
            out.put_u64(log_time);
            out.put_u64(offset);
        }
    });
}

/// Place of an attachment. The attachment record begins with the same fields, see
/// [`AttachmentIndex::parse_attachment`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct AttachmentIndex {
    pub(super) offset: u64,
    /// Length of the whole record, in bytes.
    pub(super) length: u64,
    pub(super) log_time: u64,
    pub(super) create_time: u64,
    /// Length of the attached bytes.
    pub(super) data_size: u64,
    pub(super) name: String,
    pub(super) media_type: String,
}

impl AttachmentIndex {
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Self {
            offset: fields.u64()?,
            length: fields.u64()?,
            log_time: fields.u64()?,
            create_time: fields.u64()?,
            data_size: fields.u64()?,
            name: fields.string()?,
            media_type: fields.string()?,
        })
    }

    /// Parses the head of an attachment record and leaves `fields` at the attached bytes.
    pub(super) fn parse_attachment(fields: &mut Fields<'_>, offset: u64, length: u64) -> Option<Self> {
        Some(Self {
            offset,
            length,
            log_time: fields.u64()?,
            create_time: fields.u64()?,
            name: fields.string()?,
            media_type: fields.string()?,
            data_size: fields.u64()?,
        })
    }

    /// Appends the head of the attachment record, up to the attached bytes.
    pub(super) fn put_attachment(&self, out: &mut Vec<u8>) {
        out.put_u64(self.log_time);
        out.put_u64(self.create_time);
        out.put_str(&self.name);
        out.put_str(&self.media_type);
        out.put_u64(self.data_size);
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::ATTACHMENT_INDEX, |out| {
            out.put_u64(self.offset);
            out.put_u64(self.length);
            out.put_u64(self.log_time);
            out.put_u64(self.create_time);
            out.put_u64(self.data_size);
            out.put_str(&self.name);
            out.put_str(&self.media_type);
        });
    }
}

/// Place of a metadata record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct MetadataIndex {
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) name: String,
}

impl MetadataIndex {
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body);
        Some(Self { offset: fields.u64()?, length: fields.u64()?, name: fields.string()? })
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        record(out, op::METADATA_INDEX, |out| {
            out.put_u64(self.offset);
            out.put_u64(self.length);
            out.put_str(&self.name);
        });
    }
}

/// Name and entries of a metadata record.
pub(super) fn parse_metadata(body: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut fields = Fields(body);
    Some((fields.string()?, fields.map()?))
}

/// Appends a metadata record.
pub(super) fn write_metadata(out: &mut Vec<u8>, name: &str, entries: &BTreeMap<String, String>) {
    record(out, op::METADATA, |out| {
        out.put_str(name);
        out.put_map(entries);
    });
}
