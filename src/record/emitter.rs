//! Annotations as MCAP records: ids, chunks, their indexes, and the end of the file. The records before them are left
//! to [`Fold`](super::Fold) and [`Sidecar`](super::Sidecar).

use std::collections::{BTreeMap, BTreeSet};

use crc32fast::Hasher;
use serde::{Deserialize, Serialize};

use super::records::{ChunkHeader, ChunkIndex, write_message_index};
use super::summary::Summary;
use super::wire::{Put, op, record};
use super::{Block, Channel, Error, Message, Piece, Schema, Topic};

/// Compression level of annotation chunks. Fixed, since it determines the bytes.
const ZSTD_LEVEL: i32 = 3;

/// Writer that continues a data section and ends it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Emitter {
    /// Offset of the next byte.
    position: u64,
    /// CRC of everything before `position`, if known.
    crc: Option<u32>,
    pub(super) summary: Summary,
    manner: Manner,
    taken: Taken,
    /// Channels of the topics, in their order. Those already written are in the summary, too.
    channels: Vec<Channel>,
    schemas: Vec<Schema>,
}

/// Layout of the messages: the same as in the original, since readers that find an index look nowhere else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Manner {
    /// Outside chunks. No chunk is indexed.
    Loose,
    /// In chunks without message indexes.
    Chunks,
    /// In chunks with message indexes.
    Indexed,
}

/// Ids in use.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Taken {
    pub(super) schemas: Ids,
    pub(super) channels: Ids,
}

/// Ids of one kind.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Ids {
    taken: BTreeSet<u16>,
    /// All ids below are taken.
    free_from: u16,
}

impl Ids {
    fn take(&mut self, kind: &'static str) -> Result<u16, Error> {
        let mut ids = self.free_from.max(1)..=u16::MAX;
        let id = ids.find(|id| !self.taken.contains(id)).ok_or(Error::NoFreeId { kind })?;
        self.taken.insert(id);
        self.free_from = id;
        Ok(id)
    }
}

impl FromIterator<u16> for Ids {
    fn from_iter<I: IntoIterator<Item = u16>>(taken: I) -> Self {
        Self { taken: taken.into_iter().collect(), free_from: 1 }
    }
}

impl Emitter {
    pub(super) fn new(position: u64, crc: Option<u32>, summary: Summary, manner: Manner, taken: Taken) -> Self {
        Self { position, crc, summary, manner, taken, channels: Vec::new(), schemas: Vec::new() }
    }

    pub(super) fn manner(&self) -> Manner {
        self.manner
    }

    pub(super) fn position(&self) -> u64 {
        self.position
    }

    /// Advances over `bytes`.
    pub(super) fn pass(&mut self, bytes: &[u8]) {
        self.position += bytes.len() as u64;
        self.crc = self.crc.map(|crc| {
            let mut hasher = Hasher::new_with_initial(crc);
            hasher.update(bytes);
            hasher.finalize()
        });
    }

    /// Advances over `length` bytes of which only the CRC is known.
    pub(super) fn pass_unseen(&mut self, length: u64, crc: u32) {
        self.position += length;
        self.crc = self.crc.map(|before| combine(before, crc, length));
    }

    /// Assigns ids to the topics that have none.
    pub(super) fn assign(&mut self, topics: &[Topic]) -> Result<(), Error> {
        for topic in topics.iter().skip(self.channels.len()) {
            let known = self.schemas.iter().chain(self.summary.schemas.values()).find(|schema| {
                schema.name == topic.schema_name
                    && schema.encoding == topic.schema_encoding
                    && schema.data == topic.schema
            });
            let schema_id = match known {
                Some(schema) => schema.id,
                None if topic.schema_name.is_empty() && topic.schema.is_empty() => 0,
                None => {
                    let id = self.taken.schemas.take("schema")?;
                    self.schemas.push(Schema {
                        id,
                        name: topic.schema_name.clone(),
                        encoding: topic.schema_encoding.clone(),
                        data: topic.schema.clone(),
                    });
                    id
                }
            };
            self.channels.push(Channel {
                id: self.taken.channels.take("channel")?,
                schema_id,
                topic: topic.name.clone(),
                message_encoding: topic.message_encoding.clone(),
                metadata: topic.metadata.clone(),
            });
        }
        Ok(())
    }

    /// Records of a block: one chunk and its indexes, or messages outside chunks. Empty for a block without
    /// annotations.
    pub(super) fn block(&mut self, topics: &[Topic], block: &Block) -> Result<Vec<u8>, Error> {
        self.assign(topics)?;
        let mut records = Vec::new();
        let mut indexes: BTreeMap<u16, Vec<(u64, u64)>> = BTreeMap::new();
        for annotation in &block.annotations {
            let unknown = Error::UnknownTopic { topic: annotation.topic, topics: self.channels.len() };
            let channel = self.channels.get(annotation.topic).ok_or(unknown)?.id;
            self.define(annotation.topic, &mut records);
            indexes.entry(channel).or_default().push((annotation.log_time, records.len() as u64));
            let message = Message {
                channel,
                sequence: annotation.sequence,
                log_time: annotation.log_time,
                publish_time: annotation.log_time,
                data: &annotation.data,
            };
            message.write(&mut records);
            self.summary.count(channel, 1);
            self.summary.cover((annotation.log_time, annotation.log_time));
        }
        let bytes = match self.manner {
            Manner::Loose => records,
            _ if indexes.is_empty() => records,
            Manner::Chunks | Manner::Indexed => self.chunk(&records, indexes)?,
        };
        self.pass(&bytes);
        Ok(bytes)
    }

    /// DataEnd, summary, footer and magic.
    pub(super) fn close(mut self) -> Vec<Piece> {
        let mut out = Vec::new();
        record(&mut out, op::DATA_END, |out| out.put_u32(self.crc.unwrap_or_default()));
        self.pass(&out);
        let mut pieces = vec![Piece::Bytes(out)];
        pieces.extend(self.summary.write(self.position, self.manner != Manner::Loose));
        pieces
    }

    /// Appends the channel of a topic, and its schema, at their first use.
    fn define(&mut self, topic: usize, out: &mut Vec<u8>) {
        let Some(channel) = self.channels.get(topic) else { return };
        if self.summary.channels.contains_key(&channel.id) {
            return;
        }
        let schema = self.schemas.iter().find(|schema| schema.id == channel.schema_id);
        if let Some(schema) = schema.filter(|schema| !self.summary.schemas.contains_key(&schema.id)) {
            schema.write(out);
            self.summary.schemas.insert(schema.id, schema.clone());
        }
        channel.write(out);
        self.summary.channels.insert(channel.id, channel.clone());
    }

    fn chunk(&mut self, records: &[u8], indexes: BTreeMap<u16, Vec<(u64, u64)>>) -> Result<Vec<u8>, Error> {
        let compressed =
            zstd::bulk::compress(records, ZSTD_LEVEL).map_err(|cause| Error::Chunk { bytes: records.len(), cause })?;
        let times = || indexes.values().flatten().map(|&(log_time, _)| log_time);
        let header = ChunkHeader {
            start_time: times().min().unwrap_or_default(),
            end_time: times().max().unwrap_or_default(),
            uncompressed_size: records.len() as u64,
            uncompressed_crc: crc32fast::hash(records),
            compression: "zstd",
            compressed_size: compressed.len() as u64,
        };
        let mut out = Vec::new();
        record(&mut out, op::CHUNK, |out| {
            header.put(out);
            out.put(&compressed);
        });
        let length = out.len() as u64;
        let mut message_indexes = BTreeMap::new();
        let indexes = Some(indexes).filter(|_| self.manner == Manner::Indexed);
        for (channel, mut entries) in indexes.into_iter().flatten() {
            message_indexes.insert(channel, self.position + out.len() as u64);
            entries.sort_by_key(|&(log_time, _)| log_time);
            write_message_index(&mut out, channel, &entries);
        }
        self.summary.index(&ChunkIndex {
            start_time: header.start_time,
            end_time: header.end_time,
            offset: self.position,
            length,
            message_indexes,
            message_indexes_length: out.len() as u64 - length,
            compression: header.compression.to_owned(),
            compressed_size: header.compressed_size,
            uncompressed_size: header.uncompressed_size,
        });
        Ok(out)
    }
}

/// CRC of two consecutive pieces, of which the second has `length` bytes.
pub(super) fn combine(first: u32, second: u32, length: u64) -> u32 {
    let mut hasher = Hasher::new_with_initial(first);
    hasher.combine(&Hasher::new_with_initial_len(second, length));
    hasher.finalize()
}
