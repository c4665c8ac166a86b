//! Two sensors on one topic: told apart by their frame_ids, and never learned as one where nothing tells them apart.

use serde_json::{Value, json};

use crate::common::{Folder, program};
use crate::real_recordings::{MAPPED, Measured, START, both, is_true, recording, six_faces};
use crate::session::GYRO_BIAS;

/// What a second sensor reads that is mounted otherwise.
fn other(m: &Measured) -> Measured {
    Measured { at: m.at + 5_000_000, accel: m.accel.yzx(), gyro: m.gyro.yzx() }
}

/// The messages of both sensors in turn, each under a frame.
fn in_turn(frames: [&str; 2]) -> Vec<u8> {
    let message = |m: &Measured, frame: &str| {
        let mut message = both(m, START + m.at);
        message["header"]["frame_id"] = json!(frame);
        ("/imu", START + m.at, message)
    };
    recording(six_faces().iter().flat_map(|m| [message(m, frames[0]), message(&other(m), frames[1])]))
}

#[test]
fn sensors_that_take_turns_under_one_frame_are_named_by_every_command() {
    let folder = Folder::new();
    folder.write("a.mcap", &in_turn(["imu", "imu"]));
    let words = "two sensors take turns";
    for line in [
        "annotate a.mcap -o batch.mcap",
        "tail a.mcap -o tail.mcap",
        "report a.mcap",
        "report batch.mcap",
        "topics a.mcap",
        "export batch.mcap --format json",
    ] {
        let run = folder.run(line.split(' ').chain(["--set", MAPPED])).ok();
        // The terminal wraps its lines.
        let text = format!("{} {}", run.stdout, run.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(words), "{line}: {text}");
    }
    assert!(folder.read("batch.mcap") == folder.read("tail.mcap"), "batch and tail differ");
    let said = mcap::MessageStream::new(&folder.read("batch.mcap"))
        .unwrap()
        .map(Result::unwrap)
        .filter(|message| message.channel.topic == "/stillpoint/log")
        .filter(|message| String::from_utf8_lossy(&message.data).contains(words))
        .count();
    assert_eq!(said, 2, "once for each triad in the log");
    let result = folder.say("export batch.mcap --format json").ok().json();
    let imu = &result["imus"][0];
    assert_eq!([&imu["accelerometer"]["bias"], &imu["gyroscope"]["bias"]], [&Value::Null, &Value::Null], "{result:#}");
}

#[test]
fn a_service_says_why_a_recording_of_such_sensors_is_not_calibrated() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    folder.write("in/a.mcap", &in_turn(["imu", "imu"]));
    let log = std::fs::File::create(folder.path().join("log")).unwrap();
    let mut watch = std::process::Command::new(program())
        .args(["watch", "in", "--out-dir", "out", "--interval", "50ms", "--set", MAPPED])
        .current_dir(folder.path())
        .stderr(log)
        .spawn()
        .unwrap();
    let said = || String::from_utf8_lossy(&folder.read("log")).into_owned();
    for _ in 0..400 {
        if said().contains("is not calibrated") {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    watch.kill().unwrap();
    watch.wait().unwrap();
    assert!(said().contains("/imu is not calibrated") && said().contains("two sensors take turns"), "{}", said());
}

#[test]
fn sensors_with_frames_of_their_own_are_imus_of_their_own() {
    let folder = Folder::new();
    folder.write("a.mcap", &in_turn(["left", "right"]));
    let run = folder.run(["annotate", "a.mcap", "-o", "batch.mcap", "--json", "--set", MAPPED]).ok();
    assert!(!run.stderr.contains("take turns"), "{}", run.stderr);
    let result = run.json();
    is_true(&result, GYRO_BIAS);
    let names: Vec<_> = result["imus"].as_array().unwrap().iter().map(|imu| imu["topic"].clone()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    let right = &result["imus"][1]["accelerometer"]["bias"];
    let [x, y, z] = [0, 1, 2].map(|axis| right[axis].as_f64().unwrap());
    assert!((x + 0.08).abs() < 0.03 && (y - 0.20).abs() < 0.03 && (z - 0.12).abs() < 0.03, "{right}");
    folder.run(["tail", "a.mcap", "-o", "tail.mcap", "--set", MAPPED]).ok();
    assert!(folder.read("batch.mcap") == folder.read("tail.mcap"), "batch and tail differ");
}

#[test]
fn a_sensor_without_a_frame_has_a_topic_that_ros_takes() {
    let folder = Folder::new();
    folder.write("a.mcap", &in_turn(["left", ""]));
    let result = folder.run(["annotate", "a.mcap", "--json", "--set", MAPPED]).ok().json();
    let names: Vec<_> = result["imus"].as_array().unwrap().iter().map(|imu| imu["name"].to_string()).collect();
    assert!(names.len() == 2 && names[0] != names[1], "{names:?}");
    let annotated = folder.read("a.annotated.mcap");
    let summary = mcap::Summary::read(&annotated).unwrap().unwrap();
    assert!(summary.channels.values().all(|channel| !channel.topic.contains("//")), "{:?}", summary.channels);
}

#[test]
fn one_sensor_whose_readings_come_twice_or_that_shakes_is_one() {
    let folder = Folder::new();
    let twice = six_faces()
        .into_iter()
        .flat_map(|m| [0, 5_000_000].map(|late| ("/imu", START + m.at + late, both(&m, START + m.at + late))));
    let shaken = six_faces().into_iter().enumerate().map(|(i, mut m)| {
        // At nearly half the rate, in a part of the session.
        m.accel.x += if i < 300 { (i as f64 * 3.12).sin() * 3.0 } else { 0.0 };
        ("/imu", START + m.at, both(&m, START + m.at))
    });
    for bytes in [recording(twice), recording(shaken)] {
        folder.write("a.mcap", &bytes);
        let run = folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--force", "--json", "--set", MAPPED]).ok();
        assert!(
            !run.stdout.contains("take turns") && !run.stderr.contains("take turns"),
            "{}{}",
            run.stdout,
            run.stderr
        );
    }
}
