//! Annotated recordings that another program copied or filtered: old annotations stay, and that is said.

use std::io::Cursor;

use stillpoint::topic;

use crate::common::Folder;
use crate::real_recordings::{MAPPED, START, both, recording, six_faces};

/// A copy with the messages of some topics, as filters write it, and the metadata and attachments if `all`.
fn copied(annotated: &[u8], keeps: impl Fn(&str) -> bool, all: bool) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().create(&mut out).unwrap();
    let messages = mcap::MessageStream::new(annotated).unwrap().map(Result::unwrap);
    messages.filter(|message| keeps(&message.channel.topic)).for_each(|message| writer.write(&message).unwrap());
    if all {
        let summary = mcap::Summary::read(annotated).unwrap().unwrap();
        for index in &summary.attachment_indexes {
            writer.attach(&mcap::read::attachment(annotated, index).unwrap()).unwrap();
        }
        for index in &summary.metadata_indexes {
            writer.write_metadata(&mcap::read::metadata(annotated, index).unwrap()).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

/// A folder with `a.mcap`, and the bytes of its annotated copy.
fn annotated(more: &str) -> (Folder, Vec<u8>) {
    let folder = Folder::new();
    folder.write("a.mcap", &recording(six_faces().iter().map(|m| ("/imu", START + m.at, both(m, START + m.at)))));
    let command = format!("annotate a.mcap -o b.mcap {more}");
    folder.run(command.split_whitespace().chain(["--set", MAPPED])).ok();
    let bytes = folder.read("b.mcap");
    (folder, bytes)
}

/// Commands that put new annotations beside the old ones say so, and what to run; `strip` gives the copy back. A sidecar
/// stands apart, and says nothing.
fn is_told(folder: &Folder, name: &str) {
    let before = folder.read(name);
    let stem = name.trim_end_matches(".mcap");
    let run = |command: &str| {
        let run = folder.run(command.split_whitespace().chain(["--set", MAPPED]));
        assert_eq!(run.code, 0, "{command}: {}", run.stderr);
        run.stderr.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    for command in ["annotate -o again.mcap --force", "annotate --in-place", "tail -o again.mcap --force"] {
        let said = run(&format!("{command} {name}"));
        for words in ["holds annotations of an earlier run", "mcap filter", "--exclude-topic-regex", "--sidecar"] {
            assert!(said.contains(words), "{command}: no {words} in {said}");
        }
        let made = if command.ends_with("--in-place") { name } else { "again.mcap" };
        folder.say(&format!("strip {made} -o stripped.mcap --force")).ok();
        assert!(folder.read("stripped.mcap") == before, "{command} {name}");
        folder.write(name, &before);
    }
    let said = run(&format!("annotate {name} --sidecar -o {stem}.apart.mcap"));
    assert!(!said.contains("earlier run"), "{said}");
}

#[test]
fn new_annotations_beside_old_ones_of_a_copy_are_told() {
    let (folder, bytes) = annotated("");
    folder.write("copy.mcap", &copied(&bytes, |_| true, false));
    is_told(&folder, "copy.mcap");
    folder.write("whole.mcap", &copied(&bytes, |_| true, true));
    is_told(&folder, "whole.mcap");
    let keeps = |topic: &str| topic == "/imu" || topic.ends_with("/stillpoint/calibration");
    folder.write("one.mcap", &copied(&bytes, keeps, false));
    is_told(&folder, "one.mcap");
    // Its old annotations are still there to read.
    let report = folder.say("export copy.mcap --format json").ok().json();
    assert_eq!(report["imus"][0]["topic"], "/imu", "{report}");
}

/// Warnings on what was done to a recording before.
fn before(said: &str) -> Vec<&str> {
    let told =
        |line: &&str| line.starts_with("warning: ") && (line.contains("annotated") || line.contains("annotations"));
    said.lines().filter(told).collect()
}

#[test]
fn a_copy_that_carries_our_metadata_is_told_once() {
    let (folder, bytes) = annotated("");
    folder.write("whole.mcap", &copied(&bytes, |_| true, true));
    folder.write("alone.mcap", &copied(&bytes, |topic| !topic::is_annotation(topic), true));
    let (annotate, tail) = ("annotate -o again.mcap --force", "tail -o again.mcap --force");
    for (name, commands, words) in [
        ("whole.mcap", &[annotate, tail][..], "holds annotations of an earlier run"),
        ("alone.mcap", &[annotate], "was annotated, then edited by another program"),
    ] {
        for command in commands {
            let run = folder.run(format!("{command} {name}").split_whitespace().chain(["--set", MAPPED])).ok();
            let warnings = before(&run.stderr);
            assert_eq!(warnings.len(), 1, "{command} {name}: {warnings:?}");
            assert!(warnings[0].contains(words), "{warnings:?}");
        }
        let run = folder.run(["topics", name, "--set", MAPPED]).ok();
        let warnings = before(&run.stderr);
        assert_eq!(warnings.len(), 1, "topics {name}: {warnings:?}");
        assert!(warnings[0].contains("was annotated, then edited by another program"), "{warnings:?}");
    }
}

#[test]
fn corrected_messages_and_the_log_are_annotations_too() {
    let (folder, bytes) = annotated("--set output.corrected=final");
    let keeps = |kind: &'static str| move |topic: &str| topic == "/imu" || topic.ends_with(kind);
    folder.write("corrected.mcap", &copied(&bytes, keeps("/stillpoint/corrected"), false));
    is_told(&folder, "corrected.mcap");
    folder.write("log.mcap", &copied(&bytes, keeps("/stillpoint/log"), false));
    if mcap::Summary::read(&folder.read("log.mcap")).unwrap().unwrap().channels.len() > 1 {
        is_told(&folder, "log.mcap");
    }
}

#[test]
fn what_is_filtered_without_annotations_is_annotated_and_stripped_exactly() {
    let (folder, bytes) = annotated("");
    for (name, all) in [("messages.mcap", false), ("metadata.mcap", true)] {
        folder.write(name, &copied(&bytes, |topic| !topic::is_annotation(topic), all));
        folder.run(["annotate", name, "-o", "again.mcap", "--force", "--set", MAPPED]).ok();
        folder.say("strip again.mcap -o stripped.mcap --force").ok();
        assert!(folder.read("stripped.mcap") == folder.read(name), "{name}");
        let calibrations = |bytes: &[u8]| {
            let messages = mcap::MessageStream::new(bytes).unwrap().map(Result::unwrap);
            messages.filter(|message| message.channel.topic == "/imu/stillpoint/calibration").count()
        };
        assert_eq!(calibrations(&folder.read("again.mcap")), calibrations(&bytes), "{name}");
    }
    // A topic of somebody else that only sounds like ours stays a topic.
    let other = six_faces().into_iter().flat_map(|m| {
        let message = both(&m, START + m.at);
        [("/imu", START + m.at, message.clone()), ("/robot/stillpoint/segment", START + m.at, message)]
    });
    folder.write("other.mcap", &recording(other));
    folder.run(["annotate", "other.mcap", "--set", MAPPED]).ok();
}

#[test]
fn a_summary_that_is_damaged_is_no_edit_of_another_program() {
    let (folder, bytes) = annotated("");
    // The index entry of our metadata, which is then of a private kind.
    let entry =
        |at: &usize| bytes[*at] == 0x0D && bytes[at + 1..].len() > 60 && bytes[at + 29..].starts_with(b"stillpoint");
    let at = (0..bytes.len() - 70).rev().find(entry).unwrap();
    let mut damaged = bytes.clone();
    damaged[at] = 0xA4;
    folder.write("damaged.mcap", &damaged);
    for command in [
        "annotate damaged.mcap -o again.mcap --force",
        "topics damaged.mcap",
        "tail damaged.mcap -o again.mcap --force",
    ] {
        let run = folder.run(command.split_whitespace().chain(["--set", MAPPED]));
        assert_eq!(before(&run.stderr), [""; 0], "{command}");
    }
    // What was recorded is found in it, whole.
    folder.write("annotated.mcap", &bytes);
    for name in ["annotated", "damaged"] {
        folder.say(&format!("strip {name}.mcap -o {name}.stripped.mcap --force")).ok();
    }
    assert!(folder.read("damaged.stripped.mcap") == folder.read("annotated.stripped.mcap"));
}
