//! Recordings with one wrong byte, or cut off anywhere: every message outside the damaged record is used.
//!
//! The oracle walks the sound recording record by record and lets the `mcap` crate read each one alone.

use std::ops::Range;

use mcap::MAGIC;
use mcap::read::{ChunkFlattener, LinearReader, Options, Summary};
use mcap::records::{ChunkIndex, MessageIndex, Record};
use rand::RngExt as _;

use crate::drive::{Told, blocks, fold, messages, scan, topics};
use crate::needs::randomness;
use crate::recordings::Recipe;

/// A message as the scan tells it.
type Flat = (u16, u32, u64, Vec<u8>);

/// A sound recording, and what each of its records holds.
struct Sound {
    name: String,
    file: Vec<u8>,
    records: Vec<(Range<usize>, Vec<Flat>)>,
    /// Where the DataEnd record begins.
    data_end: usize,
    chunked: bool,
}

/// All compressions, with and without summary, an attachment that is itself a recording, messages in chunks or not, of
/// one length or of many.
fn sound_recordings() -> Vec<Sound> {
    let mut all = Vec::new();
    let within = Recipe { compression: 0, chunked: false, ..Recipe::plain() }.write();
    for (chunked, compression) in [(true, 0), (true, 1), (true, 2), (false, 0)] {
        for summary in [true, false] {
            for varied in [true, false] {
                let length = |n: usize| if varied { 30 + n * n % 97 } else { 55 };
                let messages = (0..300).map(|n| ((n % 3) as u16, 1000 + 7 * n as u64, length(n))).collect();
                let attachments = vec![b"gain: 2".to_vec(), within.clone()];
                let recipe = Recipe { compression, chunked, summary, messages, attachments, ..Recipe::plain() };
                let name = format!("compression {compression}, chunks {chunked}, summary {summary}, varied {varied}");
                all.push(Sound::new(name, recipe.write(), chunked));
            }
        }
    }
    all
}

impl Sound {
    fn new(name: String, file: Vec<u8>, chunked: bool) -> Self {
        let (mut records, mut data_end) = (Vec::new(), 0);
        let mut at = MAGIC.len();
        while at + 9 <= file.len() {
            let length = u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
            let range = at..at + 9 + length;
            if file[at] == 0x0F {
                data_end = at;
            }
            records.push((range.clone(), read_alone(&file[range.clone()])));
            at = range.end;
        }
        assert_eq!(at + MAGIC.len(), file.len());
        assert!(records.iter().map(|(_, messages)| messages.len()).sum::<usize>() == 300);
        Self { name, file, records, data_end, chunked }
    }

    /// Messages of the records that a condition on their place holds for.
    fn messages(&self, holds: impl Fn(&Range<usize>) -> bool) -> Vec<Flat> {
        self.records.iter().filter(|(range, _)| holds(range)).flat_map(|(_, messages)| messages.clone()).collect()
    }
}

/// The messages of one record, by the `mcap` crate.
fn read_alone(record: &[u8]) -> Vec<Flat> {
    let file = [MAGIC, record, MAGIC].concat();
    let flat = ChunkFlattener::new_with_options(&file, Options::IgnoreEndMagic.into()).unwrap();
    flat.map_while(Result::ok)
        .filter_map(|record| match record {
            Record::Message { header, data } => {
                Some((header.channel_id, header.sequence, header.log_time, data.into_owned()))
            }
            _ => None,
        })
        .collect()
}

fn told(file: &[u8]) -> (Vec<Flat>, u64) {
    let (told, inventory) = scan(file);
    let flat = |event: &&Told| match event {
        Told::Message { channel, sequence, log_time, data, .. } => (*channel, *sequence, *log_time, data.clone()),
        _ => unreachable!(),
    };
    (messages(&told).iter().map(flat).collect(), inventory.damage())
}

/// Messages that the index of a recording leads to, every CRC checked.
///
/// The message indexes lead to the same: where the chunk index says, and one behind the other, as `@mcap/core` wants them.
fn indexed(file: &[u8]) -> usize {
    let summary = Summary::read(file).unwrap().unwrap();
    let of_chunk = |index: &ChunkIndex| {
        let messages = summary.stream_chunk(file, index).unwrap().map(Result::unwrap);
        let mut held: Vec<_> = messages.map(|message| (message.channel.id, message.log_time)).collect();
        let start = index.message_index_offsets.values().min().map_or(0, |&offset| offset as usize);
        let region = &file[start..start + index.message_index_length as usize];
        let mut named = Vec::new();
        for record in LinearReader::sans_magic(region) {
            let Record::MessageIndex(MessageIndex { channel_id, records }) = record.unwrap() else { panic!() };
            assert!(index.message_index_offsets.contains_key(&channel_id));
            // An index of no messages is legal; what is not named at all shows below.
            let Some(entry) = records.last() else { continue };
            let last = summary.seek_message(file, index, entry).unwrap();
            assert_eq!((last.channel.id, last.log_time), (channel_id, entry.log_time));
            named.extend(records.iter().map(|entry| (channel_id, entry.log_time)));
        }
        held.sort_unstable();
        named.sort_unstable();
        assert_eq!(named, held);
        held.len()
    };
    summary.chunk_indexes.iter().map(of_chunk).sum()
}

#[test]
fn of_a_recording_cut_off_anywhere_every_whole_record_is_used() {
    for sound in sound_recordings() {
        for n in 0..125 {
            let cut = MAGIC.len() + n * (sound.file.len() - MAGIC.len()) / 125;
            let file = &sound.file[..cut];
            let (found, damage) = told(file);
            assert!(found == sound.messages(|range| range.end <= cut), "{}, cut at {cut}", sound.name);
            assert!(damage > 0, "{}, cut at {cut}", sound.name);
            if sound.chunked {
                assert_eq!(indexed(&fold(file, &topics(), &blocks())), found.len() + 5, "{}, cut at {cut}", sound.name);
            }
        }
    }
}

#[test]
fn a_message_that_became_an_end_of_the_data_ends_nothing() {
    for sound in sound_recordings().into_iter().filter(|sound| !sound.chunked) {
        let messages = sound.records.iter().map(|(range, _)| range.start).filter(|&at| sound.file[at] == 0x05);
        for at in messages.step_by(17) {
            let mut file = sound.file.clone();
            file[at] = 0x0F;
            let (found, damage) = told(&file);
            let others = sound.messages(|range| !range.contains(&at));
            assert!(damage > 0 && others.iter().all(|message| found.contains(message)), "{}, byte {at}", sound.name);
        }
    }
}

/// Gives the record at `at` the length with which it ends at `end`.
fn stretch(file: &[u8], at: usize, end: usize) -> Vec<u8> {
    let mut file = file.to_vec();
    file[at + 1..at + 9].copy_from_slice(&((end - at - 9) as u64).to_le_bytes());
    file
}

#[test]
fn a_record_whose_wrong_length_ends_where_another_one_does_swallows_nothing() {
    let mut rng = randomness();
    for sound in sound_recordings().into_iter().filter(|sound| !sound.chunked) {
        let opaque = |&at: &usize| at < sound.data_end && matches!(sound.file[at], 0x05 | 0x80..);
        let starts = sound.records.iter().map(|(range, _)| range.start).filter(opaque);
        // Within the attachment that is a recording itself records end, too.
        let within = sound.file.windows(MAGIC.len()).enumerate().skip(1).find(|(_, bytes)| *bytes == MAGIC).unwrap().0;
        let mut inner = within + MAGIC.len();
        let mut ends: Vec<usize> = sound.records.iter().map(|(range, _)| range.end).collect();
        while inner + 9 < sound.file.len() && sound.file[inner] != 0x0F {
            inner += 9 + u64::from_le_bytes(sound.file[inner + 1..inner + 9].try_into().unwrap()) as usize;
            ends.push(inner);
        }
        for at in starts.collect::<Vec<_>>() {
            let behind: Vec<usize> = ends.iter().copied().filter(|&end| end > at + 40).collect();
            for _ in 0..4 {
                let end = behind[rng.random_range(0..behind.len())];
                if sound.records.iter().any(|(range, _)| *range == (at..end)) {
                    continue;
                }
                let (found, damage) = told(&stretch(&sound.file, at, end));
                let others = sound.messages(|range| range.start != at);
                let lost = others.iter().filter(|message| !found.contains(message)).count();
                assert!(lost == 0 && damage > 0, "{}: {lost} lost between {at} and {end}", sound.name);
            }
        }
    }
}

#[test]
fn long_messages_swallow_nothing_and_are_told_whatever_their_lengths() {
    let lengths = [200_000, 70_000, 300_000, 70_000, 66_000, 1000, 200_000, 120_000, 5, 90_000];
    let messages = lengths.iter().enumerate().map(|(n, &length)| ((n % 3) as u16, n as u64 + 1, length)).collect();
    let file = Recipe { chunked: false, attachments: Vec::new(), private: false, messages, ..Recipe::plain() }.write();
    let (all, damage) = told(&file);
    assert_eq!((all.len(), damage), (lengths.len(), 0));
    let starts: Vec<usize> = {
        let mut at = MAGIC.len();
        let next = |at: usize| at + 9 + u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
        let all = std::iter::from_fn(|| {
            let this = at;
            at = next(at);
            Some(this)
        });
        all.take_while(|&at| file[at] != 0x0F).filter(|&at| file[at] == 0x05).collect()
    };
    for (n, &at) in starts.iter().enumerate() {
        for &end in &starts[n + 1..] {
            if starts.get(n + 1) == Some(&end) {
                continue;
            }
            let (found, damage) = told(&stretch(&file, at, end));
            let lost = all.iter().filter(|message| message.1 != n as u32 && !found.contains(message)).count();
            assert!(lost == 0 && damage > 0, "message {n} until {end}: {lost} lost");
        }
    }
}

#[test]
fn a_record_of_a_few_bytes_that_became_an_end_of_the_data_ends_nothing() {
    use crate::records::{channel, chunk, message, record, recording};
    for behind in [[chunk(&message(1, 6)), chunk(&message(1, 7))], [message(1, 6), message(1, 7)]] {
        let data = [&[channel(1, 0), message(1, 5), record(0x0F, b"ours")][..], &behind].concat();
        let (found, damage) = told(&recording(&data, &[]));
        assert_eq!(found.iter().map(|message| message.2).collect::<Vec<_>>(), [5, 6, 7]);
        assert!(damage > 0);
    }
}

#[test]
fn a_definition_that_became_an_end_of_the_data_ends_nothing_although_definitions_follow() {
    use crate::records::{channel, message, record, recording};
    for following in [1, 2, 20] {
        let mut data = vec![record(0x0F, &channel(7, 0)[9..])];
        data.extend((1..=following).map(|id| channel(id, 0)));
        data.extend([message(1, 5), message(1, 6)]);
        let (found, damage) = told(&recording(&data, &[]));
        assert_eq!(found.iter().map(|message| message.2).collect::<Vec<_>>(), [5, 6], "{following} channels");
        assert!(damage > 0);
    }
}

#[test]
fn of_a_recording_with_a_wrong_byte_every_other_record_is_used() {
    let mut rng = randomness();
    for sound in sound_recordings() {
        for _ in 0..625 {
            let place = rng.random_range(MAGIC.len()..sound.file.len());
            let flip = rng.random_range(1..=255_u8);
            let mut file = sound.file.clone();
            file[place] ^= flip;
            let hit = sound.records.iter().map(|(range, _)| range).find(|range| range.contains(&place));
            let what = hit.map(|range| (sound.file[range.start], range.clone()));
            let at = format!("{}, byte {place} ^ {flip:#x} of {}, in {what:?}", sound.name, file.len());
            let (found, damage) = told(&file);
            let others = sound.messages(|range| !range.contains(&place));
            let lost = others.iter().filter(|message| !found.contains(message)).count();
            assert_eq!(lost, 0, "{at}");
            // What is wrong within a message outside chunks cannot be told, since it has no CRC.
            let all = sound.messages(|_| true);
            let invented = found.iter().filter(|message| !all.contains(message)).count();
            assert!(invented == 0 || !sound.chunked && invented == 1, "{at}: {invented} invented");
            // But that something is wrong can, by the CRC over all.
            let is_data = sound.records.iter().any(|(range, _)| range.contains(&place) && range.end <= sound.data_end);
            assert!(damage > 0 || sound.chunked || !is_data, "{at}");
            let out = fold(&file, &topics(), &blocks());
            // Messages of a chunk may be found as loose ones, which an index would hide, if its frame is broken or a length
            // in its head: that of the compression's name or of the records.
            let lengths = |start: usize| {
                let name = start + 41..start + 41 + usize::from(sound.file[start + 37]);
                let head = start + 37..name.end + 8;
                (start..start + 9).contains(&place) || head.contains(&place) && !name.contains(&place)
            };
            let unframed = hit.is_some_and(|range| sound.file[range.start] == 6 && lengths(range.start));
            if sound.chunked && !(unframed && indexed(&out) == 0) {
                assert_eq!(indexed(&out), found.len() + 5, "{at}");
            }
        }
    }
}

#[test]
fn what_stands_at_a_wrong_end_is_no_attachment_by_its_opcode_alone() {
    // Too short by four, a message outside chunks ends where its own bytes seem to begin an attachment of terabytes.
    let messages: Vec<_> = (0..300).map(|n| ((n % 3) as u16, 1000 + 7 * n as u64, 30 + n * n % 97)).collect();
    let recipe = Recipe { compression: 0, chunked: false, messages, ..Recipe::plain() };
    let sound = Sound::new("loose".to_owned(), recipe.write(), false);
    let mut seen = 0;
    for opcode in [6, 9] {
        for (range, _) in sound.records.iter().filter(|(range, messages)| messages.len() == 1 && range.len() > 60) {
            let mut file = sound.file.clone();
            file[range.start + 1] -= 4;
            file[range.end - 4] = opcode;
            let (found, damage) = told(&file);
            let others = sound.messages(|other| other != range);
            let lost = others.iter().filter(|message| !found.contains(message)).count();
            assert!(lost == 0 && damage > 0, "opcode {opcode} at {}: {lost} lost, {damage} damages", range.end - 4);
            seen += 1;
        }
    }
    assert!(seen > 200, "{seen}");
}

#[test]
fn zeros_to_the_end_are_a_recording_that_was_cut_off() {
    for sound in sound_recordings() {
        let last = sound.records.iter().map(|(range, _)| range).rfind(|range| range.end <= sound.data_end);
        let whole = last.unwrap().end;
        for zeros in [1, 8, 9, 10, 17, 18, 4096, 5 << 20] {
            let file = [&sound.file[..whole], &vec![0; zeros]].concat();
            let at = format!("{}, {zeros} zeros", sound.name);
            let said: Vec<_> = scan(&file)
                .0
                .into_iter()
                .filter_map(|event| match event {
                    Told::Damage(damage) => Some(damage),
                    _ => None,
                })
                .collect();
            let [damage] = &said[..] else { panic!("{at}: {said:?}") };
            assert_eq!((damage.offset, damage.length), (whole as u64, zeros as u64), "{at}");
            assert!(damage.what.contains("cut off"), "{at}: {}", damage.what);
            assert_eq!(told(&file).0, sound.messages(|_| true), "{at}");
        }
        // Behind zeros there may be records after all, and then nothing was cut off.
        let (front, back) = sound.file.split_at(whole);
        let said = scan(&[front, &[0; 4096], back].concat()).0;
        let cut = said.iter().filter(|event| matches!(event, Told::Damage(damage) if damage.what.contains("cut off")));
        assert_eq!(cut.count(), 0, "{}", sound.name);
    }
}
