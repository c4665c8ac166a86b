use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::read::{ChunkFlattener, Options, Summary};
use mcap::records::{ChunkIndex, MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, WriteOptions};
use proptest::prelude::*;
use stillpoint::record::{Annotation, Block, Error, Event, Fold, Piece, Scan, Sidecar, Tail, Topic};

use crate::drive::{Told, blocks, fold, messages, put, scan, settings, topics};
use crate::recordings::{Recipe, case, mistreated, recipes, shared};
use crate::records::{channel, chunk, message, record, recording, schema};

proptest! {
    #[test]
    fn an_annotated_recording_is_read_by_others(recipe in recipes()) {
        let file = recipe.write();
        let out = fold(&file, &topics(), &blocks());
        read_with_all_crcs(&out);
        let summary = Summary::read(&out).unwrap().unwrap();
        let statistics = summary.stats.unwrap();
        prop_assert_eq!(statistics.message_count as usize, recipe.messages.len() + 5);
        prop_assert_eq!(statistics.attachment_count as usize, recipe.attachments.len() + 1);
        prop_assert_eq!(statistics.metadata_count as usize, recipe.metadata + 1);
        prop_assert_eq!(summary.attachment_indexes.len(), recipe.attachments.len() + 1);
        let loose = !recipe.chunked && !recipe.messages.is_empty();
        prop_assert_eq!(summary.chunk_indexes.is_empty(), loose);
        prop_assert_eq!(all_messages(&out), expected_messages(&file));
        let data_end = scan(&out).1.prefix() as usize;
        prop_assert_eq!(out[data_end + 9..data_end + 13] != [0; 4], recipe.data_crc);
    }

    #[test]
    fn what_is_whole_in_a_damaged_recording_is_still_there_when_annotated(file in mistreated()) {
        let out = fold(&file, &topics(), &blocks());
        let (told, inventory) = scan(&out);
        prop_assert!(inventory.is_finished());
        let (original, damaged) = scan(&file);
        let (before, after) = (messages(&original), messages(&told));
        prop_assert_eq!(&after[..before.len()], &before[..]);
        prop_assert_eq!(after.len(), before.len() + 5);
        if damaged.has_loose_messages() {
            // Readers have no index to go by, but find the same from record to record.
            let (framed, chunks) = framed_messages(&out);
            let mut rest = framed.iter();
            let outside = if chunks { &after[before.len()..] } else { &after[..] };
            prop_assert!(outside.iter().all(|message| rest.any(|framed| framed == *message)));
        }
        prop_assert!(Summary::read(&out).unwrap().is_some());
    }
}

proptest! {
    #[test]
    fn where_chunk_indexes_are_kept_makes_no_difference(file in mistreated(), now_and_then in any::<u8>()) {
        let mut scan = Scan::finished(file.len() as u64);
        let mut indexes = Vec::new();
        for n in 0.. {
            match scan.next_event().unwrap() {
                Event::Read { offset, length } => {
                    scan.insert(length).copy_from_slice(&file[offset as usize..offset as usize + length]);
                    scan.notify_read(length);
                }
                Event::End => break,
                _ => {}
            }
            if now_and_then >> (n % 8) & 1 == 1 {
                indexes.extend(scan.take_indexes());
            }
        }
        let inventory = scan.into_inventory();
        let behind = &file[inventory.prefix() as usize..];
        let tail = Tail { length: behind.len() as u64, crc: crc32fast::hash(behind) };
        let (mut fold, mut pieces) = Fold::open(inventory, tail, &settings(), &topics()).unwrap();
        for block in blocks() {
            pieces.push(fold.block(&topics(), &block).unwrap());
            indexes.extend(fold.take_indexes());
        }
        pieces.extend(fold.close());
        // Beside messages outside chunks, nothing is indexed.
        let wanted = pieces.iter().any(|piece| matches!(piece, Piece::Indexes(_)));
        let out = put(pieces, &file, if wanted { &indexes } else { &[] });
        prop_assert_eq!(out, crate::drive::fold(&file, &topics(), &blocks()));
    }

    #[test]
    fn a_block_that_was_kept_elsewhere_is_the_same(parts in prop::collection::vec((0_usize..9, any::<u32>(), any::<u64>(), prop::collection::vec(any::<u8>(), 0..50)), 0..9)) {
        let annotations = parts.into_iter().map(|(topic, sequence, log_time, data)| Annotation { topic, sequence, log_time, data });
        let block = Block { annotations: annotations.collect() };
        let mut bytes = Vec::new();
        block.write(&mut bytes);
        prop_assert_eq!(Block::read(&bytes), Some(block.clone()));
        bytes.pop();
        prop_assert!(block.annotations.is_empty() || Block::read(&bytes).is_none());
    }
}

#[test]
fn the_annotated_recordings_of_others_are_read_by_others() {
    for (_, file) in shared() {
        let out = fold(&file, &topics(), &blocks());
        read_with_all_crcs(&out);
        assert!(Summary::read(&out).unwrap().is_some());
        assert_eq!(all_messages(&out), expected_messages(&file));
    }
}

#[test]
fn a_block_without_annotations_writes_no_chunk() {
    let file = Recipe::plain().write();
    let without = fold(&file, &topics(), &[]);
    assert_eq!(fold(&file, &topics(), &[Block::default()]), without);
}

#[test]
fn annotation_ids_are_the_lowest_that_are_free() {
    let file = Recipe::plain().write();
    let out = fold(&file, &topics(), &blocks());
    let (before, after) = (scan(&file).1, scan(&out).1);
    let ids: Vec<u16> = after.channels().keys().copied().collect();
    assert_eq!(before.channels().len(), 3);
    let free: Vec<u16> = (1..).filter(|id| !before.channels().contains_key(id)).take(3).collect();
    assert!(free.iter().all(|id| ids.contains(id)), "{free:?} of {ids:?}");
    let schemas: Vec<&str> = after.schemas().values().map(|schema| &schema.name[..]).collect();
    assert_eq!(schemas, ["sensor_msgs/msg/Imu", "stillpoint.segment", "stillpoint.calibration"]);
}

#[test]
fn a_recording_without_free_ids_is_refused() {
    let topic = topics().remove(0);
    let many: Vec<Topic> = (0..=65535).map(|n| Topic { name: format!("/{n}"), ..topic.clone() }).collect();
    let (inventory, tail) = (scan(&Recipe::plain().write()).1, Tail::default());
    let refused = Fold::open(inventory, tail, &BTreeMap::new(), &many).err().unwrap();
    assert!(matches!(refused, Error::NoFreeId { kind: "channel" }));
    assert!(refused.to_string().contains("--sidecar"));
}

#[test]
fn a_sidecar_is_a_recording_of_its_own() {
    let (mut sidecar, mut out) = Sidecar::open("ros2", &settings());
    for block in blocks() {
        out.extend(sidecar.block(&topics(), &block).unwrap());
    }
    out.extend(put(sidecar.close(), &[], &[]));
    read_with_all_crcs(&out);
    let (told, inventory) = scan(&out);
    assert_eq!((inventory.profile(), inventory.damage(), messages(&told).len()), ("ros2", 0, 5));
    assert_eq!(inventory.channels().keys().copied().collect::<Vec<u16>>(), [1, 2, 3]);
    assert_eq!(Summary::read(&out).unwrap().unwrap().chunk_indexes.len(), 2);
}

/// The messages outside chunks that one finds who goes from record to record, through the closing magic, and whether there
/// are chunks.
fn framed_messages(file: &[u8]) -> (Vec<Told>, bool) {
    let (mut messages, mut chunks) = (Vec::new(), false);
    let mut rest = file.strip_prefix(MAGIC).unwrap();
    while rest != MAGIC {
        let length = u64::from_le_bytes(rest[1..9].try_into().unwrap()) as usize;
        if let Record::Message { header, data } = mcap::parse_record(rest[0], &rest[9..9 + length]).unwrap() {
            messages.push(Told::Message {
                channel: header.channel_id,
                sequence: header.sequence,
                log_time: header.log_time,
                publish_time: header.publish_time,
                data: data.into_owned(),
            });
        }
        chunks |= rest[0] == 0x06;
        rest = &rest[9 + length..];
    }
    (messages, chunks)
}

/// Reads every record with the `mcap` crate, all CRCs on.
fn read_with_all_crcs(file: &[u8]) {
    let options = LinearReaderOptions::default()
        .with_prevalidate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_check_finishes_after_end_magic(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = file;
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(length) => {
                let (now, later) = rest.split_at(length.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { opcode, data } => drop(mcap::parse_record(opcode, data).unwrap()),
        }
    }
    assert!(rest.is_empty());
}

type Flat = (String, u32, u64, Vec<u8>);

/// Topic, sequence, log time and data of all messages, by the `mcap` crate.
fn all_messages(file: &[u8]) -> Vec<Flat> {
    let mut topics = BTreeMap::new();
    let flat = ChunkFlattener::new_with_options(file, Options::ValidateChunkCrcs.into()).unwrap();
    flat.filter_map(|record| match record.unwrap() {
        Record::Channel(channel) => {
            topics.insert(channel.id, channel.topic);
            None
        }
        Record::Message { header, data } => {
            let topic = topics.get(&header.channel_id).cloned().unwrap_or_default();
            Some((topic, header.sequence, header.log_time, data.into_owned()))
        }
        _ => None,
    })
    .collect()
}

/// Those of the original, by our own scan, and behind them the annotations.
fn expected_messages(file: &[u8]) -> Vec<Flat> {
    let (told, inventory) = scan(file);
    let original = told.into_iter().filter_map(|event| match event {
        Told::Message { channel, sequence, log_time, data, .. } => {
            let topic = inventory.channels().get(&channel).map(|channel| channel.topic.clone());
            Some((topic.unwrap_or_default(), sequence, log_time, data))
        }
        _ => None,
    });
    let annotations = blocks().into_iter().flat_map(|block| block.annotations).map(|annotation| {
        let topic = topics().swap_remove(annotation.topic).name;
        (topic, annotation.sequence, annotation.log_time, annotation.data)
    });
    original.chain(annotations).collect()
}

#[test]
fn what_only_the_summary_knew_is_kept_in_both_sections() {
    let private = record(0xA0, b"of the recorder");
    let file = recording(&[chunk(&message(7, 5))], &[schema(3), channel(7, 3), private.clone()]);
    let out = fold(&file, &topics(), &blocks());
    read_with_all_crcs(&out);
    let kept = |bytes: &[u8], needle: &[u8]| bytes.windows(needle.len()).filter(|found| found == &needle).count();
    // Once in the kept tail, once in the data section, once in the summary; the private record is no data.
    assert_eq!((kept(&out, &channel(7, 3)), kept(&out, &private)), (3, 2));
    let topic = &Summary::read(&out).unwrap().unwrap().channels[&7].topic;
    assert_eq!(topic, "/topic7");
}

#[test]
fn beside_messages_outside_chunks_no_chunk_is_indexed() {
    let file = recording(&[channel(1, 0), chunk(&message(1, 5)), message(1, 6)], &[]);
    let out = fold(&file, &topics(), &blocks());
    read_with_all_crcs(&out);
    let summary = Summary::read(&out).unwrap().unwrap();
    let statistics = summary.stats.unwrap();
    assert_eq!((summary.chunk_indexes.len(), statistics.chunk_count, statistics.message_count), (0, 1, 7));
    assert_eq!(all_messages(&out), expected_messages(&file));
}

#[test]
fn what_the_end_of_a_recording_lacks_of_message_indexes_stands_behind_its_last_chunk() {
    let file = Recipe { summary: false, attachments: vec![], metadata: 0, private: false, ..Recipe::plain() }.write();
    // The last chunk and the indexes of its three channels, each of which may be the last that is whole.
    let last = file.windows(9).rposition(|bytes| bytes[0] == 7 && bytes[3..] == [0; 6]).unwrap();
    for cut in [last, last + 20] {
        let out = fold(&file[..cut], &topics(), &blocks());
        read_with_all_crcs(&out);
        for index in &Summary::read(&out).unwrap().unwrap().chunk_indexes {
            let behind = index.chunk_start_offset + index.chunk_length;
            let first = *index.message_index_offsets.values().min().unwrap();
            assert_eq!(first, behind, "cut at {cut}");
        }
        assert!(!out.windows(18).any(|bytes| bytes == b"stillpoint.indexes"));
    }
}

#[test]
fn message_indexes_that_are_damaged_are_written_anew_elsewhere() {
    let mut file = Recipe::plain().write();
    let index = file.windows(9).position(|bytes| bytes[0] == 7 && bytes[3..] == [0; 6]).unwrap();
    file[index + 20] ^= 1;
    let out = fold(&file, &topics(), &blocks());
    read_with_all_crcs(&out);
    let summary = Summary::read(&out).unwrap().unwrap();
    let behind = |index: &&ChunkIndex| {
        let first = index.message_index_offsets.values().min();
        first.is_none_or(|&first| first == index.chunk_start_offset + index.chunk_length)
    };
    assert_eq!(summary.chunk_indexes.iter().filter(|index| !behind(index)).count(), 1);
    assert_eq!(summary.attachment_indexes.len(), 3);
    assert_eq!(scan(&out).1.damage(), scan(&file).1.damage(), "the attachment is no damage");
}

#[test]
fn where_the_recorder_wrote_no_message_indexes_annotations_have_none() {
    // rosbag2 reads a recording without any in the order of the file, and one with some by these alone.
    let options = WriteOptions::new().emit_message_indexes(false).chunk_size(Some(400));
    let mut out = Cursor::new(Vec::new());
    let mut writer = options.create(&mut out).unwrap();
    let channel = writer.add_channel(0, "/a", "cdr", &BTreeMap::new()).unwrap();
    for n in 0..40 {
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time: n, publish_time: n };
        writer.write_to_known_channel(&header, &[0; 50]).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let file = out.into_inner();
    let out = fold(&file, &topics(), &blocks());
    read_with_all_crcs(&out);
    let indexes = Summary::read(&out).unwrap().unwrap().chunk_indexes;
    assert!(indexes.len() > 3 && indexes.iter().all(|index| index.message_index_length == 0));
    assert_eq!(all_messages(&out), expected_messages(&file));
}

#[test]
fn a_record_that_claims_more_than_there_is_swallows_nothing_of_what_is_appended() {
    let messages = [message(1, 6), message(1, 7)].concat();
    for behind in [messages.clone(), chunk(&messages)] {
        for opcode in [0x05, 0x06, 0x09, 0x0C, 0x90] {
            for claimed in (0..900_u64).step_by(7) {
                let open = [&[opcode][..], &claimed.to_le_bytes(), &[3; 40]].concat();
                let mut file = recording(&[schema(3), channel(1, 3), message(1, 5), open, behind.clone()], &[]);
                // Its recorder died.
                file.truncate(file.len() - 50);
                let out = fold(&file, &topics(), &blocks());
                assert_appended(&file, &out, &format!("opcode {opcode} that claims {claimed}"));
            }
        }
    }
}

#[test]
fn recordings_that_once_swallowed_what_was_appended_do_no_more() {
    for file in
        ["17_damaged_then_annotated.mcap", "faults/fold_annotations_swallowed.mcap"].into_iter().filter_map(case)
    {
        assert_appended(&file, &fold(&file, &topics(), &blocks()), "a case");
    }
}

/// All messages of a recording, and then the five that were appended, are told from the annotated one.
fn assert_appended(file: &[u8], out: &[u8], what: &str) {
    let (original, told) = (scan(file).0, scan(out).0);
    let (before, after) = (messages(&original), messages(&told));
    assert_eq!((&after[..before.len()], after.len()), (&before[..], before.len() + 5), "{what}");
}
