//! What one `sensor_msgs/Imu`, or a message like it in protobuf and JSON, costs: decoding alone, and from message to
//! samples. To stay under 40 ns in CDR and ROS 1, and under 150 ns in protobuf.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use prost::Message as _;
use stillpoint::imu::{Decoder, ImuConfig, Intake, Layout};
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

const PROTO: &str = r#"syntax = "proto3";
package bench;
message Time { int64 seconds = 1; int32 nanos = 2; }
message Header { Time stamp = 1; string frame_id = 2; }
message Vector3 { double x = 1; double y = 2; double z = 3; }
message Quaternion { double x = 1; double y = 2; double z = 3; double w = 4; }
message Imu {
  Header header = 1;
  Quaternion orientation = 2;
  repeated double orientation_covariance = 3;
  Vector3 angular_velocity = 4;
  repeated double angular_velocity_covariance = 5;
  Vector3 linear_acceleration = 6;
  repeated double linear_acceleration_covariance = 7;
}
"#;

const JSON: &str = r#"{"header": {"stamp": {"seconds": 1700000000, "nanos": 5}, "frame_id": "imu_link"},
    "orientation": {"x": 0.1, "y": 0.2, "z": 0.3, "w": 0.4}, "orientation_covariance": [1, 2, 3, 4, 5, 6, 7, 8, 9],
    "angular_velocity": {"x": -0.0106526444, "y": -0.00532632218, "z": 0.00106526444},
    "angular_velocity_covariance": [1, 2, 3, 4, 5, 6, 7, 8, 9],
    "linear_acceleration": {"x": 10.3321143, "y": -0.579594727, "z": 0.517324219},
    "linear_acceleration_covariance": [1, 2, 3, 4, 5, 6, 7, 8, 9]}"#;

/// A channel of IMU messages, and one of them.
fn ros(ros1: bool) -> (Channel, Schema, Vec<u8>) {
    let (message_encoding, encoding, header) = match ros1 {
        true => ("ros1", "ros1msg", "uint32 seq\ntime stamp"),
        false => ("cdr", "ros2msg", "builtin_interfaces/Time stamp"),
    };
    let data = IMU.replace("SEQ", header).into_bytes();
    let mut message: Vec<u8> = if ros1 { vec![0; 4] } else { vec![0, 1, 0, 0] };
    message.extend([1_700_000_000_u32.to_le_bytes(), 5_u32.to_le_bytes(), 8_u32.to_le_bytes()].concat());
    message.extend(b"imu_lin\0");
    message.resize(message.len().next_multiple_of(if ros1 { 1 } else { 8 }) + if ros1 { 0 } else { 4 }, 0);
    (0..37).for_each(|i| message.extend(f64::from(i).to_le_bytes()));
    described(message_encoding, "sensor_msgs/msg/Imu", encoding, data, message)
}

#[derive(prost::Message)]
struct Time {
    #[prost(int64, tag = "1")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    nanos: i32,
}

#[derive(prost::Message)]
struct Header {
    #[prost(message, tag = "1")]
    stamp: Option<Time>,
    #[prost(string, tag = "2")]
    frame_id: String,
}

#[derive(prost::Message)]
struct Vector {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
    /// Of a quaternion.
    #[prost(double, tag = "4")]
    w: f64,
}

#[derive(prost::Message)]
struct Imu {
    #[prost(message, tag = "1")]
    header: Option<Header>,
    #[prost(message, repeated, tag = "2")]
    vectors: Vec<Vector>,
    #[prost(double, repeated, tag = "3")]
    orientation_covariance: Vec<f64>,
    #[prost(message, tag = "4")]
    angular_velocity: Option<Vector>,
    #[prost(double, repeated, tag = "5")]
    angular_velocity_covariance: Vec<f64>,
    #[prost(message, tag = "6")]
    linear_acceleration: Option<Vector>,
    #[prost(double, repeated, tag = "7")]
    linear_acceleration_covariance: Vec<f64>,
}

/// The same fields in protobuf.
fn protobuf() -> (Channel, Schema, Vec<u8>) {
    struct Source;
    impl protox::file::FileResolver for Source {
        fn open_file(&self, name: &str) -> Result<protox::file::File, protox::Error> {
            protox::file::File::from_source(name, PROTO)
        }
    }
    let mut compiler = protox::Compiler::with_file_resolver(Source);
    let data = compiler.open_file("bench.proto").unwrap().file_descriptor_set().encode_to_vec();
    let vector = |w| Vector { x: 0.1, y: 0.2, z: 9.8, w };
    let covariance = || (0..9).map(f64::from).collect();
    let message = Imu {
        header: Some(Header { stamp: Some(Time { seconds: 1_700_000_000, nanos: 5 }), frame_id: "imu_link".into() }),
        vectors: vec![vector(1.0)],
        orientation_covariance: covariance(),
        angular_velocity: Some(vector(0.0)),
        angular_velocity_covariance: covariance(),
        linear_acceleration: Some(vector(0.0)),
        linear_acceleration_covariance: covariance(),
    };
    described("protobuf", "bench.Imu", "protobuf", data, message.encode_to_vec())
}

fn described(
    message_encoding: &str,
    name: &str,
    encoding: &str,
    data: Vec<u8>,
    message: Vec<u8>,
) -> (Channel, Schema, Vec<u8>) {
    let schema = Schema { id: 1, name: name.into(), encoding: encoding.into(), data };
    let (topic, message_encoding) = ("/imu/data".to_owned(), message_encoding.to_owned());
    (Channel { id: 1, schema_id: 1, topic, message_encoding, metadata: BTreeMap::new() }, schema, message)
}

fn json() -> (Channel, Schema, Vec<u8>) {
    let number = r#"{"type": "number"}"#;
    let vector = format!(r#"{{"properties": {{"x": {number}, "y": {number}, "z": {number}}}}}"#);
    let schema = format!(r#"{{"properties": {{"angular_velocity": {vector}, "linear_acceleration": {vector}}}}}"#);
    described("json", "Imu", "jsonschema", schema.into_bytes(), JSON.as_bytes().to_vec())
}

fn decoding(c: &mut Criterion) {
    for (name, (channel, schema, message)) in
        [("cdr", ros(false)), ("ros1", ros(true)), ("protobuf", protobuf()), ("json", json())]
    {
        let layout = Layout::new(&channel.message_encoding, Some(&schema)).unwrap();
        let paths = ["angular_velocity", "linear_acceleration"].map(|path| path.parse().unwrap());
        let places: Vec<_> = paths.iter().flat_map(|path| layout.vector(path).unwrap()).collect();
        let decoder = Decoder::new(&layout, &places, None).unwrap();
        let mut numbers = [0.0; 6];
        c.bench_function(&format!("{name}/vectors"), |b| {
            b.iter(|| decoder.read(black_box(&message), &mut numbers).map(|text| text.len()).unwrap());
        });
        let imu: ImuConfig =
            toml::from_str("topic = '/imu/data'\naccel = 'linear_acceleration'\ngyro = 'angular_velocity'").unwrap();
        let mut intake = Intake::new(&[imu]);
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
