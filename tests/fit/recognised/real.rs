//! Real recordings that determine no accelerometer by its faces, and what is said of them.

use std::path::Path;

use nalgebra::Vector3;
use stillpoint::config::{self, Layer};
use stillpoint::engine::{Config, Engine};
use stillpoint::imu::{Intake, Reading, Sample, Sensor};
use stillpoint::messages::triad::{Model, Status};
use stillpoint::record;

use super::learned::Learned;
use crate::common::needs::recording;

/// What an engine learns from the accelerometer and gyroscope of a recording's first IMU.
fn learn(path: &Path) -> Learned {
    learn_through(path, |_, value| value)
}

fn learn_through(path: &Path, change: impl Fn(Sensor, Vector3<f64>) -> Vector3<f64>) -> Learned {
    let mut engine = Engine::new(Config::default());
    let mut events = Vec::new();
    for (sensor, mut sample) in real_samples(path) {
        sample.value = change(sensor, sample.value);
        engine.push(sensor, &sample, &mut events);
    }
    engine.finish(&mut events);
    Learned::new(events)
}

/// What the first IMU of a recording read.
pub fn real_samples(path: &Path) -> Vec<(Sensor, Sample)> {
    let mut samples = Vec::new();
    let bytes = std::fs::read(path).unwrap();
    // The one recording of a type that is not known without configuration.
    let setting = r#"imu=[{topic="/sensors/imu", accel="accel_mps2", gyro="gyro_radps"}]"#;
    let unknown = path.to_string_lossy().ends_with("mpu9150_1_20_poses.protobuf.mcap");
    let layers: Vec<_> = unknown.then(|| Layer::set(setting).unwrap()).into_iter().collect();
    let mut intake = Intake::new(&config::Config::load(&layers).unwrap().imu);
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let schema = message.channel.schema.as_ref().map(|schema| record::Schema {
            id: schema.id,
            name: schema.name.clone(),
            encoding: schema.encoding.clone(),
            data: schema.data.to_vec(),
        });
        let channel = record::Channel {
            id: message.channel.id,
            schema_id: schema.as_ref().map_or(0, |schema| schema.id),
            topic: message.channel.topic.clone(),
            message_encoding: message.channel.message_encoding.clone(),
            metadata: message.channel.metadata.clone(),
        };
        intake.channel(&channel, schema.as_ref());
        intake.message(channel.id, message.log_time, &message.data, &mut |imu, sensor, reading| {
            if let (0, Reading::Sample(sample)) = (imu.index(), reading) {
                samples.push((sensor, sample));
            }
        });
    }
    samples
}

#[test]
fn real_recordings_that_show_no_six_faces_say_what_is_missing() {
    for (name, says) in [
        ("mpu6050_hand_held.ros2.mcap", &["still to see: +X, -X, +Y, -Y, -Z", "lying flat"][..]),
        ("robot_localization_test1.mcap", &["still to see: +X, -X, -Y, +Z, -Z"]),
        ("robot_localization_test2.mcap", &["still to see: +X, -X, +Y, -Y, -Z"]),
        ("mpu9150_0_19_poses.ros2.mcap", &["lying flat"]),
        ("mpu9150_1_20_poses.protobuf.mcap", &["lying flat"]),
    ] {
        let Some(path) = recording(name) else { return };
        let learned = learn(&path);
        for accelerometer in learned.calibrations().iter().filter_map(|c| c.accelerometer.as_ref()) {
            let determined = accelerometer.status() != Status::Undetermined;
            assert!(!determined || accelerometer.model() == Model::Triangular, "{name}: {accelerometer:#?}");
        }
        for words in says {
            assert!(learned.says(words), "{name}: no {words:?} in {:#?}", learned.said());
        }
    }
}

#[test]
fn nothing_is_suspected_of_real_sensors() {
    for name in [
        "nilspod_six_face.ros2.mcap",
        "nilspod_six_face.ros1.mcap",
        "xsens_38_poses.ros2.mcap",
        "mpu9150_0_19_poses.ros2.mcap",
        "mpu9150_1_20_poses.protobuf.mcap",
        "mpu6050_hand_held.ros2.mcap",
        "robot_localization_test1.mcap",
        "robot_localization_test2.mcap",
    ] {
        let Some(path) = recording(name) else { return };
        let learned = learn(&path);
        for words in
            ["flipped", "check that its axes", "deg/s", "relaxes", "never changes", "published twice", "beyond the"]
        {
            assert!(!learned.says(words), "{name}: {words:?} in {:#?}", learned.said());
        }
    }
}

#[test]
fn an_axis_that_is_flipped_in_a_real_session_is_named() {
    for axis in 0..3 {
        let Some(path) = recording("nilspod_six_face.ros2.mcap") else { return };
        let learned = learn_through(&path, |sensor, mut value| {
            if sensor == Sensor::Accelerometer {
                value[axis] = -value[axis];
            }
            value
        });
        let name = format!("accelerometer's {} axis is flipped", ["x", "y", "z"][axis]);
        assert!(learned.says(&name), "{name}: {:#?}", learned.said());
    }
}
