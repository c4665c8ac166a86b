//! A recording that is annotated still holds the original, byte for byte. Another reader, the `mcap` crate, finds the
//! annotations in it, and what both found in the original; of a sound original, all that we find.

use std::collections::BTreeMap;

use arbitrary::Unstructured;
use mcap::MAGIC;
use mcap::read::Summary;
use mcap::records::{ChunkIndex, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use stillpoint::record::{
    Annotation, Block, Event, FileKind, Fold, Inventory, Original, Piece, Scan, Tail, Topic, recognise,
};

use super::made;

/// Channel, sequence, log time, data.
type Flat = (u16, u32, u64, Vec<u8>);

pub fn check(bytes: &[u8]) {
    let mut u = Unstructured::new(bytes);
    let Ok(file) = made::recording(&mut u) else { return };
    let Ok((messages, inventory)) = scan(&file) else { return };
    let (loose, prefix) = (inventory.has_loose_messages(), inventory.prefix() as usize);
    let is_sound = inventory.damage() == 0;
    let Some(out) = fold(inventory, &file) else { return };
    assert!(strip(&out) == Some(file), "strip does not give it back");

    // Ours, and then the annotations.
    let (after, annotated) = scan(&out).unwrap();
    assert!(annotated.is_finished());
    assert_eq!(after[..messages.len()], messages[..]);
    let mut annotations: Vec<Vec<u8>> =
        blocks().into_iter().flat_map(|block| block.annotations).map(|a| a.data).collect();
    let mut appended: Vec<Vec<u8>> = after[messages.len()..].iter().map(|message| message.3.clone()).collect();
    annotations.sort();
    appended.sort();
    assert_eq!(appended, annotations);

    // From record to record. A length of the original that is nonsense leads nobody on, in it as in the copy.
    let walk = |until: usize| framed(&out[..until], prefix);
    let (original, copy) = walk(prefix).zip(walk(out.len() - MAGIC.len())).unzip();
    let (ours, annotations) = after.split_at(messages.len());
    let wanted = |found: Vec<Flat>| [&common(found, ours), annotations].concat();
    let original = original.unwrap_or_default();
    if let Some(copy) = copy
        && (!loose || copy.in_chunks.is_empty())
    {
        let wanted = if is_sound { after.clone() } else { wanted(original.all()) };
        assert_eq!(common(copy.all(), &wanted), wanted, "from record to record");
    }
    // By the index, which beside messages outside chunks there is none of.
    let summary = Summary::read(&out).expect("a summary that can be read").expect("a summary");
    if !loose {
        let wanted = if is_sound { after.clone() } else { wanted(original.in_chunks) };
        assert_eq!(common(indexed(&out, &summary), &wanted), wanted, "by the index");
    }
}

/// Those of the wanted messages that are found, each as often.
fn common(mut found: Vec<Flat>, wanted: &[Flat]) -> Vec<Flat> {
    let mut take = |message: &&Flat| {
        let place = found.iter().position(|one| one == *message);
        place.map(|place| found.swap_remove(place)).is_some()
    };
    wanted.iter().filter(|message| take(message)).cloned().collect()
}

/// The messages of a recording, and what is in it.
fn scan(file: &[u8]) -> Result<(Vec<Flat>, Inventory), stillpoint::record::Error> {
    let mut scan = Scan::finished(file.len() as u64);
    let mut messages = Vec::new();
    loop {
        match scan.next_event()? {
            Event::Read { offset, length } => {
                scan.insert(length).copy_from_slice(&file[offset as usize..][..length]);
                scan.notify_read(length);
            }
            Event::Message(message) => {
                messages.push((message.channel, message.sequence, message.log_time, message.data.to_vec()));
            }
            Event::End => return Ok((messages, scan.into_inventory())),
            _ => {}
        }
    }
}

fn topics() -> Vec<Topic> {
    let topic = |kind: &str, source: &str| Topic {
        name: format!("{source}/stillpoint/{kind}"),
        schema_name: format!("stillpoint.{kind}"),
        schema_encoding: "protobuf".into(),
        schema: kind.as_bytes().to_vec(),
        message_encoding: "protobuf".into(),
        metadata: BTreeMap::new(),
    };
    vec![topic("segment", "/a"), topic("calibration", "/a"), topic("segment", "/b")]
}

fn blocks() -> Vec<Block> {
    let annotation =
        |topic, sequence, log_time, kind| Annotation { topic, sequence, log_time, data: vec![kind; 40 + topic] };
    vec![
        Block { annotations: vec![annotation(2, 0, 50, 7), annotation(0, 0, 40, 8), annotation(2, 1, 60, 9)] },
        Block { annotations: vec![annotation(1, 0, 70, 10), annotation(0, 1, 80, 11)] },
    ]
}

/// The annotated recording, unless its ids are used up.
fn fold(inventory: Inventory, file: &[u8]) -> Option<Vec<u8>> {
    let behind = &file[inventory.prefix() as usize..];
    let tail = Tail { length: behind.len() as u64, crc: crc32fast::hash(behind) };
    let settings = BTreeMap::from([("version".to_owned(), "1".to_owned())]);
    let (mut fold, mut pieces) = Fold::open(inventory, tail, &settings, &topics()).ok()?;
    pieces.extend(blocks().iter().map(|block| fold.block(&topics(), block).unwrap()));
    pieces.extend(fold.close());
    let mut out = Vec::new();
    for piece in pieces {
        match piece {
            Piece::Original(range) => out.extend_from_slice(&file[range.start as usize..range.end as usize]),
            Piece::Bytes(bytes) => out.extend(bytes),
            Piece::Indexes(length) => assert_eq!(length, 0),
        }
    }
    Some(out)
}

fn strip(out: &[u8]) -> Option<Vec<u8>> {
    let FileKind::Annotated { original, .. } = recognise(&mut &out[..], out.len() as u64).unwrap() else { return None };
    let pieces = |original: &Original| original.pieces(0..original.length()).collect::<Vec<_>>();
    Some(
        pieces(&original)
            .into_iter()
            .flat_map(|range| &out[range.start as usize..range.end as usize])
            .copied()
            .collect(),
    )
}

fn flat(record: &Record<'_>) -> Option<Flat> {
    match record {
        Record::Message { header, data } => Some((header.channel_id, header.sequence, header.log_time, data.to_vec())),
        _ => None,
    }
}

/// Most bytes that a chunk may claim: that crate makes room for what it is told.
const ROOM: u64 = 1 << 24;

/// The messages that one finds who goes from record to record.
#[derive(Default)]
struct Walk {
    outside: Vec<Flat>,
    in_chunks: Vec<Flat>,
}

impl Walk {
    fn all(&self) -> Vec<Flat> {
        [&self.outside[..], &self.in_chunks].concat()
    }
}

/// The messages of all of a file; `None` if a record of the original's `prefix` leads out of it.
fn framed(file: &[u8], prefix: usize) -> Option<Walk> {
    let mut walk = Walk::default();
    let mut rest = file.strip_prefix(MAGIC).unwrap();
    while !rest.is_empty() {
        let at = file.len() - rest.len();
        if at < prefix && prefix - at < 9 {
            return None;
        }
        let length = u64::from_le_bytes(rest[1..9].try_into().unwrap()) as usize;
        if at < prefix && length > prefix - at - 9 {
            return None;
        }
        let (record, behind) = rest.split_at(9 + length);
        match mcap::parse_record(record[0], &record[9..]) {
            // What is wrong in a chunk of the original is wrong in the copy.
            Ok(Record::Chunk { .. }) => walk.in_chunks.extend(in_chunk(record).into_iter().flatten()),
            Ok(record) => walk.outside.extend(flat(&record)),
            Err(_) => {}
        }
        rest = behind;
    }
    Some(walk)
}

/// The messages of a chunk, given its whole record; `None` if anything in it is wrong.
fn in_chunk(record: &[u8]) -> Option<Vec<Flat>> {
    // That crate counts below zero where a record in an uncompressed chunk is longer than the chunk.
    if let Record::Chunk { header, data } = mcap::parse_record(record[0], &record[9..]).ok()?
        && (header.uncompressed_size >= ROOM || header.compression.is_empty() && !are_records(&data))
    {
        return None;
    }
    let options = LinearReaderOptions::default().with_skip_start_magic(true).with_skip_end_magic(true);
    let mut reader =
        LinearReader::new_with_options(options.with_validate_chunk_crcs(true).with_record_length_limit(ROOM as usize));
    let (mut rest, mut messages) = (record, Vec::new());
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::ReadRequest(length) => {
                let (read, behind) = rest.split_at(length.min(rest.len()));
                reader.insert(read.len()).copy_from_slice(read);
                reader.notify_read(read.len());
                rest = behind;
            }
            LinearReadEvent::Record { data, opcode } => {
                messages.extend(flat(&mcap::parse_record(opcode, data).ok()?));
            }
        }
    }
    Some(messages)
}

/// Whether bytes are records to their end.
fn are_records(mut bytes: &[u8]) -> bool {
    while let Some(length) = bytes.get(1..9) {
        let length = u64::from_le_bytes(length.try_into().unwrap()) as usize;
        let Some(rest) = bytes[9..].get(length..) else { return false };
        bytes = rest;
    }
    bytes.is_empty()
}

/// The messages that the chunk indexes lead to, of chunks in which nothing is wrong.
fn indexed(file: &[u8], summary: &Summary) -> Vec<Flat> {
    let chunk = |index: &ChunkIndex| &file[index.chunk_start_offset as usize..][..index.chunk_length as usize];
    let sound = summary.chunk_indexes.iter().filter(|index| in_chunk(chunk(index)).is_some());
    let messages = sound.flat_map(|index| summary.stream_chunk(file, index).unwrap());
    let flat =
        |message: mcap::Message<'_>| (message.channel.id, message.sequence, message.log_time, message.data.to_vec());
    messages.filter_map(|message| message.ok().map(flat)).collect()
}
