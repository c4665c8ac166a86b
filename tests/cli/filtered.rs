//! Annotated recordings that another program copied or filtered: old annotations never stand among new ones.

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

/// Commands that would put new annotations among the old ones refuse, and say what to run; those apart from them are made.
fn is_refused(folder: &Folder, name: &str) {
    for command in ["annotate", "annotate --in-place", "tail"] {
        let before = folder.read(name);
        let run = folder.run(command.split_whitespace().chain([name, "--set", MAPPED]));
        assert_eq!(run.code, 1, "{command} {name}: {}", run.stderr);
        for words in ["holds annotations of an earlier run", "mcap filter", "--exclude-topic-regex", "--sidecar"] {
            assert!(run.stderr.contains(words), "{command}: no {words} in {}", run.stderr);
        }
        assert!(folder.read(name) == before);
    }
    let stem = name.trim_end_matches(".mcap");
    let made = folder.names().into_iter().filter(|made| made.starts_with(stem)).collect::<Vec<_>>();
    assert_eq!(made, [name], "something is left behind");
    folder.run(["annotate", name, "--sidecar", "-o", &format!("{stem}.apart.mcap"), "--set", MAPPED]).ok();
}

#[test]
fn a_copy_of_an_annotated_recording_is_not_annotated_among_its_old_annotations() {
    let (folder, bytes) = annotated("");
    folder.write("copy.mcap", &copied(&bytes, |_| true, false));
    is_refused(&folder, "copy.mcap");
    folder.write("whole.mcap", &copied(&bytes, |_| true, true));
    is_refused(&folder, "whole.mcap");
    let keeps = |topic: &str| topic == "/imu" || topic.ends_with("/stillpoint/calibration");
    folder.write("one.mcap", &copied(&bytes, keeps, false));
    is_refused(&folder, "one.mcap");
    // Its old annotations are still there to read.
    let report = folder.say("export copy.mcap --format json").ok().json();
    assert_eq!(report["imus"][0]["topic"], "/imu", "{report}");
}

#[test]
fn corrected_messages_and_the_log_are_annotations_too() {
    let (folder, bytes) = annotated("--set output.corrected=final");
    let keeps = |kind: &'static str| move |topic: &str| topic == "/imu" || topic.ends_with(kind);
    folder.write("corrected.mcap", &copied(&bytes, keeps("/stillpoint/corrected"), false));
    is_refused(&folder, "corrected.mcap");
    folder.write("log.mcap", &copied(&bytes, keeps("/stillpoint/log"), false));
    if mcap::Summary::read(&folder.read("log.mcap")).unwrap().unwrap().channels.len() > 1 {
        is_refused(&folder, "log.mcap");
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
