//! Every message of the real ROS 2 recordings is decoded to the numbers that `mcap-ros2-support` reads; see
//! `tests/interop/decode_ros2.py`, which made the expected checksums and checks them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use stillpoint::imu::{ImuConfig, Intake, Reading, Sample, SecondaryConfig, Sensor};
use stillpoint::record;

/// The real recordings, or none where they are absent.
fn recordings() -> Option<PathBuf> {
    let data = std::env::var_os("STILLPOINT_DATA").map(PathBuf::from);
    let data = data.unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"));
    if data.is_dir() {
        return Some(data.join("recordings"));
    }
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{} is absent", data.display());
    eprintln!("skipped: {} is absent", data.display());
    None
}

fn channel(channel: &mcap::Channel<'_>) -> (record::Channel, Option<record::Schema>) {
    let schema = channel.schema.as_ref().map(|schema| record::Schema {
        id: schema.id,
        name: schema.name.clone(),
        encoding: schema.encoding.clone(),
        data: schema.data.to_vec(),
    });
    let channel = record::Channel {
        id: channel.id,
        schema_id: schema.as_ref().map_or(0, |schema| schema.id),
        topic: channel.topic.clone(),
        message_encoding: channel.message_encoding.clone(),
        metadata: channel.metadata.clone(),
    };
    (channel, schema)
}

#[test]
fn every_message_decodes_to_the_numbers_of_an_independent_reader() {
    let Some(folder) = recordings() else { return };
    let highg = SecondaryConfig {
        name: "highg".into(),
        topic: Some("/highg/acceleration".into()),
        ..SecondaryConfig::default()
    };
    let config = ImuConfig { topic: "/imu/data_raw".into(), secondary: vec![highg], ..ImuConfig::default() };
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.to_string_lossy().ends_with(".ros2.mcap"));
    files.sort();

    let mut found = String::new();
    for path in files {
        let bytes = std::fs::read(&path).unwrap();
        let mut intake = Intake::new(std::slice::from_ref(&config));
        let mut sums: BTreeMap<String, (u64, crc32fast::Hasher)> = BTreeMap::new();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            let (channel, schema) = channel(&message.channel);
            intake.channel(&channel, schema.as_ref());
            intake.message(channel.id, message.log_time, &message.data, &mut |_, sensor, reading| {
                let Reading::Sample(sample) = reading else { panic!("{reading:?}") };
                assert_eq!(matches!(sensor, Sensor::Secondary(_)), channel.topic.starts_with("/highg"));
                let (count, crc) = sums.entry(channel.topic.clone()).or_default();
                *count += 1;
                crc.update(&sample.stamp.nanos().to_le_bytes());
                crc.update(&sample.log_time.to_le_bytes());
                sample.value.iter().for_each(|axis| crc.update(&axis.to_le_bytes()));
            });
        }
        assert_eq!(intake.faults(), []);
        let file = path.file_name().unwrap().to_string_lossy();
        for (topic, (count, crc)) in sums {
            writeln!(found, "{file} {topic} {count} {:08x}", crc.finalize()).unwrap();
        }
    }
    let expected = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/interop/decode_ros2.expected");
    assert_eq!(found, std::fs::read_to_string(expected).unwrap());
}

/// All samples of a recording, in its order.
fn samples(path: &std::path::Path) -> Vec<(Sensor, Sample)> {
    let bytes = std::fs::read(path).unwrap();
    let mut intake = Intake::new(&[]);
    let mut samples = Vec::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let (channel, schema) = channel(&message.channel);
        intake.channel(&channel, schema.as_ref());
        intake.message(channel.id, message.log_time, &message.data, &mut |_, sensor, reading| {
            let Reading::Sample(sample) = reading else { panic!("{reading:?}") };
            samples.push((sensor, sample));
        });
    }
    assert_eq!(intake.faults(), []);
    samples
}

#[test]
fn the_same_session_in_ros_1_and_ros_2_gives_the_same_samples() {
    let Some(folder) = recordings() else { return };
    let ros2 = samples(&folder.join("nilspod_six_face.ros2.mcap"));
    assert_eq!(ros2.len(), 2 * 10_376);
    assert_eq!(samples(&folder.join("nilspod_six_face.ros1.mcap")), ros2);
}

#[test]
fn recordings_of_ros_1_drives_are_read() {
    let Some(folder) = recordings() else { return };
    for (file, messages) in [("robot_localization_test1.mcap", 11_865), ("robot_localization_test2.mcap", 3_061)] {
        let samples = samples(&folder.join(file));
        assert_eq!(samples.len(), 2 * messages);
        let gravity = samples.iter().filter(|(sensor, _)| *sensor == Sensor::Accelerometer);
        let mean = gravity.map(|(_, sample)| sample.value.norm()).sum::<f64>() / messages as f64;
        assert!((9.0..11.0).contains(&mean), "{file}: {mean}");
    }
}
