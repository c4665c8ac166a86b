//! Schemas, channels and messages, as they stand in a recording.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A schema record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
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

/// A message as it stands in the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message<'a> {
    /// Id of its channel.
    pub channel: u16,
    /// The publisher's count, 0 if it keeps none.
    pub sequence: u32,
    /// When it was recorded, in nanoseconds.
    pub log_time: u64,
    /// When it was published, in nanoseconds.
    pub publish_time: u64,
    /// The encoded message.
    pub data: &'a [u8],
}
