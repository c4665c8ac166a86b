use mcap::read::{ChunkFlattener, Options};
use mcap::records::Record;
use proptest::prelude::*;
use stillpoint::record::{Error, Event, Scan};

use crate::drive::{Told, follow, messages, scan};
use crate::recordings::{Recipe, mistreated, shared};
use crate::records::{attachment, channel, chunk, message, record, recording, schema, text};

proptest! {
    #[test]
    fn any_split_of_the_bytes_gives_the_same_events(
        file in mistreated(),
        growth in prop::collection::vec(1_usize..2000, 1..20),
        reads in prop::collection::vec(1_usize..700, 1..8),
    ) {
        let (told, inventory) = scan(&file);
        let (again, found) = follow(&file, &growth, &reads);
        prop_assert_eq!(told, again);
        prop_assert_eq!(format!("{inventory:?}"), format!("{found:?}"));
    }
}

#[test]
fn every_message_of_the_recordings_of_others_is_told() {
    for (path, file) in shared() {
        let (told, inventory) = scan(&file);
        let flat = ChunkFlattener::new_with_options(&file, Options::ValidateChunkCrcs.into()).unwrap();
        let mut expected = flat.map_while(Result::ok).filter_map(|record| match record {
            Record::Message { header, data } => Some((header, data)),
            _ => None,
        });
        for event in messages(&told) {
            let Told::Message { channel, sequence, log_time, publish_time, data } = event else { continue };
            let (header, bytes) = expected.next().unwrap();
            assert_eq!((*channel, *sequence), (header.channel_id, header.sequence));
            assert_eq!((*log_time, *publish_time, &data[..]), (header.log_time, header.publish_time, &bytes[..]));
        }
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.ends_with("chunk_not_closed.mcap") {
            assert_eq!(inventory.damage(), 1);
        } else {
            assert_eq!(expected.count(), 0, "{name}");
            assert_eq!(inventory.damage(), 0, "{name}");
        }
    }
}

#[test]
fn what_is_not_mcap_is_refused() {
    let refused = |file: &[u8]| {
        let mut scan = Scan::finished(file.len() as u64);
        if let Ok(Event::Read { length, .. }) = scan.next_event() {
            scan.insert(length).copy_from_slice(&file[..length]);
            scan.notify_read(length);
        }
        scan.next_event().map(|event| format!("{event:?}")).unwrap_err()
    };
    assert!(matches!(refused(b""), Error::Empty));
    assert!(matches!(refused(b"\x89MC"), Error::NotMcap { .. }));
    assert!(matches!(refused(b"#ROSBAG V2.0"), Error::NotMcap { .. }));
}

#[test]
fn a_damaged_chunk_is_skipped_whole() {
    let file = Recipe { compression: 0, private: false, ..Recipe::plain() }.write();
    let (all, _) = scan(&file);
    let mut damaged = file.clone();
    damaged[200] ^= 1;
    let (told, inventory) = scan(&damaged);
    assert_eq!(inventory.damage(), 1);
    let (all, some) = (messages(&all), messages(&told));
    assert!(some.len() < all.len() && !some.is_empty());
    assert_eq!(all[all.len() - some.len()..], some);
}

#[test]
fn a_chunk_that_is_still_open_is_read_once_it_is_closed() {
    let file = recording(&[schema(1), channel(1, 1), chunk(&message(1, 5)), chunk(&message(1, 6))], &[]);
    let open = file.windows(9).position(|bytes| bytes[0] == 6 && bytes[8] == 0).unwrap();
    let mut growing = file[..open + 60].to_vec();
    growing[open + 1..open + 9].fill(0xFF);

    let mut scan = Scan::new();
    scan.extend(growing.len() as u64);
    let mut told = Vec::new();
    loop {
        let complete = growing.len() == file.len();
        match scan.next_event().unwrap() {
            Event::Read { offset, length } => {
                scan.insert(length).copy_from_slice(&growing[offset as usize..][..length]);
                scan.notify_read(length);
            }
            Event::Wait if complete => panic!("the footer is there"),
            Event::Wait => {
                assert!(told.is_empty(), "a chunk that is not whole counted");
                growing.clone_from(&file);
                scan.extend(file.len() as u64);
            }
            Event::Message(message) => told.push(message.log_time),
            Event::End => break,
            _ => {}
        }
    }
    assert_eq!(told, [5, 6]);
    assert!(scan.inventory().is_finished());
}

#[test]
fn channels_that_only_the_summary_knows_are_told_before_their_messages() {
    let file = recording(&[chunk(&message(7, 5))], &[schema(3), channel(7, 3)]);
    let (told, inventory) = scan(&file);
    assert!(
        matches!(&told[1..], [Told::Schema(_), Told::Channel(_), Told::Message { .. }, Told::ChunkEnd]),
        "{told:?}"
    );
    assert_eq!((inventory.damage(), inventory.messages(7)), (0, 1));
}

#[test]
fn a_wrong_attachment_is_damage_and_is_not_held_in_memory() {
    let file = recording(&[attachment("map", &vec![3; 1 << 20], 99), chunk(&message(1, 5))], &[]);
    let mut scan = Scan::finished(file.len() as u64);
    let mut damages = Vec::new();
    loop {
        match scan.next_event().unwrap() {
            Event::Read { offset, length } => {
                assert!(length < 1 << 17, "{length} bytes asked for");
                let length = length.max(1 << 14).min(file.len() - offset as usize);
                scan.insert(length).copy_from_slice(&file[offset as usize..][..length]);
                scan.notify_read(length);
            }
            Event::Damage(damage) => damages.push(damage.to_string()),
            Event::End => break,
            _ => {}
        }
    }
    let what = "at byte 32: attachment `map`: its CRC does not hold; 1048624 bytes are not used";
    assert_eq!(damages, [what]);
    assert_eq!(scan.inventory().span(), Some((5, 5)));
}

#[test]
fn absurd_lengths_are_damage() {
    let absurd = u64::MAX.to_le_bytes();
    let mut chunk_size = chunk(&message(1, 5));
    chunk_size[9 + 16..9 + 24].copy_from_slice(&absurd);
    let mut compressed_size = chunk(&message(1, 5));
    compressed_size[9 + 32..9 + 40].copy_from_slice(&absurd);
    let mut inner = message(1, 5);
    inner[1..9].copy_from_slice(&absurd);
    let mut attached = attachment("map", &[3; 9], 0);
    let size_at = attached.len() - 4 - 9 - 8;
    attached[size_at..size_at + 8].copy_from_slice(&absurd);
    for wrong in [chunk_size, compressed_size, chunk(&inner), attached, record(0x03, &absurd), record(0x05, &[1])] {
        let (told, inventory) = scan(&recording(&[wrong.clone(), chunk(&message(1, 6))], &[]));
        assert_eq!(inventory.damage(), 1, "{wrong:?}: {told:?}");
        assert_eq!(inventory.span(), Some((6, 6)), "{wrong:?}");
    }
}

#[test]
fn a_definition_that_contradicts_an_earlier_one_is_damage() {
    let (told, inventory) = scan(&recording(&[channel(1, 0), channel(1, 0), channel(1, 2)], &[channel(1, 3)]));
    assert_eq!(inventory.damage(), 2, "{told:?}");
    assert_eq!(inventory.channels()[&1].schema_id, 0);
}

#[test]
fn a_file_that_was_only_allocated_behind_its_last_record_ends_there() {
    let mut file = recording(&[chunk(&message(1, 5))], &[]);
    file.truncate(file.len() - 8 - 29 - 13);
    let whole = file.len() as u64;
    file.resize(file.len() + 4096, 0);
    let (told, inventory) = scan(&file);
    assert_eq!((inventory.prefix(), inventory.damage()), (whole, 1), "{told:?}");
}

#[test]
fn reading_resumes_behind_garbage_and_the_damage_is_located() {
    let garbage = vec![0; 100];
    let before = recording(&[channel(1, 0), chunk(&message(1, 5))], &[]).len() - 8 - 29 - 13;
    let file = recording(&[channel(1, 0), chunk(&message(1, 5)), garbage, chunk(&message(1, 6))], &[]);
    let (told, inventory) = scan(&file);
    let damages: Vec<_> =
        told.iter().filter_map(|event| if let Told::Damage(d) = event { Some(d) } else { None }).collect();
    assert_eq!(damages.len(), 1, "{told:?}");
    assert_eq!((damages[0].offset, damages[0].length), (before as u64, 100));
    assert_eq!((inventory.span(), inventory.is_finished()), (Some((5, 6)), true));
    assert_eq!(inventory.prefix(), file.len() as u64 - 8 - 29 - 13);
}

#[test]
fn nothing_is_read_inside_an_attachment_whose_head_is_damaged() {
    let inner = recording(&[channel(9, 0), message(9, 1), message(9, 2)], &[]);
    let data = [channel(1, 0), message(1, 5), attachment("inner.mcap", &inner, 0), message(1, 6)];
    let whole = recording(&data, &[]);
    let at = whole.windows(10).position(|bytes| bytes == b"inner.mcap").unwrap() - 4 - 16 - 9;
    // By the length in its head.
    for (place, wrong) in [(at + 1, 7), (at + 2, 3), (at + 9 + 16 + 14 + 4, 99)] {
        let mut file = whole.clone();
        file[place] ^= wrong;
        assert_eq!(times(&file), [5, 6], "byte {place}");
    }
    // By the summary, although nothing is left of its head.
    let index = [&(at as u64).to_le_bytes()[..], &(39 + 14 + inner.len() as u64).to_le_bytes()].concat();
    let index = record(0x0A, &[&index[..], &[0; 24], &text("inner.mcap"), &text("")].concat());
    let mut file = recording(&data, &[index]);
    file[at..at + 30].fill(0);
    assert_eq!(times(&file), [5, 6]);
}

#[test]
fn the_search_goes_by_the_index_of_the_summary() {
    let file =
        Recipe { messages: (0..90).map(|n| (n % 3, 10 * u64::from(n), 50)).collect(), ..Recipe::plain() }.write();
    let first = file.windows(9).position(|bytes| bytes[0] == 6 && bytes[3..] == [0; 6]).unwrap();
    let mut damaged = file.clone();
    damaged[first..first + 40].fill(0xAA);
    let (told, inventory) = scan(&damaged);
    let all = scan(&file).0;
    let (all, some) = (messages(&all), messages(&told));
    assert!(all.len() - some.len() < 10, "{} of {}", some.len(), all.len());
    assert_eq!(all[all.len() - some.len()..], some);
    // The channels stood in the chunk that is lost.
    assert_eq!((inventory.channels().len(), inventory.damage()), (3, 1));
    let known = told.iter().position(|event| matches!(event, Told::Channel(_)));
    assert!(known < told.iter().position(|event| matches!(event, Told::Message { .. })));
}

#[test]
fn what_looks_like_records_without_end_is_passed_over_in_linear_time() {
    // Heads of chunks and messages, each of which claims a megabyte or all the rest.
    for (opcode, claims) in [(6, 1 << 20), (5, 1 << 20), (5, 200), (9, 1 << 22), (0x0C, 1 << 16), (3, 5000)] {
        let mut file = recording(&[channel(1, 0), message(1, 5)], &[]);
        file.truncate(file.len() - 8 - 29 - 13);
        let mut head = record(opcode, &[7; 31]);
        head[1..9].copy_from_slice(&u64::to_le_bytes(claims));
        (0..100_000).for_each(|_| file.extend_from_slice(&head));
        let mut scan = Scan::finished(file.len() as u64);
        let mut read = 0;
        loop {
            match scan.next_event().unwrap() {
                Event::Read { offset, length } => {
                    assert!(length <= 1 << 25, "{length} bytes asked for");
                    let length = length.max(1 << 20).min(file.len() - offset as usize);
                    scan.insert(length).copy_from_slice(&file[offset as usize..][..length]);
                    scan.notify_read(length);
                    read += length;
                }
                Event::End => break,
                _ => {}
            }
        }
        assert!(read < 8 * file.len(), "opcode {opcode}: {read} bytes read of {}", file.len());
    }
}

/// Log times of the messages that are told.
fn times(file: &[u8]) -> Vec<u64> {
    let log_time = |event: Told| if let Told::Message { log_time, .. } = event { Some(log_time) } else { None };
    scan(file).0.into_iter().filter_map(log_time).collect()
}
