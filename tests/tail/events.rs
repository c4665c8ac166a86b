//! What `--json` streams: each event is one line with these keys, which programs rely on.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::common::{Folder, Run};
use crate::recorder::{Session, Style};

/// The keys of each event beside `event`, and those of the object that is called like it.
const EVENTS: [(&str, &str, &str); 14] = [
    ("awaited", "", ""),
    ("opened", "offset", ""),
    ("split", "file", ""),
    ("stillness", "imu log_time stillness", "state statistic enter leave"),
    ("segment", "imu log_time segment", "start end accepted face tilt_deg reason explanation placement temperature"),
    (
        "turn",
        "imu log_time turn",
        "start end angle residual used reason explanation path vertical declared declared_residual declared_std",
    ),
    ("coverage", "imu log_time coverage", "faces complete next_step"),
    (
        "calibration",
        "imu log_time calibration",
        "direction revision accelerometer gyroscope secondary gravity gravity_source segments placements",
    ),
    ("noise", "imu log_time noise", "sensor seconds lasting_seconds period"),
    ("log", "imu log_time log", "level name message"),
    ("damage", "offset bytes what", ""),
    ("trouble", "what", ""),
    ("ended", "ending", ""),
    ("result", "input output imus rests messages damage", ""),
];

fn events(run: &Run) -> Vec<Value> {
    run.stdout.lines().map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}"))).collect()
}

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

fn names(events: &[Value]) -> BTreeSet<&str> {
    events.iter().map(|event| event["event"].as_str().unwrap()).collect()
}

fn check(events: &[Value]) {
    let known: BTreeMap<_, _> = EVENTS.iter().map(|&(name, keys, inner)| (name, (keys, inner))).collect();
    for event in events {
        let name = event["event"].as_str().unwrap();
        let (outer, inner) = known[name];
        assert_eq!(keys(event), outer.split_whitespace().chain(["event"]).collect(), "{event}");
        if let Some(said) = event.get(name) {
            let said = said.as_array().map_or(std::slice::from_ref(said), Vec::as_slice);
            let expected = inner.split_whitespace().collect();
            assert!(said.iter().all(|said| keys(said) == expected), "{event}");
            assert!(event["log_time"].is_u64() && (event["imu"].is_string() || name == "log"), "{event}");
        }
    }
    assert_eq!(events.last().unwrap()["event"], "result");
}

#[test]
fn each_event_is_one_line_with_its_keys() {
    let folder = Folder::with_demo();
    let whole = events(&folder.say("tail demo.mcap --json -q").ok());
    check(&whole);
    let expected =
        ["opened", "stillness", "segment", "turn", "coverage", "calibration", "noise", "log", "ended", "result"];
    assert_eq!(names(&whole), BTreeSet::from(expected));
    let of = |name: &str| whole.iter().filter(|event| event["event"] == name).collect::<Vec<_>>();
    assert_eq!(of("opened")[0]["offset"], 0);
    assert_eq!(of("ended")[0]["ending"], "finished");
    assert_eq!(of("stillness")[0]["stillness"]["state"], "UNKNOWN");
    let rest = &of("segment")[0]["segment"];
    assert!(rest["end"].as_i64().unwrap() - rest["start"].as_i64().unwrap() > 1_000_000_000, "nanoseconds: {rest}");
    // The stream says what the result says.
    let (last, result) = (of("calibration").pop().unwrap(), whole.last().unwrap());
    for triad in ["accelerometer", "gyroscope"] {
        assert_eq!(last["calibration"][triad], result["imus"][0][triad]);
    }
    assert_eq!(result["rests"]["found"], of("segment").len());
}

#[test]
fn events_tell_of_files_damage_and_how_it_ended() {
    let folder = Folder::new();
    let bag = folder.path().join("bag");
    Session::six_faces().record_bag(&bag, 2, Style::default(), f64::INFINITY);
    let cut = std::fs::metadata(bag.join("bag_1.mcap")).unwrap().len() / 2;
    std::fs::File::options().write(true).open(bag.join("bag_1.mcap")).unwrap().set_len(cut).unwrap();
    let run = folder.say("tail bag --json -q --idle-timeout 300ms");
    assert_eq!(run.code, 3);
    let told = events(&run);
    check(&told);
    assert!(names(&told).is_superset(&BTreeSet::from(["split", "damage", "ended"])), "{:?}", names(&told));
    let ended = told.iter().find(|event| event["event"] == "ended").unwrap();
    assert_eq!(ended["ending"], "idle");
    let run = folder.say("tail none.mcap --json -q --idle-timeout 100ms");
    assert_eq!((run.code, run.stdout.as_str()), (1, "{\"event\":\"awaited\"}\n"));
}

#[test]
fn a_tail_that_can_use_nothing_says_so_before_the_end() {
    let folder = Folder::new();
    let file = std::fs::File::create(folder.path().join("a.mcap")).unwrap();
    let mut writer = mcap::WriteOptions::new().compression(None).create(std::io::BufWriter::new(file)).unwrap();
    let text = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data").unwrap();
    let channel = writer.add_channel(text, "/chatter", "cdr", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"\0\x01\0\0\x01\0\0\0\0").unwrap();
    writer.flush().unwrap();
    let run = folder.say("tail a.mcap --json -q --idle-timeout 5");
    assert_eq!(run.code, 1, "{}", run.stderr);
    let trouble = events(&run).into_iter().find(|event| event["event"] == "trouble").unwrap();
    let what = trouble["what"].as_str().unwrap();
    assert!(what.starts_with("so far, no usable IMU topic among /chatter"), "{what}");
    std::mem::forget(writer);
}
