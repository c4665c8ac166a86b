//! Messages of a fictitious vendor, in protobuf and JSON: `stamp`, `frame_id`, and the vectors `accel` and `gyro` of an
//! IMU or `accel` of a secondary accelerometer.

use nalgebra::Vector3;
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type as FieldType};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use serde::Serialize;

use super::content::{Body, Header};
use super::schema::{Schema, Type};
use crate::messages::DESCRIPTORS;

#[derive(prost::Message)]
struct Sample {
    #[prost(message, tag = "1")]
    stamp: Option<prost_types::Timestamp>,
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(message, tag = "3")]
    accel: Option<Vector>,
    #[prost(message, tag = "4")]
    gyro: Option<Vector>,
    #[prost(double, optional, tag = "5")]
    temperature: Option<f64>,
}

#[derive(Serialize, prost::Message)]
struct Vector {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

#[derive(Serialize)]
struct JsonSample<'a> {
    stamp: JsonTime,
    frame_id: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    accel: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gyro: Option<Vector>,
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature: Option<f64>,
}

#[derive(Serialize)]
struct JsonTime {
    sec: i64,
    nsec: i64,
}

pub(super) fn protobuf(header: Header<'_>, body: Body) -> Vec<u8> {
    let (accel, gyro) = vectors(body);
    let (stamp, frame_id) = (Some(header.stamp.into()), header.frame_id.to_owned());
    Sample { stamp, frame_id, accel, gyro, temperature: celsius(body) }.encode_to_vec()
}

pub(super) fn json(header: Header<'_>, body: Body) -> Vec<u8> {
    let nanos = header.stamp.nanos();
    let stamp = JsonTime { sec: nanos.div_euclid(1_000_000_000), nsec: nanos.rem_euclid(1_000_000_000) };
    let (accel, gyro) = vectors(body);
    let sample = JsonSample { stamp, frame_id: header.frame_id, accel, gyro, temperature: celsius(body) };
    serde_json::to_vec(&sample).unwrap_or_default()
}

/// Descriptor set of the message and of all its dependencies.
pub(super) fn protobuf_schema(of: Type) -> Schema {
    let known = FileDescriptorSet::decode(DESCRIPTORS).unwrap_or_default();
    let mut file: Vec<_> = known.file.into_iter().filter(|file| file.name() == TIMESTAMP).collect();
    file.push(descriptor(of));
    let name = match of {
        Type::Imu | Type::WarmImu => "vendor.ImuSample",
        Type::Vector => "vendor.AccelSample",
        Type::Temperature => "vendor.TemperatureSample",
    };
    Schema { name, encoding: "protobuf", data: FileDescriptorSet { file }.encode_to_vec() }
}

pub(super) fn json_schema(of: Type) -> Schema {
    let vector = serde_json::json!({
        "type": "object",
        "properties": {"x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}},
    });
    let time = serde_json::json!({
        "type": "object",
        "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
    });
    let mut properties = serde_json::json!({"stamp": time, "frame_id": {"type": "string"}});
    if of != Type::Temperature {
        properties["accel"] = vector.clone();
    }
    if matches!(of, Type::Temperature | Type::WarmImu) {
        properties["temperature"] = serde_json::json!({"type": "number"});
    }
    let name = match of {
        Type::Imu | Type::WarmImu => {
            properties["gyro"] = vector;
            "ImuSample"
        }
        Type::Vector => "AccelSample",
        Type::Temperature => "TemperatureSample",
    };
    let schema = serde_json::json!({"title": name, "type": "object", "properties": properties});
    Schema { name, encoding: "jsonschema", data: schema.to_string().into_bytes() }
}

const TIMESTAMP: &str = "google/protobuf/timestamp.proto";

/// Descriptor of the vendor's `.proto` file, with a temperature where this type has one.
fn descriptor(of: Type) -> FileDescriptorProto {
    let message = |name: &str, fields: Vec<FieldDescriptorProto>| DescriptorProto {
        name: Some(name.to_owned()),
        field: fields,
        ..DescriptorProto::default()
    };
    let stamped = || {
        vec![
            field("stamp", 1, FieldType::Message, Some(".google.protobuf.Timestamp")),
            field("frame_id", 2, FieldType::String, None),
            field("accel", 3, FieldType::Message, Some(".vendor.Vector3")),
        ]
    };
    let mut imu = stamped();
    imu.push(field("gyro", 4, FieldType::Message, Some(".vendor.Vector3")));
    let temperature = || field("temperature", 5, FieldType::Double, None);
    imu.extend((of == Type::WarmImu).then(temperature));
    let warmth = (of == Type::Temperature).then(|| {
        let stamped = stamped().into_iter().take(2).chain([temperature()]);
        message("TemperatureSample", stamped.collect())
    });
    let axes = ["x", "y", "z"].into_iter().zip(1..).map(|(axis, number)| field(axis, number, FieldType::Double, None));
    FileDescriptorProto {
        name: Some("vendor/imu.proto".to_owned()),
        package: Some("vendor".to_owned()),
        dependency: vec![TIMESTAMP.to_owned()],
        message_type: [
            message("Vector3", axes.collect()),
            message("ImuSample", imu),
            message("AccelSample", stamped()),
        ]
        .into_iter()
        .chain(warmth)
        .collect(),
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    }
}

fn field(name: &str, number: i32, kind: FieldType, type_name: Option<&str>) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(kind.into()),
        type_name: type_name.map(str::to_owned),
        json_name: Some(name.to_owned()),
        ..FieldDescriptorProto::default()
    }
}

fn vectors(body: Body) -> (Option<Vector>, Option<Vector>) {
    let vector = |value: Vector3<f64>| Vector { x: value.x, y: value.y, z: value.z };
    match body {
        Body::Imu { accel, gyro, .. } => (accel.map(vector), gyro.map(vector)),
        Body::Vector(accel) => (Some(vector(accel)), None),
        Body::Temperature(_) => (None, None),
    }
}

fn celsius(body: Body) -> Option<f64> {
    match body {
        Body::Imu { celsius, .. } => celsius,
        Body::Temperature(celsius) => Some(celsius),
        Body::Vector(_) => None,
    }
}
