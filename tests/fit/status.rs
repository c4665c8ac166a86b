//! Real sessions in which one rest is made wrong: it is named, or what is said allows for it.

use std::fs;

use nalgebra::Vector3;
use stillpoint::Stamp;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit;
use stillpoint::imu::{Sample, Sensor};
use stillpoint::messages::segment::Reason;
use stillpoint::messages::triad::Status;
use stillpoint::messages::{Segment, Triad};

use crate::common::needs::recording;

type Readings = Vec<(Sensor, Sample)>;

/// The readings of a recording of `sensor_msgs/Imu` in CDR, by the layout that ROS 2 lays down for it.
fn readings(name: &str) -> Option<Readings> {
    let bytes = fs::read(recording(name)?).unwrap();
    let mut readings = Vec::new();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let schema = message.channel.schema.as_ref();
        if schema.is_none_or(|schema| schema.name != "sensor_msgs/msg/Imu") {
            continue;
        }
        let data = &message.data[4..];
        let word = |at: usize| u32::from_le_bytes(data[at..at + 4].try_into().unwrap());
        let number = |at: usize| f64::from_le_bytes(data[at..at + 8].try_into().unwrap());
        let vector = |at: usize| Vector3::from_fn(|i, _| number(at + 8 * i));
        let stamp = Stamp::from_nanos(i64::from(word(0)) * 1_000_000_000 + i64::from(word(4)));
        let orientation = (12 + word(8) as usize).next_multiple_of(8);
        let rate = orientation + (4 + 9) * 8;
        let sample = |value| Sample { stamp, log_time: message.log_time, value };
        readings.push((Sensor::Gyroscope, sample(vector(rate))));
        readings.push((Sensor::Accelerometer, sample(vector(rate + (3 + 9) * 8))));
    }
    Some(readings)
}

/// The last verdict on each rest, in their order, and the accelerometer.
fn learn(readings: &Readings) -> (Vec<Segment>, Triad) {
    let fit = fit::Config { gravity: Some(9.80665), ..fit::Config::default() };
    let mut engine = Engine::new(Config { fit, ..Config::default() });
    let mut events = Vec::new();
    readings.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let mut rests: Vec<Segment> = Vec::new();
    let mut triad = Triad::default();
    for event in events {
        match event.message {
            Message::Segment(segment) => match rests.iter_mut().find(|known| known.start == segment.start) {
                Some(known) => *known = segment,
                None => rests.push(segment),
            },
            Message::Calibration(calibration) => triad = calibration.accelerometer.unwrap_or_default(),
            _ => {}
        }
    }
    (rests, triad)
}

fn nanos(stamp: &Option<prost_types::Timestamp>) -> i64 {
    stamp.as_ref().map_or(0, |stamp| stamp.seconds * 1_000_000_000 + i64::from(stamp.nanos))
}

fn vector(v: &Option<stillpoint::messages::Vector3>) -> Vector3<f64> {
    v.as_ref().map(|v| Vector3::new(v.x, v.y, v.z)).unwrap_or_default()
}

#[test]
fn a_real_rest_that_is_made_wrong_is_named_or_allowed_for() {
    let (mut named, mut allowed) = (0, 0);
    for name in ["nilspod_six_face.ros2.mcap", "xsens_38_poses.ros2.mcap", "mpu9150_0_19_poses.ros2.mcap"] {
        let Some(readings) = readings(name) else { return };
        let (rests, honest) = learn(&readings);
        for (i, rest) in rests.iter().enumerate().filter(|(_, rest)| rest.accepted) {
            let off = [0.1, -0.2, 0.3, -0.1, 0.2, -0.3][i % 6];
            let mean = rest.means.iter().find(|mean| mean.sensor == "accelerometer").unwrap();
            let up = vector(&mean.mean).normalize() * off;
            // Motion included that leads to it and away: a whole placement.
            let span = nanos(&rest.start) - 100_000_000..=nanos(&rest.end) + 100_000_000;
            let mut altered = readings.clone();
            for (sensor, sample) in &mut altered {
                if *sensor == Sensor::Accelerometer && span.contains(&sample.stamp.nanos()) {
                    sample.value += up;
                }
            }
            let (verdicts, triad) = learn(&altered);
            let start = nanos(&rest.start);
            let its = verdicts.iter().filter(|verdict| (nanos(&verdict.start) - start).abs() < 300_000_000);
            if its.clone().any(|verdict| verdict.reason() != Reason::Accepted) || triad.status() == Status::Undetermined
            {
                named += 1;
                continue;
            }
            // What the bars hold, or the worst case.
            let moved = vector(&triad.bias) - vector(&honest.bias);
            let bars = 1.96 * (vector(&triad.bias_std) + vector(&honest.bias_std));
            let within = (0..3).all(|axis| moved[axis].abs() <= bars[axis]);
            let held = moved.norm() <= triad.worst_case_error.unwrap_or(0.0);
            let provisional = triad.status() == Status::Provisional;
            assert!(within || provisional && held, "{name}, rest {i} {off:+}: {:?} {moved} {bars}", triad.status());
            allowed += 1;
        }
    }
    println!("{named} named, {allowed} allowed for");
    assert!(named > 0 && allowed > 0, "{named} named, {allowed} allowed for");
}
