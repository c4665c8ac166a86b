//! `annotated = original ⊕ annotations`, as a sequence of pieces. A piece of the original is
//! a range of its bytes, which the shell copies.

use std::collections::BTreeMap;
use std::ops::Range;

use crc32fast::Hasher;

use super::emitter::{Emitter, Manner, Taken, combine};
use super::marks::{COMPLETED, INDEXES, LIBRARY, METADATA, PREFIX, RECOVERED, TAIL, WHOLE};
use super::records::{AttachmentIndex, Header, MetadataIndex, write_metadata};
use super::reindex::{self, Reindexed, Reindexing};
use super::summary::Summary;
use super::wire::{FRAME, Put, op};
use super::{Block, Error, Inventory, Piece, Topic};

/// Bytes after the [prefix](Inventory::prefix) of the original.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tail {
    /// Length in bytes, through the end of the file.
    pub length: u64,
    /// CRC-32, as `crc32fast::hash` computes it.
    pub crc: u32,
}

/// Folds annotations into a recording.
///
/// The annotated recording is the pieces of [`Fold::open`], one for each [`Fold::block`], and those of [`Fold::close`],
/// in this order. The first piece is the prefix of the original at its own place: writing in place can skip it.
///
/// Memory grows with the number of chunks unless the caller takes their indexes: first from the
/// [scan](super::Scan::take_indexes), then from the [fold](Fold::take_indexes). The same holds for chunks whose message
/// indexes are written anew.
pub struct Fold {
    emitter: Emitter,
    /// Reindexed chunks that were not taken, and the total length of all.
    reindexing: Reindexing,
    /// Attachment that holds message indexes, once it has begun.
    indexes: Option<OpenAttachment>,
}

impl Fold {
    /// Begins with the original's prefix, its tail as an attachment, the metadata, and definitions that only its
    /// summary had.
    ///
    /// `settings` are what determines the annotations: version and effective configuration. The key `prefix` is
    /// reserved.
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
        let mut pieces = vec![Piece::Original(0..inventory.prefix())];
        let taken = Taken {
            schemas: inventory.schemas().keys().copied().collect(),
            channels: inventory.channels().keys().chain(&inventory.mentioned).copied().collect(),
        };
        let (prefix, headless) = (inventory.prefix(), inventory.is_bare());
        let (profile, only) = (inventory.profile().to_owned(), inventory.summary_only.clone());
        let manner = match (inventory.loose, inventory.has_no_message_indexes()) {
            (true, _) => Manner::Loose,
            (false, true) => Manner::Chunks,
            (false, false) => Manner::Indexed,
        };
        let (crc, whole, recovered) = (inventory.prefix_crc(), inventory.prefix, inventory.take_recovered());
        let named = inventory.summary.split_off(prefix);
        let mut reindexing = std::mem::take(&mut inventory.summary.reindexing);
        let mut emitter = Emitter::new(prefix, crc, inventory.summary, manner, taken);
        emitter.assign(topics)?;

        if headless {
            // Cut off after its magic: without a header the result would not be MCAP.
            let mut header = Vec::new();
            Header { profile, library: library() }.write(&mut header);
            emitter.pass(&header);
            pieces.push(Piece::Bytes(header));
        }
        let mut definitions = Vec::new();
        for id in only.schemas {
            emitter.summary.schemas.get(&id).into_iter().for_each(|schema| schema.write(&mut definitions));
        }
        for id in only.channels {
            emitter.summary.channels.get(&id).into_iter().for_each(|channel| channel.write(&mut definitions));
        }
        let mut settings = settings.clone();
        settings.insert(PREFIX.to_owned(), prefix.to_string());
        if !recovered.is_empty() {
            let length: u64 = recovered.iter().map(|range| range.end - range.start).sum();
            settings.insert(RECOVERED.to_owned(), (definitions.len() as u64 + length).to_string());
            settings.insert(WHOLE.to_owned(), whole.to_string());
        }
        if let Some(last) = reindexing.last.take_if(|last| manner == Manner::Indexed && last.end() == prefix) {
            let mut out = Vec::new();
            let chunk = last.complete(&mut out);
            emitter.summary.index_now(&chunk);
            emitter.pass(&out);
            settings.insert(COMPLETED.to_owned(), out.len().to_string());
            pieces.push(Piece::Bytes(out));
        }
        reindexing.settle();
        pieces.extend(keep_tail(&mut emitter, prefix, tail));

        let mut out = Vec::new();
        write_settings(&mut emitter, &settings, &mut out);
        emitter.pass(&definitions);
        out.extend(definitions);
        pieces.push(Piece::Bytes(out));
        recover(&mut emitter, &recovered, named);
        pieces.extend(recovered.into_iter().map(Piece::Original));
        Ok((Self { emitter, reindexing, indexes: None }, pieces))
    }

    /// Piece that holds a block. New topics are appended to the end of the list.
    ///
    /// # Errors
    /// If an annotation's topic is not in the list, if ids run out, or if compression fails.
    pub fn block(&mut self, topics: &[Topic], block: &Block) -> Result<Piece, Error> {
        self.emitter.block(topics, block).map(Piece::Bytes)
    }

    /// Pieces that hold message indexes of the chunks that [`Scan::take_reindexed`](super::Scan::take_reindexed)
    /// returned. All of them must follow the blocks, in their order.
    pub fn reindex(&mut self, taken: &[u8]) -> Vec<Piece> {
        reindex::read(taken).flat_map(|chunk| self.reindex_chunk(chunk)).collect()
    }

    fn reindex_chunk(&mut self, chunk: Reindexed) -> Vec<Piece> {
        let emitter = &mut self.emitter;
        if emitter.manner() != Manner::Indexed {
            emitter.summary.index_now(&chunk.chunk);
            return Vec::new();
        }
        let mut pieces = Vec::new();
        let attachment = self.indexes.get_or_insert_with(|| {
            let (attachment, front) = OpenAttachment::begin(emitter, INDEXES, self.reindexing.length);
            pieces.push(Piece::Bytes(front));
            attachment
        });
        let mut out = Vec::new();
        let index = chunk.replace(emitter.position(), &mut out);
        emitter.summary.index_now(&index);
        emitter.pass(&out);
        attachment.crc.update(&out);
        pieces.push(Piece::Bytes(out));
        pieces
    }

    /// Takes the chunk indexes since the last call. They must be written in the place of [`Piece::Indexes`].
    pub fn take_indexes(&mut self) -> Vec<u8> {
        self.emitter.summary.take_indexes()
    }

    /// Last pieces: the end of the data, the merged summary, the footer.
    pub fn close(mut self) -> Vec<Piece> {
        let kept = self.reindexing.take();
        let mut pieces = self.reindex(&kept);
        if let Some(attachment) = self.indexes {
            let crc = attachment.crc.finalize().to_le_bytes();
            self.emitter.pass(&crc);
            self.emitter.summary.attachments.push(attachment.index);
            pieces.push(Piece::Bytes(crc.to_vec()));
        }
        pieces.extend(self.emitter.close());
        pieces
    }
}

/// Attachment that keeps the original's tail.
fn keep_tail(emitter: &mut Emitter, prefix: u64, tail: Tail) -> [Piece; 3] {
    let (OpenAttachment { index, crc }, front) = OpenAttachment::begin(emitter, TAIL, tail.length);
    emitter.summary.attachments.push(index);
    emitter.pass_unseen(tail.length, tail.crc);
    let crc = combine(crc.finalize(), tail.crc, tail.length).to_le_bytes();
    emitter.pass(&crc);
    let kept = Piece::Original(prefix..prefix + tail.length);
    [Piece::Bytes(front), kept, Piece::Bytes(crc.to_vec())]
}

/// Repeats the whole records after the prefix, with their attachments and metadata. Their CRC is given as 0, since a
/// damaged recording has no CRC to continue.
fn recover(emitter: &mut Emitter, recovered: &[Range<u64>], mut named: Summary) {
    let mut places = BTreeMap::new();
    for range in recovered {
        places.insert(range.start, emitter.position());
        emitter.pass_unseen(range.end - range.start, 0);
    }
    named.relocate(|offset| match places.range(..=offset).next_back() {
        Some((start, place)) => offset - start + place,
        None => offset,
    });
    emitter.summary.attachments.append(&mut named.attachments);
    emitter.summary.metadata.append(&mut named.metadata);
}

/// An attachment whose head has been written.
struct OpenAttachment {
    index: AttachmentIndex,
    crc: Hasher,
}

impl OpenAttachment {
    /// Begins an attachment of `data_size` bytes here. Also returns the bytes that precede its data.
    fn begin(emitter: &mut Emitter, name: &str, data_size: u64) -> (Self, Vec<u8>) {
        let until = emitter.summary.span.map_or(0, |(_, until)| until);
        let mut index = AttachmentIndex {
            offset: emitter.position(),
            length: 0,
            log_time: until,
            create_time: until,
            data_size,
            name: name.to_owned(),
            media_type: "application/octet-stream".to_owned(),
        };
        let mut head = Vec::new();
        index.put_attachment(&mut head);
        let mut crc = Hasher::new();
        crc.update(&head);
        let body = head.len() as u64 + data_size + 4;
        index.length = FRAME as u64 + body;
        let mut front = vec![op::ATTACHMENT];
        front.put_u64(body);
        front.extend(head);
        emitter.pass(&front);
        (Self { index, crc }, front)
    }
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

/// Library name in our headers.
pub(super) fn library() -> String {
    format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION"))
}
