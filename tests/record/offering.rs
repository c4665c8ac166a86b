//! Chunks that do not come through the scan: opened elsewhere, or not read at all.

use std::collections::BTreeMap;

use proptest::prelude::*;
use stillpoint::record::{Chunk, Chunks, Event, Inventory, Opened, Opener, Scan, Supply};

use crate::drive::{Told, blocks, fold, fold_scanned, scan, topics};
use crate::recordings::{Recipe, mistreated, recipes, shared};

/// Scans with `supply` saying what becomes of each chunk.
fn offer(file: &[u8], supply: impl FnMut(&mut Scan, u64, u64, &[Told]) -> Supply) -> (Vec<Told>, Inventory) {
    offer_to(Scan::finished(file.len() as u64).offering_chunks(), file, supply)
}

fn offer_to(
    mut scan: Scan,
    file: &[u8],
    mut supply: impl FnMut(&mut Scan, u64, u64, &[Told]) -> Supply,
) -> (Vec<Told>, Inventory) {
    let mut told = Vec::new();
    loop {
        match scan.next_event().unwrap() {
            Event::Read { offset, length } => {
                scan.insert(length).copy_from_slice(&file[offset as usize..offset as usize + length]);
                scan.notify_read(length);
            }
            Event::Chunk { offset, length } => {
                let supply = supply(&mut scan, offset, length, &told);
                scan.supply(supply);
            }
            Event::End => return (told, scan.into_inventory()),
            event => told.push(Told::of(event)),
        }
    }
}

/// Opens a chunk elsewhere, in the memory of another one.
fn open(file: &[u8], spent: Option<Opened>, offset: u64, length: u64) -> Supply {
    let mut opened = spent.unwrap_or_default();
    let start = offset as usize + 9;
    opened.room(length as usize).copy_from_slice(&file[start..start + length as usize]);
    Opener::default().open(&mut opened);
    Supply::Opened(opened)
}

/// The chunks that are found by framing alone.
fn chunks(file: &[u8]) -> BTreeMap<u64, Chunk> {
    let mut chunks = Chunks::new(8, file.len() as u64);
    std::iter::from_fn(|| chunks.next(&mut &file[..]).unwrap()).map(|chunk| (chunk.offset, chunk)).collect()
}

/// All that need not be read is not, of the first two channels.
fn pass_over(file: &[u8]) -> (Vec<Told>, Inventory, usize) {
    let (found, mut unread) = (chunks(file), 0);
    let (told, inventory) = offer(file, |_, offset, _, told| {
        let known = |id: &u16| told.iter().any(|told| matches!(told, Told::Channel(channel) if channel.id == *id));
        let useless = |id: &u16| known(id) && *id < 2;
        match found.get(&offset).and_then(|chunk| chunk.channels.as_ref()) {
            Some(channels) if !channels.is_empty() && channels.iter().all(useless) => {
                unread += 1;
                Supply::Unread
            }
            _ => Supply::Absent,
        }
    });
    (told, inventory, unread)
}

proptest! {
    #[test]
    fn chunks_opened_elsewhere_say_the_same(file in mistreated(), absent in any::<u8>()) {
        let mut n = 0;
        let (told, inventory) = offer(&file, |scan, offset, length, _| {
            n += 1;
            if absent >> (n % 8) & 1 == 1 {
                return Supply::Absent;
            }
            open(&file, scan.spent(), offset, length)
        });
        let (expected, found) = scan(&file);
        prop_assert_eq!(told, expected);
        prop_assert_eq!(format!("{inventory:?}"), format!("{found:?}"));
    }

    #[test]
    fn what_is_in_an_unread_chunk_is_what_its_indexes_say(recipe in recipes()) {
        let file = recipe.write();
        let (told, inventory, unread) = pass_over(&file);
        let (expected, found) = scan(&file);
        for id in found.channels().keys() {
            prop_assert_eq!(inventory.messages(*id), found.messages(*id));
        }
        prop_assert!(unread == 0 || told.len() < expected.len());
        prop_assert_eq!(fold_scanned(inventory, &file, &topics(), &blocks()), fold(&file, &topics(), &blocks()));
    }
}

proptest! {
    #[test]
    fn a_wrong_byte_lets_no_chunk_pass_that_has_messages_of_use(place in any::<prop::sample::Index>(), flip in 1_u8.., compression in 0_u8..3) {
        let messages = (0..90).map(|n| (n / 10 % 3, 10 * u64::from(n), 50)).collect();
        let mut file = Recipe { messages, compression, ..Recipe::plain() }.write();
        let length = file.len();
        file[8 + place.index(length - 16)] ^= flip;
        let of_use = |told: Vec<Told>| -> Vec<Told> {
            told.into_iter().filter(|told| matches!(told, Told::Message { channel: 2.., .. })).collect()
        };
        prop_assert_eq!(of_use(pass_over(&file).0), of_use(scan(&file).0));
    }
}

#[test]
fn chunks_are_found_as_the_summary_has_them_and_no_further_than_the_framing_holds() {
    for (path, file) in shared() {
        let Ok(Some(summary)) = mcap::Summary::read(&file) else { continue };
        let mut indexed: Vec<_> = summary.chunk_indexes.iter().map(|index| index.chunk_start_offset).collect();
        indexed.sort_unstable();
        assert_eq!(chunks(&file).into_keys().collect::<Vec<_>>(), indexed, "{}", path.display());
    }
    let mut file = Recipe::plain().write();
    let found = chunks(&file);
    let named: Vec<_> = found.values().map(|chunk| chunk.channels.as_ref().unwrap().len()).collect();
    // One has but a private record.
    assert!(named.iter().filter(|&&channels| channels > 0).count() > 3, "{named:?}");
    let second = found.keys().nth(1).copied().unwrap() as usize;
    file[second + 8] = 0xFF;
    assert_eq!(chunks(&file).len(), 1);
}

#[test]
fn an_index_that_may_be_damaged_gets_its_chunk_read() {
    let recipe = Recipe { messages: (0..60).map(|n| (n / 20 % 2, 10 * u64::from(n), 50)).collect(), ..Recipe::plain() };
    let mut file = recipe.write();
    let (.., unread) = pass_over(&file);
    assert!(unread > 2, "{unread}");
    let found = chunks(&file);
    let last = found.values().last().unwrap();
    let index = last.body().end as usize;
    assert_eq!(file[index], 0x07, "a message index stands behind the chunk");
    file[index] ^= 0x40;
    assert_eq!(chunks(&file).values().last().unwrap().channels, None);
}

#[test]
fn on_demand_the_crc_of_all_data_is_checked() {
    let sound = Recipe { private: false, ..Recipe::plain() }.write();
    let damage = |file: &[u8], verifying: bool| {
        let scan = Scan::finished(file.len() as u64).offering_chunks();
        let scan = if verifying { scan.verifying() } else { scan };
        let (_, inventory) = offer_to(scan, file, |scan, offset, length, _| open(file, scan.spent(), offset, length));
        inventory.damage()
    };
    assert_eq!(damage(&sound, true), 0);
    // The name of a metadata record, which has no CRC of its own.
    let mut damaged = sound.clone();
    damaged[sound.windows(5).position(|bytes| bytes == b"robot").unwrap()] ^= 1;
    assert_eq!((damage(&damaged, false), damage(&damaged, true)), (0, 1));
}
