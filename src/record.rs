//! MCAP bytes: recordings in, recordings out. What the messages mean is left to [`imu`](crate::imu) and
//! [`annotate`](crate::annotate).

mod annotations;

pub use annotations::{Annotation, Block, Topic};

use std::collections::BTreeMap;

/// A schema record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Its id in the recording, never 0.
    pub id: u16,
    /// Type name, `sensor_msgs/msg/Imu` for instance.
    pub name: String,
    /// Schema language: `ros2msg`, `protobuf`, `jsonschema`, …
    pub encoding: String,
    /// The schema itself, in that language.
    pub data: Vec<u8>,
}

/// A channel record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its id in the recording.
    pub id: u16,
    /// 0 for a channel without schema.
    pub schema_id: u16,
    /// What it is about, `/imu/data` for instance.
    pub topic: String,
    /// Encoding of its messages: `cdr`, `ros1`, `protobuf`, `json`, …
    pub message_encoding: String,
    /// Whatever the recorder noted.
    pub metadata: BTreeMap<String, String>,
}
