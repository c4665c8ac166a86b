//! Places of the chunks in a recording, and the channels that their message indexes name: by framing alone, ahead of a
//! [`Scan`](super::Scan), whose result does not depend on them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::Error;
use super::Inventory;
use super::Places;
use super::frame_window::Frame;
use super::places::KnownChunk;
use super::records::{ChunkHeader, ChunkIndex};
use super::walk::{ReadAt, Walk, summary_section};
use super::wire::{Fields, op};

/// Read size, in bytes: between two chunks there are mostly a few bytes only.
const BLOCK: u64 = 4 << 10;
/// Number of bytes that is enough for the head of a chunk.
const HEAD: u64 = 128;

/// Read size for the summary, which is read to its end, in bytes.
const SUMMARY_BLOCK: u64 = 64 << 10;
/// Longest chunk index that is read (1 MiB): enough to name all possible channels.
const INDEX: u64 = 1 << 20;

/// The chunks of a recording, in order, up to the first damage.
pub struct Chunks {
    walk: Walk,
    open: Option<Chunk>,
    /// Channels that the message indexes of the open chunk name.
    named: BTreeSet<u16>,
    length: u64,
    /// Claims of the summary about the chunks, once it was read.
    claims: Option<Claims>,
    /// Places that are used instead of the data, and the offset up to which they were returned.
    known: Option<(Arc<Places>, u64)>,
}

/// A chunk record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Offset of the record in the file.
    pub offset: u64,
    /// Length of its body, in bytes.
    pub length: u64,
    /// Claimed size of its decompressed records, in bytes; 0 if they are not compressed.
    pub inflated: u64,
    /// Channels that its message indexes name; `None` if these are irregular, or if the summary names others.
    pub channels: Option<Vec<u16>>,
}

impl Chunk {
    fn known(place: &KnownChunk) -> Self {
        let frame = place.frame();
        let inflated = place.header().inflated();
        Self { offset: frame.offset, length: frame.length, inflated, channels: place.channels() }
    }

    /// Range of its body in the file.
    pub fn body(&self) -> std::ops::Range<u64> {
        let start = self.offset + super::wire::FRAME as u64;
        start..start.saturating_add(self.length)
    }
}

impl Chunks {
    /// The chunks of a recording of this length, from `offset` on, where a record begins.
    pub fn new(offset: u64, length: u64) -> Self {
        let walk = Walk::new(offset..length, BLOCK);
        Self { walk, open: None, named: BTreeSet::new(), length, claims: None, known: None }
    }

    /// The chunks of a recording by its summary alone; nothing of the data is read.
    pub fn known(places: Arc<Places>) -> Self {
        Self { known: Some((places, 0)), ..Self::new(0, 0) }
    }

    /// Continues at `offset`, where a record begins after all chunks returned so far.
    pub fn seek(&mut self, offset: u64) {
        (self.walk, self.open) = (Walk::new(offset..self.length, BLOCK), None);
        self.known.iter_mut().for_each(|(_, from)| *from = offset);
    }

    /// Next chunk.
    ///
    /// # Errors
    /// If the recording cannot be read.
    pub fn next(&mut self, file: &mut impl ReadAt) -> Result<Option<Chunk>, Error> {
        if let Some((places, from)) = &mut self.known {
            let next = places.next(*from).map(Chunk::known);
            *from = next.as_ref().map_or(*from, |chunk| chunk.body().end);
            return Ok(next);
        }
        let Some(chunk) = self.framed(file)? else { return Ok(None) };
        let claims = self.claims(file)?;
        let claimed = claims.about(file, chunk.offset)?;
        let agrees = |named: &Vec<u16>| {
            claimed.is_none_or(|claimed| {
                claimed.len() == named.len() && named.iter().all(|channel| claimed.contains_key(channel))
            })
        };
        Ok(Some(Chunk { channels: chunk.channels.filter(agrees), ..chunk }))
    }

    /// Whether chunks may be skipped: according to the summary, they define no unknown schema or channel. Always
    /// `false` without summary, and `true` where nothing but the summary is used, by which a chunk can be skipped only if
    /// its channels are known.
    ///
    /// # Errors
    /// If the recording cannot be read.
    pub fn define_nothing_beyond(&mut self, known: &Inventory, file: &mut impl ReadAt) -> Result<bool, Error> {
        if self.known.is_some() {
            return Ok(true);
        }
        let Some(undefined) = &mut self.claims(file)?.undefined else { return Ok(false) };
        undefined.schemas.retain(|id| !known.schemas().contains_key(id));
        undefined.channels.retain(|id| !known.channels().contains_key(id));
        Ok(undefined.schemas.is_empty() && undefined.channels.is_empty())
    }

    fn claims(&mut self, file: &mut impl ReadAt) -> Result<&mut Claims, Error> {
        match &mut self.claims {
            Some(_) => {}
            none => *none = Some(Claims::of(file, self.length)?),
        }
        Ok(self.claims.get_or_insert_default())
    }

    fn framed(&mut self, file: &mut impl ReadAt) -> Result<Option<Chunk>, Error> {
        while let Some(frame) = self.walk.next(file)? {
            match frame.opcode {
                op::CHUNK => {
                    let next = self.chunk(file, frame)?;
                    self.named.clear();
                    if let Some(chunk) = self.open.replace(next) {
                        return Ok(Some(chunk));
                    }
                }
                op::MESSAGE_INDEX => {
                    let channel = Fields(self.walk.body(file, frame, 2)?).u16();
                    if let Some(Chunk { channels: channels @ Some(_), .. }) = &mut self.open {
                        let new = channel.filter(|&channel| self.named.insert(channel));
                        *channels = channels.take().zip(new).map(|(mut known, new)| {
                            known.push(new);
                            known
                        });
                    }
                }
                // Any other record may be an index whose opcode is damaged, which must not be missed.
                opcode => {
                    if let Some(mut chunk) = self.open.take() {
                        let usual = matches!(opcode, op::ATTACHMENT | op::METADATA | op::DATA_END | 0x80..);
                        if !usual {
                            chunk.channels = None;
                        }
                        return Ok(Some(chunk));
                    }
                    if opcode == op::DATA_END {
                        break;
                    }
                }
            }
        }
        Ok(self.open.take())
    }

    fn chunk(&mut self, file: &mut impl ReadAt, frame: Frame) -> Result<Chunk, Error> {
        let header = ChunkHeader::parse(&mut Fields(self.walk.body(file, frame, HEAD)?));
        let inflated = header.map_or(0, |header| header.inflated());
        Ok(Chunk { offset: frame.offset, length: frame.length, inflated, channels: Some(Vec::new()) })
    }
}

/// Claims of the summary. Its chunk indexes are read in step with the chunks, since both are mostly in the same order.
#[derive(Default)]
struct Claims {
    walk: Walk,
    next: Option<ChunkIndex>,
    /// Definitions it lists that were not met yet; `None` without summary.
    undefined: Option<Definitions>,
}

/// Ids of schemas and channels.
#[derive(Default)]
struct Definitions {
    schemas: BTreeSet<u16>,
    channels: BTreeSet<u16>,
}

impl Claims {
    fn of(file: &mut impl ReadAt, length: u64) -> Result<Self, Error> {
        let Some(section) = summary_section(file, length)? else { return Ok(Self::default()) };
        let mut walk = Walk::new(section.clone(), SUMMARY_BLOCK);
        let mut definitions = Definitions::default();
        while let Some(frame) = walk.next(file)? {
            // Both begin with their id.
            let id = Fields(walk.body(file, frame, 2)?).u16();
            match frame.opcode {
                op::SCHEMA => definitions.schemas.extend(id),
                op::CHANNEL => definitions.channels.extend(id),
                _ => {}
            }
        }
        Ok(Self { walk: Walk::new(section, BLOCK), next: None, undefined: Some(definitions) })
    }

    /// Offsets of the message indexes of the chunk at `offset`, by channel; `None` if the summary lists it out of order
    /// or not at all.
    fn about(&mut self, file: &mut impl ReadAt, offset: u64) -> Result<Option<&BTreeMap<u16, u64>>, Error> {
        while self.next.as_ref().is_none_or(|index| index.offset < offset) {
            let Some(frame) = self.walk.next(file)? else { return Ok(None) };
            if frame.opcode == op::CHUNK_INDEX && frame.length <= INDEX {
                self.next = ChunkIndex::parse(self.walk.body(file, frame, INDEX)?);
            }
        }
        Ok(self.next.as_ref().filter(|index| index.offset == offset).map(|index| &index.message_indexes))
    }
}
