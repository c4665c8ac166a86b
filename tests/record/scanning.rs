use mcap::read::{ChunkFlattener, Options};
use mcap::records::Record;
use proptest::prelude::*;
use stillpoint::record::{Error, Event, Scan};

use crate::drive::{Told, follow, messages, scan};
use crate::recordings::{Recipe, mistreated, shared};
use crate::records::{attachment, channel, chunk, message, record, recording, schema};

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
fn channels_that_only_the_summary_knows_are_told_at_the_end() {
    let file = recording(&[chunk(&message(7, 5))], &[schema(3), channel(7, 3)]);
    let (told, inventory) = scan(&file);
    assert!(matches!(&told[..], [.., Told::ChunkEnd, Told::Schema(_), Told::Channel(_)]), "{told:?}");
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
    assert_eq!(damages, ["at byte 32: attachment `map`: its CRC does not hold"]);
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
