//! Shells in memory: scanning and folding byte vectors.

use std::collections::BTreeMap;

use stillpoint::record::{
    Annotation, Block, Channel, Damage, Event, Fold, Inventory, Piece, Scan, Schema, Tail, Topic,
};

/// An event that owns its data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Told {
    Header(String, String),
    Schema(Schema),
    Channel(Channel),
    Message { channel: u16, sequence: u32, log_time: u64, publish_time: u64, data: Vec<u8> },
    ChunkEnd,
    Damage(Damage),
}

/// Scans a recording that is all there, in one go.
pub fn scan(file: &[u8]) -> (Vec<Told>, Inventory) {
    follow(file, &[file.len()], &[1 << 20])
}

/// Scans a recording that grows by `growth` bytes at a time (and is finished once these are used up), read in pieces
/// of `reads` bytes, over and over.
pub fn follow(file: &[u8], growth: &[usize], reads: &[usize]) -> (Vec<Told>, Inventory) {
    let mut scan = Scan::new();
    let mut told = Vec::new();
    let mut growth = growth.iter();
    let mut reads = reads.iter().cycle();
    let mut length = 0;
    loop {
        match scan.next_event().unwrap() {
            Event::Read { offset, length: needed } => {
                let offset = offset as usize;
                assert!(offset + needed <= length, "{needed} bytes at {offset} of {length} asked for");
                let take = (*reads.next().unwrap()).min(length - offset);
                scan.insert(take).copy_from_slice(&file[offset..offset + take]);
                scan.notify_read(take);
            }
            Event::Wait => match growth.next() {
                Some(step) => {
                    length = (length + step).min(file.len());
                    scan.extend(length as u64);
                }
                None => {
                    length = file.len();
                    scan.extend(length as u64);
                    scan.finish();
                }
            },
            Event::End => return (told, scan.into_inventory()),
            event => told.push(Told::of(event)),
        }
    }
}

impl Told {
    /// An event that is told, not asked.
    pub fn of(event: Event<'_>) -> Self {
        match event {
            Event::Header { profile, library } => Self::Header(profile.to_owned(), library.to_owned()),
            Event::Schema(schema) => Self::Schema(schema.clone()),
            Event::Channel(channel) => Self::Channel(channel.clone()),
            Event::Message(message) => Self::Message {
                channel: message.channel,
                sequence: message.sequence,
                log_time: message.log_time,
                publish_time: message.publish_time,
                data: message.data.to_vec(),
            },
            Event::ChunkEnd => Self::ChunkEnd,
            Event::Damage(damage) => Self::Damage(damage),
            Event::Read { .. } | Event::Chunk { .. } | Event::Wait | Event::End => panic!("{event:?} tells nothing"),
        }
    }
}

/// The messages among the events.
pub fn messages(told: &[Told]) -> Vec<&Told> {
    told.iter().filter(|event| matches!(event, Told::Message { .. })).collect()
}

pub fn topics() -> Vec<Topic> {
    ["segment", "calibration", "segment"]
        .into_iter()
        .zip(["/a", "/a", "/b"])
        .map(|(kind, source)| Topic {
            name: format!("{source}/stillpoint/{kind}"),
            schema_name: format!("stillpoint.{kind}"),
            schema_encoding: "protobuf".into(),
            schema: kind.as_bytes().to_vec(),
            message_encoding: "protobuf".into(),
            metadata: BTreeMap::new(),
        })
        .collect()
}

/// Two blocks over three topics.
pub fn blocks() -> Vec<Block> {
    let annotation = |topic, sequence, log_time| Annotation { topic, sequence, log_time, data: vec![7; 40 + topic] };
    vec![
        Block { annotations: vec![annotation(2, 0, 50), annotation(0, 0, 40), annotation(2, 1, 60)] },
        Block { annotations: vec![annotation(1, 0, 70), annotation(0, 1, 80)] },
    ]
}

pub fn settings() -> BTreeMap<String, String> {
    BTreeMap::from([("version".to_owned(), "1".to_owned()), ("config".to_owned(), "[still]".to_owned())])
}

/// The annotated recording.
pub fn fold(file: &[u8], topics: &[Topic], blocks: &[Block]) -> Vec<u8> {
    fold_scanned(scan(file).1, file, topics, blocks)
}

/// The same, of a recording that was scanned.
pub fn fold_scanned(inventory: Inventory, file: &[u8], topics: &[Topic], blocks: &[Block]) -> Vec<u8> {
    let behind = &file[inventory.prefix() as usize..];
    let tail = Tail { length: behind.len() as u64, crc: crc32fast::hash(behind) };
    let (mut fold, mut pieces) = Fold::open(inventory, tail, &settings(), topics).unwrap();
    pieces.extend(blocks.iter().map(|block| fold.block(topics, block).unwrap()));
    pieces.extend(fold.close());
    put(pieces, file, &[])
}

/// What pieces of a recording come to, with the chunk indexes that were taken.
pub fn put(pieces: Vec<Piece>, file: &[u8], indexes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    for piece in pieces {
        match piece {
            Piece::Original(range) => out.extend_from_slice(&file[range.start as usize..range.end as usize]),
            Piece::Bytes(bytes) => out.extend(bytes),
            Piece::Indexes(length) => {
                assert_eq!(length as usize, indexes.len());
                out.extend_from_slice(indexes);
            }
        }
    }
    out
}
