//! Schemas, channels and messages, as stored in a recording.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A schema record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Schema {
    /// Id in the recording, never 0.
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
    /// Id in the recording.
    pub id: u16,
    /// Id of its schema, 0 for a channel without schema.
    pub schema_id: u16,
    /// Topic, `/imu/data` for instance.
    pub topic: String,
    /// Encoding of its messages: `cdr`, `ros1`, `protobuf`, `json`, …
    pub message_encoding: String,
    /// Metadata that the recorder added.
    pub metadata: BTreeMap<String, String>,
}

/// A message, as stored in the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message<'a> {
    /// Id of its channel.
    pub channel: u16,
    /// Sequence number given by the publisher, 0 without one.
    pub sequence: u32,
    /// Time of recording, in nanoseconds.
    pub log_time: u64,
    /// Time of publishing, in nanoseconds.
    pub publish_time: u64,
    /// The encoded message.
    pub data: &'a [u8],
}
