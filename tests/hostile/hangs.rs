//! Few bytes that once cost much time. CPU time is bounded by the system, so that a busy machine makes no difference.

use mcap::MAGIC;

use crate::common::Folder;
use crate::{shell, watch};

const CHUNK: u8 = 6;
const MESSAGE_INDEX: u8 = 7;

fn record(opcode: u8, length: u64, body: &[u8]) -> Vec<u8> {
    [&[opcode], &length.to_le_bytes()[..], body].concat()
}

fn whole(opcode: u8, body: &[u8]) -> Vec<u8> {
    record(opcode, body.len() as u64, body)
}

fn header() -> Vec<u8> {
    [MAGIC, &whole(1, &[0; 8])].concat()
}

/// The commands that read a recording end within so much CPU time, neither killed nor in a panic.
fn ends(folder: &Folder, name: &str, seconds: u32) {
    for verb in [
        "topics",
        "annotate --force -o out.mcap --allow-no-imu",
        "tail -o t.mcap --idle-timeout 200ms --allow-no-imu --force",
    ] {
        let run = shell(folder, &format!("ulimit -t {seconds}; exec $STILLPOINT {verb} {name}"));
        assert!((0..=5).contains(&run.code), "{verb}: {} {}", run.code, run.stderr);
    }
}

/// Recordings whose record lengths wrap around when they are added to where they stand.
fn wrapping() -> Vec<Vec<u8>> {
    let lengths = [u64::MAX, u64::MAX - 1, u64::MAX - 42, u64::MAX << 16, i64::MAX as u64, (i64::MAX as u64) + 9];
    let mut found = Vec::new();
    for opcode in [1, 3, 4, 5, CHUNK, MESSAGE_INDEX, 8, 9, 10, 12, 13, 15, 0x85] {
        for length in lengths {
            found.push([header(), record(opcode, length, &[0xd5, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff])].concat());
            found.push([header(), whole(12, &[0; 8]), record(opcode, length, &[0; 20])].concat());
        }
        // Back to the record itself: 25 bytes stand in front of it.
        found.push([header(), record(opcode, 25_u64.wrapping_neg().wrapping_sub(9), &[0; 9])].concat());
    }
    found
}

#[test]
fn lengths_that_wrap_end() {
    let folder = Folder::new();
    folder.write("51.mcap", &[header(), whole(12, &[0; 8]), record(5, u64::MAX << 8 | 0xd5, &[])].concat());
    for (n, bytes) in wrapping().into_iter().enumerate() {
        folder.write(&format!("{n}.mcap"), &bytes);
    }
    // All in one process, which a hang would not come out of.
    let run = shell(&folder, "ulimit -t 60; exec $STILLPOINT annotate *.mcap --out-dir out --allow-no-imu -q");
    assert!((0..=5).contains(&run.code), "{} {}", run.code, run.stderr);
    ends(&folder, "51.mcap", 10);
    let settled =
        |said: &str| said.matches("left alone").count() + said.matches(": annotated").count() >= wrapping().len();
    watch(&folder, "--out-dir seen", settled);
}

/// A chunk with so many channels, each of which has one message and an index of it.
fn channels(count: u16, topic: impl Fn(u16) -> String, schema: (&str, &str)) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let (name, source) = schema;
    let mut records = whole(3, &[&1_u16.to_le_bytes()[..], &text(name), &text("ros2msg"), &text(source)].concat());
    let mut indexes = Vec::new();
    for id in 0..count {
        let fields =
            [&id.to_le_bytes()[..], &1_u16.to_le_bytes(), &text(&topic(id)), &text("cdr"), &0_u32.to_le_bytes()];
        records.extend(whole(4, &fields.concat()));
    }
    for id in 0..count {
        let offset = records.len() as u64;
        let times = [1_u64.to_le_bytes(), 1_u64.to_le_bytes()].concat();
        records.extend(whole(5, &[&id.to_le_bytes()[..], &[0; 4], &times, &[0, 1, 0, 0]].concat()));
        let entry = [&id.to_le_bytes()[..], &16_u32.to_le_bytes(), &1_u64.to_le_bytes(), &offset.to_le_bytes()];
        indexes.extend(whole(MESSAGE_INDEX, &entry.concat()));
    }
    let span = [1_u64.to_le_bytes(), 1_u64.to_le_bytes(), (records.len() as u64).to_le_bytes()].concat();
    let body = [&span[..], &[0; 4], &text(""), &(records.len() as u64).to_le_bytes(), &records].concat();
    let end = [whole(15, &[0; 4]), whole(2, &[0; 20])].concat();
    [header(), whole(CHUNK, &body), indexes, end, MAGIC.to_vec()].concat()
}

#[test]
fn as_many_channels_as_there_are_ids_cost_no_more_than_their_bytes() {
    let folder = Folder::new();
    let plain = ("std_msgs/msg/String", "string data");
    let vector = (
        "geometry_msgs/msg/Vector3Stamped",
        "geometry_msgs/Vector3 vector\n===\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z",
    );
    folder.write("distinct.mcap", &channels(65_535, |id| format!("/t{id}"), plain));
    folder.write("alike.mcap", &channels(65_535, |_| "/t".to_owned(), plain));
    folder.write(
        "halves.mcap",
        &channels(20_000, |id| format!("/{id}/{}", if id % 2 == 0 { "accel" } else { "gyro" }), vector),
    );
    folder.write("one_side.mcap", &channels(65_535, |id| format!("/{id}/accel"), vector));
    for name in ["distinct.mcap", "alike.mcap", "halves.mcap", "one_side.mcap"] {
        ends(&folder, name, 60);
    }
}

#[test]
fn a_recording_that_takes_too_long_or_whose_runs_died_is_left_alone_and_the_others_are_not() {
    let folder = Folder::with_demo();
    folder.write("big.mcap", &folder.read("demo.mcap"));
    let said = watch(&folder, "--time-limit 1ms --out-dir slow", |said| said.matches("left alone").count() == 2);
    assert!(said.contains("took longer than") && said.contains("--time-limit"), "{said}");

    // As a run leaves it that is killed over the recording, each time.
    for death in 1..=4 {
        let die = format!(
            "$STILLPOINT watch . --out-dir out --interval 20ms --idle-timeout 1ms & P=$!; \
             until grep -qs '\"deaths\":{death}' out/.big.stillpoint-attempt; do kill -0 $P || exit 9; done; \
             kill -9 $P; wait $P"
        );
        let run = shell(&folder, &die);
        assert!(run.code != 9, "{death}: {}", run.stderr);
        shell(&folder, "rm -f out/*.mcap out/*.checkpoint");
    }
    let said =
        watch(&folder, "--out-dir out", |said| said.contains("demo.mcap: annotated") && said.contains("left alone"));
    assert!(said.contains("runs died while they worked on it"), "{said}");
    assert!(folder.path().join("out/big.quarantine.json").exists());
}
