//! The laws of `targets/`, on what once broke them and on a few random bytes; `STILLPOINT_FUZZ=100` tries a hundred times
//! as many, `.ci/fuzz` those that reach new code.
#![allow(clippy::unwrap_used)]

#[path = "../common/needs.rs"]
mod needs;
mod targets;

use std::panic::{catch_unwind, resume_unwind};

use rand::RngExt as _;

/// Cases of each law: a second or two of each.
const CASES: [(&str, usize); 10] = [
    ("bag", 40),
    ("checkpoints", 60),
    ("configuration", 200),
    ("decoders", 4000),
    ("fold", 400),
    ("imports", 2000),
    ("pipeline", 20),
    ("scan", 400),
    ("schemas", 3000),
    ("tail", 20),
];

fn law(name: &str) -> targets::Law {
    targets::ALL.iter().find(|(known, _)| *known == name).unwrap().1
}

/// Tries a law on bytes of any length, short ones more often; bytes that break it are kept.
fn random_bytes(name: &str) {
    let (_, cases) = CASES.iter().find(|(known, _)| *known == name).unwrap();
    let times = std::env::var("STILLPOINT_FUZZ").map_or(1, |times| times.parse().unwrap());
    let mut rng = needs::randomness();
    for _ in 0..cases * times {
        let most = 1 << rng.random_range(3..12);
        let bytes: Vec<u8> = (0..rng.random_range(0..most)).map(|_| rng.random()).collect();
        if let Err(broken) = catch_unwind(|| law(name)(&bytes)) {
            let kept = std::env::temp_dir().join(format!("stillpoint-{name}-{:08x}", crc32fast::hash(&bytes)));
            std::fs::write(&kept, &bytes).unwrap();
            eprintln!("the bytes are kept in {}", kept.display());
            resume_unwind(broken);
        }
    }
}

#[test]
fn what_once_broke_a_law_does_no_more() {
    for (name, law) in targets::ALL {
        let folder = needs::root().join("tests/fuzz/findings").join(name);
        let mut files: Vec<_> =
            std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        for file in files {
            eprintln!("{}", file.display());
            law(&std::fs::read(&file).unwrap());
        }
    }
}

#[test]
fn any_metadata_of_a_folder_is_read_or_refused() {
    random_bytes("bag");
}

#[test]
fn whatever_stands_in_the_place_of_a_checkpoint_the_recording_stays_within() {
    random_bytes("checkpoints");
}

#[test]
fn any_configuration_is_loaded_or_refused() {
    random_bytes("configuration");
}

#[test]
fn any_bytes_are_a_message_or_refused() {
    random_bytes("decoders");
}

#[test]
fn what_is_whole_in_any_recording_is_found_when_it_is_annotated() {
    random_bytes("fold");
}

#[test]
fn any_text_is_a_calibration_or_refused() {
    random_bytes("imports");
}

#[test]
fn every_command_reads_any_recording_or_refuses_it() {
    random_bytes("pipeline");
}

#[test]
fn any_splits_of_any_recording_give_the_same_events() {
    random_bytes("scan");
}

#[test]
fn any_schema_is_understood_or_refused() {
    random_bytes("schemas");
}

#[test]
fn a_tail_of_any_recording_makes_what_the_batch_run_makes() {
    random_bytes("tail");
}
