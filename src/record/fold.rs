//! `annotated = original ⊕ annotations`, as pieces to write one behind the other.
//! Copying the original's bytes and writing the pieces is left to the shell.

use std::collections::BTreeMap;
use std::ops::Range;

use super::emitter::{Emitter, Taken, combine};
use super::records::{AttachmentIndex, Header, MetadataIndex, write_metadata};
use super::wire::{FRAME, Put, op};
use super::{Block, Error, Inventory, Topic};

/// Name of the metadata record that says how annotations came about.
pub(super) const METADATA: &str = "stillpoint";
/// Its key for the length in bytes of what was copied from the original, in an annotated recording.
pub(super) const PREFIX: &str = "prefix";
/// Name of the attachment that keeps what stands behind the prefix in the original.
pub(super) const TAIL: &str = "stillpoint.tail";
/// What our headers start with.
pub(super) const LIBRARY: &str = "stillpoint ";

/// A part of the annotated recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// These bytes of the original.
    Original(Range<u64>),
    /// These bytes.
    Bytes(Vec<u8>),
    /// All chunk indexes that were taken, one behind the other: so many bytes.
    Indexes(u64),
}

/// What stands behind the [prefix](Inventory::prefix) of the original.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tail {
    /// Its length in bytes, through the end of the file.
    pub length: u64,
    /// Its CRC-32, as `crc32fast::hash` computes it.
    pub crc: u32,
}

/// Folds annotations into a recording.
///
/// The annotated recording is the pieces of [`Fold::open`], one for each [`Fold::block`], and those of [`Fold::close`],
/// in this order. The first piece is the prefix of the original, in its own place: writing in place can skip it.
///
/// Memory grows with the number of chunks only if nobody takes their indexes: from the [scan](super::Scan::take_indexes)
/// first, then from the [fold](Fold::take_indexes).
pub struct Fold {
    emitter: Emitter,
}

impl Fold {
    /// Begins: the original's prefix, its tail as an attachment, the metadata, and whatever only its summary knew.
    ///
    /// `settings` are what determines the annotations: version and effective configuration. The key `prefix` is ours.
    ///
    /// # Errors
    /// If the recording leaves too few ids for the topics.
    pub fn open(
        mut inventory: Inventory,
        tail: Tail,
        settings: &BTreeMap<String, String>,
        topics: &[Topic],
    ) -> Result<(Self, Vec<Piece>), Error> {
        inventory.complete();
        let mut pieces = vec![Piece::Original(0..inventory.prefix)];
        let taken = Taken {
            schemas: inventory.schemas().keys().copied().collect(),
            channels: inventory.channels().keys().chain(&inventory.mentioned).copied().collect(),
        };
        let (prefix, headless) = (inventory.prefix, inventory.is_bare());
        let only = inventory.summary_only.clone();
        let crc = inventory.prefix_crc();
        let mut emitter = Emitter::new(prefix, crc, inventory.summary, !inventory.loose, taken);
        emitter.assign(topics)?;

        if headless {
            // Cut off behind its magic: without a header the result would not be MCAP.
            let mut header = Vec::new();
            Header { profile: String::new(), library: library() }.write(&mut header);
            emitter.pass(&header);
            pieces.push(Piece::Bytes(header));
        }
        pieces.extend(attach(&mut emitter, prefix, tail));

        let mut settings = settings.clone();
        settings.insert(PREFIX.to_owned(), prefix.to_string());
        let mut out = Vec::new();
        write_settings(&mut emitter, &settings, &mut out);
        let start = out.len();
        for id in only.schemas {
            emitter.summary.schemas.get(&id).into_iter().for_each(|schema| schema.write(&mut out));
        }
        for id in only.channels {
            emitter.summary.channels.get(&id).into_iter().for_each(|channel| channel.write(&mut out));
        }
        emitter.pass(out.get(start..).unwrap_or_default());
        pieces.push(Piece::Bytes(out));
        Ok((Self { emitter }, pieces))
    }

    /// The piece that holds a block. Topics that are new to the list come at its end.
    ///
    /// # Errors
    /// If an annotation's topic is not in the list, if ids run out, or if compression fails.
    pub fn block(&mut self, topics: &[Topic], block: &Block) -> Result<Piece, Error> {
        self.emitter.block(topics, block).map(Piece::Bytes)
    }

    /// Hands over the chunk indexes since the last time, to be given back in the place of [`Piece::Indexes`].
    pub fn take_indexes(&mut self) -> Vec<u8> {
        self.emitter.summary.take_indexes()
    }

    /// The last pieces: the end of the data, the merged summary, the footer.
    pub fn close(self) -> Vec<Piece> {
        self.emitter.close()
    }
}

/// The attachment that keeps the original's tail.
fn attach(emitter: &mut Emitter, prefix: u64, tail: Tail) -> [Piece; 3] {
    let until = emitter.summary.span.map_or(0, |(_, until)| until);
    let mut index = AttachmentIndex {
        offset: emitter.position(),
        length: 0,
        log_time: until,
        create_time: until,
        data_size: tail.length,
        name: TAIL.to_owned(),
        media_type: "application/octet-stream".to_owned(),
    };
    let mut head = Vec::new();
    index.put_attachment(&mut head);
    let crc = combine(crc32fast::hash(&head), tail.crc, tail.length);
    let body = head.len() as u64 + tail.length + 4;
    index.length = FRAME as u64 + body;
    emitter.summary.attachments.push(index);

    let mut front = vec![op::ATTACHMENT];
    front.put_u64(body);
    front.extend(head);
    emitter.pass(&front);
    emitter.pass_unseen(tail.length, tail.crc);
    emitter.pass(&crc.to_le_bytes());
    let kept = Piece::Original(prefix..prefix + tail.length);
    [Piece::Bytes(front), kept, Piece::Bytes(crc.to_le_bytes().to_vec())]
}

/// Appends the metadata record.
pub(super) fn write_settings(emitter: &mut Emitter, settings: &BTreeMap<String, String>, out: &mut Vec<u8>) {
    let (offset, start) = (emitter.position(), out.len());
    write_metadata(out, METADATA, settings);
    let record = out.get(start..).unwrap_or_default();
    emitter.pass(record);
    let length = record.len() as u64;
    emitter.summary.metadata.push(MetadataIndex { offset, length, name: METADATA.to_owned() });
}

/// The program that writes.
pub(super) fn library() -> String {
    format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION"))
}
