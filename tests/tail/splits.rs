//! Law: however the bytes of a recording come over time, the result is the same.

use std::fs::File;
use std::io::Write as _;
use std::os::unix::fs::FileExt as _;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use stillpoint::config::Config;
use stillpoint::run::{self, Access, Following, Input, Notice, Options, Stop};
use stillpoint::simulate::{Scenario, record};

use crate::common::Folder;

fn demo() -> Vec<u8> {
    let mut bytes = Vec::new();
    record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(32), ..Default::default() })]

    #[test]
    fn any_split_of_the_bytes_over_time_gives_the_same_events_and_output(
        mut places in prop::collection::vec(any::<prop::sample::Index>(), 0..20),
        cut in prop::option::of(any::<prop::sample::Index>()),
        flip in prop::option::of((any::<prop::sample::Index>(), 1_u8..)),
    ) {
        let mut bytes = demo();
        if let Some((place, by)) = flip {
            let place = 8 + place.index(bytes.len() - 8);
            bytes[place] ^= by;
        }
        if let Some(cut) = cut {
            // Not within the header: what the batch run makes of no header is not to be waited for.
            bytes.truncate(100 + cut.index(bytes.len() - 100));
        }
        let mut events = Vec::new();
        places.sort_by_key(|place| place.index(bytes.len()));
        let places: Vec<_> = places.iter().map(|place| place.index(bytes.len())).chain([bytes.len()]).collect();
        let at_once = follow(&bytes, &[bytes.len()], &mut events);
        let mut again = Vec::new();
        let in_pieces = follow(&bytes, &places, &mut again);
        prop_assert_eq!(&events, &again);
        prop_assert!(at_once == in_pieces, "the outputs differ");
        prop_assert!(at_once == batch(&bytes), "tail and batch differ");
    }
}

/// The result of a recording that grows to each of these lengths, if there is one, and what is told meanwhile.
fn follow(bytes: &[u8], lengths: &[usize], events: &mut Vec<String>) -> Option<Vec<u8>> {
    let folder = Folder::new();
    let (input, output) = (folder.path().join("rec.mcap"), folder.path().join("out.mcap"));
    let following = Following {
        poll: Duration::from_millis(1),
        idle: Duration::from_millis(60),
        patience: None,
        keep_sidecar: false,
        options: Options::default(),
    };
    let (mut lengths, mut from) = (lengths.iter().filter(|&&until| until > 0), 0);
    let mut notify = |news: Notice<'_>| match news {
        Notice::Annotation { event, .. } => events.push(format!("{event:?}")),
        // Whenever all has been read, there is more.
        Notice::Awaited | Notice::Read(_) => {
            if let Some(&until) = lengths.next() {
                let mut file = File::options().create(true).append(true).open(&input).unwrap();
                file.write_all(&bytes[from..until]).unwrap();
                from = until;
            }
        }
        _ => {}
    };
    let done = run::tail(&input, &output, &Config::default(), &following, &Stop::default(), &mut notify);
    done.ok().map(|_| folder.read("out.mcap"))
}

fn batch(bytes: &[u8]) -> Option<Vec<u8>> {
    let folder = Folder::new();
    folder.write("rec.mcap", bytes);
    let input = Input::open_original(&folder.path().join("rec.mcap"), Access::Read).unwrap();
    let output = folder.path().join("out.mcap");
    let done = run::annotate(&input, &[output], &Config::default(), Options::default(), &|_| Ok(()));
    done.ok().map(|_| folder.read("out.mcap"))
}

#[test]
fn a_chunk_whose_length_is_filled_in_is_read_though_the_file_does_not_grow() {
    let bytes = demo();
    let (mut at, mut chunks) = (mcap::MAGIC.len(), Vec::new());
    // Up to the end of the data.
    while bytes[at] != 15 {
        let end = at + 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        chunks.extend((bytes[at] == 6).then_some((at, end)));
        at = end;
    }
    let (chunk, end) = chunks[chunks.len() / 2];
    let folder = Folder::new();
    let (input, output) = (folder.path().join("rec.mcap"), folder.path().join("out.mcap"));
    let open = [&bytes[..chunk + 1], &[0xFF; 8], &bytes[chunk + 9..end]].concat();
    folder.write("rec.mcap", &open);
    let file = File::options().write(true).open(&input).unwrap();
    let mut closed: Option<Instant> = None;
    let mut whole = false;
    let mut notify = |news: Notice<'_>| match (news, closed) {
        (Notice::Read(progress), None) if progress.read >= chunk as u64 => {
            // It has been looked at as it is.
            std::thread::sleep(Duration::from_millis(50));
            file.write_all_at(&bytes[chunk + 1..chunk + 9], chunk as u64 + 1).unwrap();
            closed = Some(Instant::now());
        }
        (Notice::Read(progress), Some(_)) if progress.read >= end as u64 && !whole => {
            file.write_all_at(&bytes[end..], end as u64).unwrap();
            whole = true;
        }
        (_, Some(closed)) => assert!(whole || closed.elapsed() < Duration::from_secs(30), "it is not read"),
        _ => {}
    };
    let idle = Duration::from_secs(600);
    let following = Following {
        poll: Duration::from_millis(1),
        idle,
        patience: None,
        keep_sidecar: false,
        options: Options::default(),
    };
    run::tail(&input, &output, &Config::default(), &following, &Stop::default(), &mut notify).unwrap();
    assert!(Some(folder.read("out.mcap")) == batch(&bytes));
}
