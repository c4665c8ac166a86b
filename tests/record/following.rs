//! Recordings while they are recorded: after every write of a recorder, and through every interruption of the reader.

use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex};

use mcap::{Compression, WriteOptions, Writer};
use proptest::prelude::*;
use stillpoint::record::{Event, Inventory, Scan};

use crate::drive::scan;
use crate::recordings::{Recipe, mistreated};

/// A change of a file: where, and which bytes.
type Change = (u64, Vec<u8>);

/// A file with a place in it, and each change that was ever made.
#[derive(Clone, Default)]
struct Disk(Arc<Mutex<(u64, Vec<Change>)>>);

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let (at, changes) = &mut *self.0.lock().unwrap();
        changes.push((*at, bytes.to_vec()));
        *at += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let (at, changes) = &mut *self.0.lock().unwrap();
        let end = changes.iter().map(|(at, bytes)| at + bytes.len() as u64).max().unwrap_or(0);
        *at = match to {
            SeekFrom::Start(place) => place,
            SeekFrom::End(by) => end.saturating_add_signed(by),
            SeekFrom::Current(by) => at.saturating_add_signed(by),
        };
        Ok(*at)
    }
}

/// Follows a file through its changes, taking the scan apart and up again wherever `interrupted` says so.
fn follow(changes: &[Change], mut interrupted: impl FnMut() -> bool) -> (Vec<String>, Inventory) {
    let mut scan = Scan::new();
    let (mut file, mut told) = (Vec::new(), Vec::new());
    let mut changes = changes.iter();
    loop {
        match scan.next_event().unwrap() {
            Event::Read { offset, length } => {
                let bytes = &file[offset as usize..offset as usize + length];
                scan.insert(length).copy_from_slice(bytes);
                scan.notify_read(length);
            }
            Event::Wait => {
                if let Some(position) = scan.position().filter(|_| interrupted()) {
                    let saved = rmp_serde::to_vec_named(&position).unwrap();
                    scan = Scan::resume(rmp_serde::from_slice(&saved).unwrap());
                }
                match changes.next() {
                    Some((at, bytes)) => {
                        file.resize(file.len().max(*at as usize + bytes.len()), 0);
                        file[*at as usize..][..bytes.len()].copy_from_slice(bytes);
                        scan.extend(file.len() as u64);
                    }
                    None => {
                        scan.extend(file.len() as u64);
                        scan.finish();
                    }
                }
            }
            Event::End => return (told, scan.into_inventory()),
            event => told.push(format!("{event:?}")),
        }
    }
}

#[test]
fn a_recorder_may_be_looked_at_after_each_of_its_writes() {
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        for (seeking, flushing, indexes) in [(true, false, true), (true, true, false), (false, true, true)] {
            let disk = Disk::default();
            let options = WriteOptions::new().compression(compression).chunk_size(Some(900));
            let options = options.disable_seeking(!seeking).emit_message_indexes(indexes);
            let mut writer = Writer::with_options(disk.clone(), options).unwrap();
            let schema = writer.add_schema("a/T", "ros2msg", b"int8 x").unwrap();
            let channel = writer.add_channel(schema, "/a", "cdr", &BTreeMap::new()).unwrap();
            for i in 0..100_u64 {
                let header = mcap::records::MessageHeader {
                    channel_id: channel,
                    sequence: i as u32,
                    log_time: i,
                    publish_time: i,
                };
                writer.write_to_known_channel(&header, &[i as u8; 40]).unwrap();
                if flushing && i % 7 == 0 {
                    writer.flush().unwrap();
                }
            }
            writer.finish().unwrap();
            let changes = disk.0.lock().unwrap().1.clone();
            let whole = follow(&[(0, file(&changes))], || false);
            assert_eq!(whole.1.damage(), 0);
            assert_eq!(whole.0.iter().filter(|event| event.starts_with("Message")).count(), 100);
            for interrupted in [false, true] {
                let (told, inventory) = follow(&changes, || interrupted);
                assert_eq!(told, whole.0, "{compression:?} {seeking} {flushing} {indexes} {interrupted}");
                assert_eq!(format!("{inventory:?}"), format!("{:?}", whole.1));
            }
        }
    }
}

#[test]
fn room_that_was_made_ahead_of_the_records_is_waited_for() {
    let whole = crate::recordings::Recipe::plain().write();
    let ahead = |at: usize| vec![(0, [&whole[..at], &vec![0; whole.len() - at][..]].concat()), (0, whole.clone())];
    let expected = follow(&[(0, whole.clone())], || false);
    let mut at = 8;
    loop {
        let (told, inventory) = follow(&ahead(at), || true);
        assert_eq!((told, format!("{inventory:?}")), (expected.0.clone(), format!("{:?}", expected.1)), "{at}");
        if at + mcap::MAGIC.len() == whole.len() {
            break;
        }
        // On to the next record: what lies half under the zeros cannot be told from what is whole.
        at += 9 + u64::from_le_bytes(whole[at + 1..at + 9].try_into().unwrap()) as usize;
    }
}

#[test]
fn how_much_stands_in_the_place_of_the_closing_magic_is_said_once_it_is_all_there() {
    let mut file = crate::recordings::Recipe::plain().write();
    let end = file.len();
    file.extend([b'x'; 100]);
    file[end - 1] = b'x';
    let expected = follow(&[(0, file.clone())], || false);
    assert!(expected.0.iter().any(|event| event.contains("closing magic is missing") && event.contains("length: 108")));
    for at in [end - 1, end, end + 50] {
        let growing = [(0, file[..at].to_vec()), (at as u64, file[at..].to_vec())];
        assert_eq!(follow(&growing, || true).0, expected.0, "{at}");
    }
}

proptest! {
    #[test]
    fn interruptions_change_nothing(
        file in mistreated(),
        growth in prop::collection::vec(1_usize..2000, 1..20),
        interruptions in prop::collection::vec(any::<bool>(), 1..20),
    ) {
        let mut changes = Vec::new();
        let mut at = 0;
        for step in growth {
            let end = file.len().min(at + step);
            changes.push((at as u64, file[at..end].to_vec()));
            at = end;
        }
        changes.push((at as u64, file[at..].to_vec()));
        let mut interruptions = interruptions.iter().cycle();
        let (told, inventory) = follow(&changes, || *interruptions.next().unwrap());
        let (expected, found) = scan(&file);
        prop_assert_eq!(told.len(), expected.len());
        prop_assert_eq!(format!("{inventory:?}"), format!("{found:?}"));
    }
}

fn file(changes: &[Change]) -> Vec<u8> {
    let mut file = Vec::new();
    for (at, bytes) in changes {
        file.resize(file.len().max(*at as usize + bytes.len()), 0);
        file[*at as usize..][..bytes.len()].copy_from_slice(bytes);
    }
    file
}

/// A recorder that reserves room for what it writes, in steps of so many bytes.
#[test]
fn room_that_is_filled_in_later_is_no_damage() {
    for (reserved, written) in [(1 << 20, 700), (4096, 700), (1000, 11), (300, 1000)] {
        for (compression, chunked) in [(0, true), (1, true), (2, true), (0, false)] {
            let recipe = Recipe { compression, chunked, ..Recipe::plain() };
            let whole = recipe.write();
            let changes: Vec<Change> = whole
                .chunks(written)
                .scan(0, |at, bytes| {
                    let here = *at;
                    *at += bytes.len() as u64;
                    Some((here, bytes.to_vec()))
                })
                .collect();
            let mut scan = Scan::new();
            let (mut file, mut told, mut end) = (Vec::new(), Vec::new(), 0);
            let mut changes = changes.iter();
            let damage = loop {
                match scan.next_event().unwrap() {
                    Event::Read { offset, length } => {
                        scan.insert(length).copy_from_slice(&file[offset as usize..][..length]);
                        scan.notify_read(length);
                    }
                    Event::Wait => match changes.next() {
                        Some((at, bytes)) => {
                            end = *at as usize + bytes.len();
                            file.resize(end.next_multiple_of(reserved), 0);
                            file[*at as usize..end].copy_from_slice(bytes);
                            scan.extend(file.len() as u64);
                        }
                        None => {
                            // What was reserved in excess is given back.
                            file.truncate(end);
                            scan.extend(end as u64);
                            scan.finish();
                        }
                    },
                    Event::End => break scan.inventory().damage(),
                    Event::Message(message) => told.push((message.channel, message.log_time, message.data.to_vec())),
                    _ => {}
                }
            };
            let at =
                format!("{reserved} bytes at a time, {written} written, compression {compression}, chunks {chunked}");
            assert_eq!(damage, 0, "{at}");
            let expected = crate::drive::scan(&whole).0.into_iter().filter_map(|event| match event {
                crate::drive::Told::Message { channel, log_time, data, .. } => Some((channel, log_time, data)),
                _ => None,
            });
            assert_eq!(told, expected.collect::<Vec<_>>(), "{at}");
        }
    }
}
