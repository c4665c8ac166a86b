//! A recording that is annotated still holds the original, byte for byte, and all that is whole in it is found by another
//! reader, the `mcap` crate, and so are the annotations.

use std::collections::BTreeMap;

use arbitrary::Unstructured;
use mcap::MAGIC;
use mcap::read::{ChunkReader, Summary};
use mcap::records::Record;
use stillpoint::record::{
    Annotation, Block, Event, Fold, Inventory, Kind, Original, Piece, Scan, Tail, Topic, recognise,
};

use super::made;

/// Channel, sequence, log time, data.
type Flat = (u16, u32, u64, Vec<u8>);

pub fn check(bytes: &[u8]) {
    let mut u = Unstructured::new(bytes);
    let Ok(file) = made::recording(&mut u) else { return };
    let Ok((messages, inventory)) = scan(&file) else { return };
    let (loose, prefix) = (inventory.has_loose_messages(), inventory.prefix() as usize);
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

    // From record to record.
    match framed(&out, prefix) {
        Some((framed, chunks)) if !(loose && chunks) => contains(framed, &after, "from record to record"),
        // A length of the original that is nonsense leads nobody on, in it as in the copy.
        _ => {}
    }
    // By the index, which beside messages outside chunks there is none of.
    let summary = Summary::read(&out).expect("a summary that can be read").expect("a summary");
    if !loose {
        contains(indexed(&out, &summary), &after, "by the index");
    }
}

fn contains(mut found: Vec<Flat>, wanted: &[Flat], how: &str) {
    let mut wanted = wanted.to_vec();
    wanted.sort();
    found.sort();
    let mut found = found.iter();
    let lost = wanted.iter().filter(|message| !found.by_ref().any(|one| one == *message)).count();
    assert_eq!(lost, 0, "messages that the mcap crate does not find {how}");
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
    let Kind::Annotated { original, .. } = recognise(&mut &out[..], out.len() as u64).unwrap() else { return None };
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

/// The messages that one finds who goes from record to record through the closing magic, and whether some are in chunks;
/// `None` if a record of the original's `prefix` leads out of it.
fn framed(file: &[u8], prefix: usize) -> Option<(Vec<Flat>, bool)> {
    let (mut messages, mut chunks) = (Vec::new(), false);
    let mut rest = file.strip_prefix(MAGIC).unwrap();
    while rest != MAGIC {
        let at = file.len() - rest.len();
        let length = u64::from_le_bytes(rest[1..9].try_into().unwrap()) as usize;
        if at < prefix && length > prefix.checked_sub(at + 9)? {
            return None;
        }
        let content = &rest[9..][..length];
        match mcap::parse_record(rest[0], content) {
            Ok(Record::Chunk { header, data }) if header.uncompressed_size < ROOM => {
                chunks = true;
                // What is wrong in a chunk of the original is wrong in the copy.
                let records = ChunkReader::new(header, &data).into_iter().flatten();
                let records: Result<Vec<_>, _> = records.map(|record| record.map(|record| flat(&record))).collect();
                messages.extend(records.into_iter().flatten().flatten());
            }
            Ok(record) => messages.extend(flat(&record)),
            Err(_) => {}
        }
        rest = &rest[9 + length..];
    }
    Some((messages, chunks))
}

/// The messages that the chunk indexes lead to.
fn indexed(file: &[u8], summary: &Summary) -> Vec<Flat> {
    let chunks = summary.chunk_indexes.iter().filter(|index| index.uncompressed_size < ROOM);
    let messages = chunks.flat_map(|index| summary.stream_chunk(file, index).unwrap());
    let flat =
        |message: mcap::Message<'_>| (message.channel.id, message.sequence, message.log_time, message.data.to_vec());
    messages.map(|message| flat(message.unwrap())).collect()
}
