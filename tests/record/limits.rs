//! Recordings that would take more memory than a machine has: the limit is named, and the rest is used.

use stillpoint::record::{Event, Limits, Scan};

use crate::drive::{Told, fold_scanned, messages, scan};
use crate::records::{attachment, channel, chunk, message, record, recording, schema, text};

/// What is said of the damaged parts of a recording whose two sound messages are told.
fn complaints(file: &[u8]) -> Vec<String> {
    let (told, _) = scan(file);
    assert_eq!(messages(&told).len(), 2);
    let damage = |event: &Told| match event {
        Told::Damage(damage) => Some(damage.what.clone()),
        _ => None,
    };
    told.iter().filter_map(damage).collect()
}

/// Two sound chunks, and something between them.
fn around(between: &[Vec<u8>]) -> Vec<u8> {
    let sound = chunk(&[schema(3), channel(1, 3), message(1, 5)].concat());
    recording(&[&[sound][..], between, &[chunk(&message(1, 6))]].concat(), &[])
}

fn zstd(records: &[u8], claims: u64) -> Vec<u8> {
    let data = zstd::bulk::compress(records, 1).unwrap();
    let (size, text) = ((data.len() as u64).to_le_bytes(), text("zstd"));
    record(0x06, &[&[0; 16][..], &claims.to_le_bytes(), &[0; 4], &text, &size, &data].concat())
}

#[test]
fn a_chunk_that_opens_to_more_than_is_held_is_named() {
    for claims in [(1 << 26) + 1, 1 << 30, u64::MAX] {
        let said = complaints(&around(&[zstd(&[0; 1000], claims)]));
        assert_eq!(
            said,
            [format!(
                "a chunk that claims {claims} uncompressed bytes: those of more than 67108864 are not opened \
                 (limits.chunk_mib)"
            )]
        );
    }
}

#[test]
fn definitions_that_say_nothing_new_take_nothing() {
    let same = channel(1, 3).repeat(1 << 20);
    assert_eq!(complaints(&around(&[zstd(&same, same.len() as u64)])), [""; 0]);
    let others: Vec<u8> = (0..100_000_u32).flat_map(|n| channel(1, 4 + (n % 60_000) as u16)).collect();
    let said = complaints(&around(&[zstd(&others, others.len() as u64)]));
    assert!(said.iter().all(|what| what == "channel 1 is defined twice, differently") && said.len() <= 2, "{said:?}");
}

#[test]
fn schemas_that_take_too_much_together_are_named() {
    let large = |id: u16| {
        let data = "x".repeat(3 << 20);
        record(0x03, &[&id.to_le_bytes()[..], &text("pkg/msg/T"), &text("ros2msg"), &text(&data)].concat())
    };
    let chunks: Vec<Vec<u8>> = (10..20).map(|id| zstd(&large(id), large(id).len() as u64)).collect();
    let said = complaints(&around(&chunks));
    assert_eq!(said.len(), 5, "{said:?}");
    let what = "schemas and channels of more than 16777216 bytes: no more are used (limits.definitions_mib)";
    assert!(said.iter().all(|said| said == what), "{said:?}");
}

#[test]
fn a_definition_that_is_too_long_is_named_wherever_it_stands() {
    let long = "x".repeat(5 << 20);
    let schema = record(0x03, &[&9_u16.to_le_bytes()[..], &text("T"), &text("ros2msg"), &text(&long)].concat());
    let channel = record(0x04, &[&9_u16.to_le_bytes()[..], &[0; 2], &text(&long), &text("cdr"), &[0; 4]].concat());
    let metadata = record(0x0C, &[text("robot"), text(&long)].concat());
    for (what, record) in [("schema", schema), ("channel", channel), ("metadata", metadata)] {
        let chunked = chunk(&record);
        for between in [record.clone(), chunked].into_iter().take(if what == "metadata" { 1 } else { 2 }) {
            let length = record.len() - 9;
            let said = complaints(&around(&[between]));
            let named = "those of more than 4194304 are not read (limits.definition_mib)";
            assert_eq!(said, [format!("a {what} record of {length} bytes: {named}")]);
        }
    }
}

#[test]
fn chunks_that_open_to_much_more_than_the_recording_has_are_named_and_the_others_are_used() {
    let zeros = record(0x90, &vec![0; 60 << 20]);
    let bomb = zstd(&zeros, zeros.len() as u64);
    let said = complaints(&around(&vec![bomb; 6]));
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said.iter().all(|what| what.contains("more than 250 times its length") && what.contains("limits.ratio")));
}

#[test]
fn more_channels_than_are_allowed_are_named() {
    let limits = Limits { channels: 2, ..Limits::default() };
    let file = recording(&[channel(1, 0), channel(2, 0), channel(3, 0), message(1, 5), message(2, 6)], &[]);
    let mut scan = Scan::finished(file.len() as u64).within_limits(limits);
    let (mut said, mut messages) = (Vec::new(), 0);
    loop {
        match scan.next_event().unwrap() {
            Event::Read { offset, length } => {
                scan.insert(length).copy_from_slice(&file[offset as usize..][..length]);
                scan.notify_read(length);
            }
            Event::Message(_) => messages += 1,
            Event::Damage(damage) => said.push(damage.what),
            Event::End => break,
            _ => {}
        }
    }
    assert_eq!(said, ["more than 2 channels: no more are used (limits.channels)"]);
    assert_eq!(messages, 2);
}

#[test]
fn places_of_attachments_and_metadata_records_that_take_too_much_are_named_once_and_the_rest_is_used() {
    let metadata = |name: &str| record(0x0C, &[text(name), text("")].concat());
    let long = "n".repeat(40_000);
    let attached: Vec<_> = (0..700).map(|n| attachment(&format!("{n}{long}"), b"x", 0)).collect();
    let noted: Vec<_> = (0..700).map(|n| metadata(&format!("{n}{long}"))).collect();
    for many in [attached.clone(), noted.clone(), [attached, noted].concat()] {
        let file = around(&many);
        let what = "places of attachments and metadata records of more than 16777216 bytes: further ones are not indexed \
                    (limits.attachments_mib)";
        assert_eq!(complaints(&file), [what]);
        // They stay where they are, and what is indexed of them is found.
        let (_, inventory) = scan(&file);
        let annotated = fold_scanned(inventory, &file, &[], &[]);
        let stats = mcap::Summary::read(&annotated).unwrap().unwrap().stats.unwrap();
        let indexed = stats.attachment_count + stats.metadata_count;
        assert!((400..500).contains(&indexed), "{indexed} of {}", many.len());
        let many = many.concat();
        assert!(annotated.windows(many.len()).any(|bytes| bytes == many));
    }
}

#[test]
fn what_only_the_summary_defines_has_the_same_limits() {
    let large = |id: u16| {
        let data = "x".repeat(3 << 20);
        record(0x03, &[&id.to_le_bytes()[..], &text("pkg/msg/T"), &text("ros2msg"), &text(&data)].concat())
    };
    let many: Vec<_> = (10..18).map(large).collect();
    let sound = chunk(&[schema(3), channel(1, 3), message(1, 5), message(1, 6)].concat());
    let file = recording(&[sound, many[0].clone()], &many);
    assert_eq!(
        complaints(&file),
        ["schemas and channels of more than 16777216 bytes: no more are used (limits.definitions_mib)"]
    );
    let (_, inventory) = scan(&file);
    assert_eq!(inventory.schemas().len(), 1 + 5);
    // The summary repeats what the data has, as it should, and nothing is wrong.
    let few = recording(
        &[chunk(&[schema(3), channel(1, 3), message(1, 5), message(1, 6)].concat()), many[..5].concat()],
        &many[..5],
    );
    assert_eq!(complaints(&few), [""; 0]);
}
