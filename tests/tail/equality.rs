//! Whatever writes the recording, and whenever the tail comes: every message is seen, and the result is the batch run's.

use mcap::Compression;

use crate::common::Folder;
use crate::following::{Running, assert_as_batch, length, wait_for};
use crate::recorder::{Session, Style, speed};

/// When the tail starts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Start {
    BeforeTheFileExists,
    WhileItIsEmpty,
    HalfWay,
}

fn follow(session: &Session, style: Style, start: Start) {
    let context = format!("{style:?} {start:?}");
    let folder = Folder::new();
    let path = folder.path().join("rec.mcap");
    if start == Start::WhileItIsEmpty {
        folder.write("rec.mcap", b"");
    }
    let tail = std::thread::scope(|scope| {
        let early = (start != Start::HalfWay).then(|| Running::start(&folder, "tail rec.mcap --json"));
        if early.is_some() {
            wait_for("the sidecar", || folder.path().join("rec.stillpoint.mcap").exists());
        }
        let recorder = scope.spawn(|| session.record(&path, style, speed()));
        let tail = early.unwrap_or_else(|| {
            wait_for("half of the recording", || length(&path) > 150_000 || recorder.is_finished());
            Running::start(&folder, "tail rec.mcap --json")
        });
        recorder.join().unwrap();
        tail
    });
    let run = tail.finish();
    assert_eq!(run.code, 0, "{context}: {}", run.stderr);
    let result: serde_json::Value = serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap();
    assert_eq!(result["messages"], session.len(), "{context}");
    assert_eq!(folder.names(), ["rec.annotated.mcap", "rec.mcap"], "{context}");
    assert_as_batch(&folder, &context);
}

fn follow_all(start: Start) {
    let session = &Session::six_faces();
    let mut styles = Vec::new();
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        for (foxglove, seeking, buffered) in
            [(false, true, true), (false, true, false), (false, false, true), (true, true, true), (true, false, true)]
        {
            for flush in [None, Some(50)] {
                styles.push(Style { foxglove, compression, seeking, buffered, flush, ..Style::default() });
            }
        }
    }
    // What takes long has time to do for others, too.
    for some in styles.chunks(if speed() < 20.0 { styles.len() } else { 2 }) {
        std::thread::scope(|scope| {
            some.iter().for_each(|&style| _ = scope.spawn(move || follow(session, style, start)));
        });
    }
}

#[test]
fn a_tail_that_waits_for_the_recording_makes_what_the_batch_run_makes() {
    follow_all(Start::BeforeTheFileExists);
}

#[test]
fn a_tail_that_finds_the_recording_empty_makes_what_the_batch_run_makes() {
    follow_all(Start::WhileItIsEmpty);
}

#[test]
fn a_tail_that_comes_half_way_makes_what_the_batch_run_makes() {
    follow_all(Start::HalfWay);
}
