//! Every message of the real recordings is decoded to the numbers that programs that are not ours read; see
//! `tests/interop/decode_recordings.py`, which made the expected checksums and checks them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use stillpoint::imu::{Intake, Reading, Sample, Sensor};
use stillpoint::record;

use crate::needs::{data, root};

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

/// What the recordings are, where their types do not tell.
const MAPPED: &str = r#"
[[imu]]
topic = "/imu/data_raw"
[[imu.secondary]]
name = "highg"
topic = "/highg/acceleration"
[[imu]]
topic = "/sensors/imu"
accel = "accel_mps2"
gyro = "gyro_radps"
[[imu]]
topic = "/imu"
accel = "linear_acceleration"
gyro = "angular_velocity"
"#;

/// The recordings in a folder and those below it.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files.extend(self::files(&path)),
            false if path.extension().is_some_and(|extension| extension == "mcap") => files.push(path),
            false => {}
        }
    }
    files.sort();
    files
}

#[test]
fn every_message_decodes_to_the_numbers_of_independent_readers() {
    let Some(folder) = data("recordings") else { return };
    let config: stillpoint::config::Config = toml::from_str(MAPPED).unwrap();
    let mut found = String::new();
    for path in files(&folder) {
        let bytes = std::fs::read(&path).unwrap();
        let mut intake = Intake::new(&config.imu);
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
    let expected = root().join("tests/interop/decode_recordings.expected");
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
    let Some(folder) = data("recordings") else { return };
    let ros2 = samples(&folder.join("nilspod_six_face.ros2.mcap"));
    assert_eq!(ros2.len(), 2 * 10_376);
    assert_eq!(samples(&folder.join("nilspod_six_face.ros1.mcap")), ros2);
}

#[test]
fn recordings_of_ros_1_drives_are_read() {
    let Some(folder) = data("recordings") else { return };
    for (file, messages) in [("robot_localization_test1.mcap", 11_865), ("robot_localization_test2.mcap", 3_061)] {
        let samples = samples(&folder.join(file));
        assert_eq!(samples.len(), 2 * messages);
        let gravity = samples.iter().filter(|(sensor, _)| *sensor == Sensor::Accelerometer);
        let mean = gravity.map(|(_, sample)| sample.value.norm()).sum::<f64>() / messages as f64;
        assert!((9.0..11.0).contains(&mean), "{file}: {mean}");
    }
}
