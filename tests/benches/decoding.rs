//! What one `sensor_msgs/Imu` costs: decoding alone, and from message to samples.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use stillpoint::imu::{Decoder, Intake, Layout};
use stillpoint::record::{Channel, Schema};

const IMU: &str = "std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
===
MSG: std_msgs/Header
SEQ
string frame_id
===
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

/// A channel of IMU messages, and one of them.
fn imu(ros1: bool) -> (Channel, Schema, Vec<u8>) {
    let (message_encoding, encoding, header) = match ros1 {
        true => ("ros1", "ros1msg", "uint32 seq\ntime stamp"),
        false => ("cdr", "ros2msg", "builtin_interfaces/Time stamp"),
    };
    let data = IMU.replace("SEQ", header).into_bytes();
    let schema = Schema { id: 1, name: "sensor_msgs/msg/Imu".into(), encoding: encoding.into(), data };
    let channel = Channel {
        id: 1,
        schema_id: 1,
        topic: "/imu/data".into(),
        message_encoding: message_encoding.into(),
        metadata: BTreeMap::new(),
    };
    let mut message: Vec<u8> = if ros1 { vec![0; 4] } else { vec![0, 1, 0, 0] };
    message.extend([1_700_000_000_u32.to_le_bytes(), 5_u32.to_le_bytes(), 8_u32.to_le_bytes()].concat());
    message.extend(b"imu_lin\0");
    message.resize(message.len().next_multiple_of(if ros1 { 1 } else { 8 }) + if ros1 { 0 } else { 4 }, 0);
    (0..37).for_each(|i| message.extend(f64::from(i).to_le_bytes()));
    (channel, schema, message)
}

fn decoding(c: &mut Criterion) {
    for (name, ros1) in [("cdr", false), ("ros1", true)] {
        let (channel, schema, message) = imu(ros1);
        let layout = Layout::new(&channel.message_encoding, Some(&schema)).unwrap();
        let paths = ["angular_velocity", "linear_acceleration"];
        let places: Vec<_> = paths.iter().flat_map(|path| layout.vector(&path.parse().unwrap()).unwrap()).collect();
        let decoder = Decoder::new(&layout, &places, None).unwrap();
        let mut numbers = [0.0; 6];
        c.bench_function(&format!("{name}/vectors"), |b| {
            b.iter(|| decoder.read(black_box(&message), &mut numbers).map(|text| text.len()).unwrap());
        });
        let mut intake = Intake::new(&[]);
        intake.channel(&channel, Some(&schema));
        c.bench_function(&format!("{name}/samples"), |b| {
            b.iter(|| {
                intake.message(1, 1, black_box(&message), &mut |id, sensor, sample| {
                    black_box((id, sensor, sample));
                })
            });
        });
    }
}

criterion_group!(benches, decoding);
criterion_main!(benches);
