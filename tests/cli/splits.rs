//! Recordings of several files whose sensors stand in files of their own, or whose readings come late across two of them:
//! what is learned is what one file would teach.

use serde_json::Value;

use crate::common::{Folder, bag_metadata};
use crate::real_recordings::{Measured, START, both, is_true, recording, six_faces};
use crate::session::GYRO_BIAS;

const PAIR: &str = r#"imu=[{topic="/a", accel="a", gyro={topic="/g", path="g"}}]"#;

type Message = (&'static str, i64, Value);

fn on(topic: &'static str, m: &Measured) -> Message {
    (topic, START + m.at, both(m, START + m.at))
}

/// The IMUs of a JSON result, without the names of files.
fn learned(run: &crate::common::Run) -> Value {
    let result = run.json();
    is_true(&result, GYRO_BIAS);
    result["imus"].clone()
}

/// One file, files that are joined, the same in place, and a rosbag2 folder teach the same; stripped, each is as before.
fn parts_teach_what_the_whole_does(parts: &[Vec<Message>], mapping: &str) {
    let folder = Folder::new();
    let names: Vec<_> = (0..parts.len()).map(|i| format!("p{i}.mcap")).collect();
    let write = |within: &str| {
        for (name, part) in names.iter().zip(parts) {
            folder.write(&format!("{within}{name}"), &recording(part.clone()));
        }
    };
    write("");
    folder.write("whole.mcap", &recording(parts.concat()));
    let set = ["--json", "--set", mapping];
    let whole = learned(&folder.run(["annotate", "whole.mcap"].iter().chain(&set)).ok());
    let all = names.iter().map(String::as_str);
    let joined = folder.run(["annotate", "--join", "--out-dir", "out"].into_iter().chain(all.clone()).chain(set)).ok();
    assert_eq!(learned(&joined), whole, "joined");
    let before: Vec<_> = names.iter().map(|name| folder.read(name)).collect();
    let in_place = folder.run(["annotate", "--join", "--in-place"].into_iter().chain(all).chain(set)).ok();
    assert_eq!(learned(&in_place), whole, "in place");
    for (name, before) in names.iter().zip(before) {
        assert!(
            folder.read(name) == folder.read(&format!("out/{}", name.replace(".mcap", ".annotated.mcap"))),
            "{name}"
        );
        folder.say(&format!("strip {name} -o stripped.mcap --force")).ok();
        assert!(folder.read("stripped.mcap") == before, "{name}");
    }
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    write("bag/");
    folder.write("bag/metadata.yaml", bag_metadata(&names).as_bytes());
    assert_eq!(learned(&folder.run(["annotate", "bag"].iter().chain(&set)).ok()), whole, "folder");
    let tail = folder.run(["tail", "bag", "-o", "followed", "--idle-timeout", "1s", "--set", mapping]).ok();
    assert!(tail.code == 0);
    crate::common::same_folders(&folder.path().join("bag.annotated"), &folder.path().join("followed"));
}

#[test]
fn an_accelerometer_and_a_gyroscope_in_files_of_their_own_are_one_imu() {
    let samples = six_faces();
    let of = |topic, samples: &[Measured]| samples.iter().map(|m| on(topic, m)).collect::<Vec<_>>();
    parts_teach_what_the_whole_does(&[of("/a", &samples), of("/g", &samples)], PAIR);
    parts_teach_what_the_whole_does(&[of("/g", &samples), of("/a", &samples)], PAIR);
    // Each file holds a half of the time, and in it one sensor behind the other.
    let (first, second) = samples.split_at(samples.len() / 2);
    let half = |samples: &[Measured]| [of("/a", samples), of("/g", samples)].concat();
    parts_teach_what_the_whole_does(&[half(first), half(second)], PAIR);
}

#[test]
fn readings_that_come_late_across_two_files_are_sorted_in() {
    let samples = six_faces();
    // By turns 40 ms late, also where one file ends and the next begins.
    let mut late: Vec<_> = samples.iter().enumerate().collect();
    late.sort_by_key(|(i, m)| m.at + if i % 2 == 0 { 40_000_000 } else { 0 });
    let messages = late.into_iter().scan(0, |log_time, (_, m)| {
        *log_time = (*log_time).max(START + m.at);
        Some(("/imu", *log_time, both(m, START + m.at)))
    });
    let messages: Vec<_> = messages.collect();
    for cut in [messages.len() / 2, 750, 751] {
        let (first, second) = messages.split_at(cut);
        let mapping = r#"imu=[{topic="/imu", accel="a", gyro="g"}]"#;
        parts_teach_what_the_whole_does(&[first.to_vec(), second.to_vec()], mapping);
    }
}
