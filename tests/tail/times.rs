//! Recordings whose times do not fit, while they grow: the same bytes as of the whole, whatever their stamps and order.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::{Cursor, Write as _};

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::common::Folder;
use crate::following::{Running, wait_for};
use crate::session::Session;

const START: i64 = 1_700_000_000_000_000_000;

/// Messages of two topics: topic, log time, stamp, reading.
type Message = (&'static str, i64, i64, Vector3<f64>);
type Messages = Vec<Message>;

/// Six faces, each sample once on either topic.
fn six_faces() -> Messages {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let ups: Vec<_> = axes.into_iter().flat_map(|axis| [axis, -axis]).collect();
    let samples = Session::new().rests(&ups, 3.0).samples;
    let told = |(i, pair): (usize, &[(_, stillpoint::imu::Sample)])| {
        let at = START + i as i64 * 10_000_000;
        [("/g", at, at, pair[0].1.value), ("/a", at, at, pair[1].1.value)]
    };
    samples.chunks_exact(2).enumerate().flat_map(told).collect()
}

fn recording(messages: &Messages) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().chunk_size(Some(20_000)).create(&mut out).unwrap();
    let channels: BTreeMap<_, _> =
        ["/a", "/g"].map(|topic| (topic, writer.add_channel(0, topic, "json", &BTreeMap::new()).unwrap())).into();
    for (topic, log_time, stamp, v) in messages {
        let stamp = json!({"sec": stamp / 1_000_000_000, "nanosec": stamp % 1_000_000_000});
        let message: Value = json!({"header": {"stamp": stamp}, "v": {"x": v.x, "y": v.y, "z": v.z}});
        let (channel_id, log_time) = (channels[topic], *log_time as u64);
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, message.to_string().as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

/// Follows a file that grows by slices, and compares with what `annotate` makes of the whole. What it said.
fn grown(what: &str, messages: &Messages) -> String {
    const MAPPED: &str = r#"imu=[{topic="/a",accel="v",gyro={topic="/g",path="v"}}]"#;
    let bytes = recording(messages);
    let folder = Folder::new();
    let path = folder.path().join("rec.mcap");
    let (first, rest) = bytes.split_at(100);
    folder.write("rec.mcap", first);
    let tail = Running::start(&folder, &format!("tail rec.mcap -o tail.mcap --idle-timeout 2s --set {MAPPED}"));
    wait_for("the sidecar", || folder.names().iter().any(|name| name.contains("stillpoint")));
    let mut file = OpenOptions::new().append(true).open(&path).unwrap();
    for slice in rest.chunks(bytes.len() / 16) {
        file.write_all(slice).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let followed = tail.finish();
    assert_eq!(followed.code, 0, "{what}: {}", followed.stderr);
    let batch = folder.run(["annotate", "rec.mcap", "-o", "batch.mcap", "--set", MAPPED]).ok();
    assert!(folder.read("tail.mcap") == folder.read("batch.mcap"), "{what}: tail and batch differ");
    batch.stderr
}

#[test]
fn stamps_that_stand_and_readings_out_of_order_give_the_same_while_they_come() {
    let change = |how: &dyn Fn(usize, &mut Message)| {
        let mut messages = six_faces();
        messages.iter_mut().enumerate().for_each(|(i, message)| how(i, message));
        messages
    };
    let coarse = change(&|_, (.., stamp, _)| *stamp -= *stamp % 100_000_000);
    let stuck = change(&|i, (.., stamp, _)| *stamp = if i < 2000 { *stamp } else { START + 7 });
    let repeated: Messages = six_faces().into_iter().flat_map(|m| [m; 3]).collect();
    let mut late = change(&|i, (_, log, ..)| *log += if i % 400 == 399 { 60_000_000 } else { 0 });
    late.sort_by_key(|(_, log, ..)| *log);
    let mut behind = six_faces();
    behind.sort_by_key(|(topic, ..)| *topic);
    let mut written = behind.clone();
    written.iter_mut().enumerate().for_each(|(i, (_, log, ..))| *log = START + 20_000 * i as i64);
    for (what, messages, said) in [
        ("a coarse clock", coarse, "differ under one stamp"),
        ("a clock that stops", stuck, "log time is used"),
        ("readings polled three times", repeated, "repeat a reading"),
        ("readings that come late", late, "were sorted in"),
        ("one topic behind the other", behind, "read in the order of their log times"),
        ("and logged as it was written", written, "read in the order of their stamps"),
    ] {
        let told = grown(what, &messages);
        assert!(told.contains(said), "{what}: {told}");
    }
}
