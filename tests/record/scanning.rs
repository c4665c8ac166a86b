use mcap::read::{ChunkFlattener, Options};
use mcap::records::Record;
use proptest::prelude::*;
use stillpoint::record::{Error, Event, Scan};

use crate::drive::{Told, follow, messages, scan};
use crate::recordings::{Recipe, mistreated, shared};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

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
    let place = file.windows(10).position(|bytes| bytes == b"/topic0\x03\0\0").unwrap_or(200);
    damaged[place] ^= 1;
    let (told, inventory) = scan(&damaged);
    assert_eq!(inventory.damage(), 1);
    let (all, some) = (messages(&all), messages(&told));
    assert!(some.len() < all.len() && !some.is_empty());
    assert_eq!(all[all.len() - some.len()..], some);
}
