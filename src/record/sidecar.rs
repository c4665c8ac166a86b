//! Annotations alone, as a recording of their own that viewers show on the original's timeline.

use std::collections::BTreeMap;

use mcap::MAGIC;
use serde::{Deserialize, Serialize};

use super::chunk::{Inflate, locate};
use super::emitter::{Emitter, Manner, Taken};
use super::fold::{library, write_settings};
use super::limits::Limits;
use super::records::Header;
use super::summary::Summary;
use super::walk::{ReadAt, Walk};
use super::wire::{Fields, op};
use super::{Annotation, Block, Channel, Error, Message, Piece, Topic};

/// Writer of a sidecar: the bytes of [`Sidecar::open`], of each [`Sidecar::block`], and the pieces of
/// [`Sidecar::close`].
///
/// The file is whole up to the last block at any time, so that a growing sidecar can be followed. The state can be
/// saved and resumed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sidecar {
    emitter: Emitter,
}

impl Sidecar {
    /// Begins with header and metadata. The profile is the original's, the settings are what determines the
    /// annotations.
    pub fn open(profile: &str, settings: &BTreeMap<String, String>) -> (Self, Vec<u8>) {
        let mut out = MAGIC.to_vec();
        Header { profile: profile.to_owned(), library: library() }.write(&mut out);
        let mut emitter = Emitter::new(0, Some(0), Summary::default(), Manner::Indexed, Taken::default());
        emitter.pass(&out);
        write_settings(&mut emitter, settings, &mut out);
        (Self { emitter }, out)
    }

    /// Bytes of a block. New topics are appended to the end of the list.
    ///
    /// # Errors
    /// If an annotation's topic is not in the list, if ids run out, or if compression fails.
    pub fn block(&mut self, topics: &[Topic], block: &Block) -> Result<Vec<u8>, Error> {
        self.emitter.block(topics, block)
    }

    /// Takes the chunk indexes since the last call. They must be written in the place of [`Piece::Indexes`].
    pub fn take_indexes(&mut self) -> Vec<u8> {
        self.emitter.summary.take_indexes()
    }

    /// Last pieces: the end of the data, the summary, the footer.
    pub fn close(self) -> Vec<Piece> {
        self.emitter.close()
    }
}

/// Reader of the blocks of a sidecar, growing or whole, in the order of writing.
pub struct SidecarBlocks {
    walk: Walk,
    inflate: Inflate,
    /// Topics of the channels met so far.
    channels: BTreeMap<u16, String>,
}

/// Read size, in bytes.
const READ: u64 = 1 << 18;

impl SidecarBlocks {
    /// Reader of the blocks in the first `length` bytes.
    pub fn new(length: u64) -> Self {
        let start = (MAGIC.len() as u64).min(length);
        Self { walk: Walk::new(start..length, READ), inflate: Inflate::default(), channels: BTreeMap::new() }
    }

    /// Next block; `None` after the last. Its topics are indices into `topics`.
    ///
    /// # Errors
    /// If the sidecar cannot be read or is damaged.
    pub fn next(&mut self, file: &mut impl ReadAt, topics: &[Topic]) -> Result<Option<Block>, Error> {
        while let Some(frame) = self.walk.next(file)? {
            let damaged = |what: String| Error::Sidecar { offset: frame.offset, what };
            match frame.opcode {
                op::CHUNK => {
                    let limits = Limits::default();
                    let body = self.walk.body(file, frame, limits.chunk)?;
                    let (header, data) = locate(body, frame.length, &limits).map_err(damaged)?;
                    limits.refuse_chunk(&header, 0, u64::MAX).map_err(damaged)?;
                    let data = body.get(data).unwrap_or_default();
                    let place = self.inflate.open(&header, data).map_err(damaged)?;
                    let records = self.inflate.records(place, data);
                    let block = read_block(records, &mut self.channels, topics);
                    return block.ok_or_else(|| damaged("holds a malformed record".to_owned())).map(Some);
                }
                op::DATA_END => return Ok(None),
                _ => {}
            }
        }
        Ok(None)
    }
}

/// Annotations among the records of a chunk.
fn read_block(records: &[u8], channels: &mut BTreeMap<u16, String>, topics: &[Topic]) -> Option<Block> {
    let mut fields = Fields(records);
    let mut block = Block::default();
    while !fields.0.is_empty() {
        match fields.record()? {
            (op::CHANNEL, body) => {
                let channel = Channel::parse(body)?;
                channels.insert(channel.id, channel.topic);
            }
            (op::MESSAGE, body) => {
                let Message { channel, sequence, log_time, data, .. } = Message::parse(body)?;
                let name = channels.get(&channel)?;
                let topic = topics.iter().position(|topic| topic.name == *name)?;
                block.annotations.push(Annotation { topic, sequence, log_time, data: data.to_vec() });
            }
            _ => {}
        }
    }
    Some(block)
}
