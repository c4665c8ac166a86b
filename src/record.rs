//! MCAP bytes: recordings in, recordings out. What the messages mean is left to [`imu`](crate::imu) and
//! [`annotate`](crate::annotate).

mod annotations;
mod chunk;
mod chunks;
mod emitter;
mod error;
mod fold;
mod horizon;
mod inventory;
mod own;
mod records;
mod reindex;
mod scan;
mod shape;
mod sidecar;
mod summary;
mod survey;
mod walk;
mod wire;

pub use annotations::{Annotation, Block, Topic};
pub use chunk::{Opened, Opener};
pub use chunks::{Chunk, Chunks};
pub use error::Error;
pub use fold::{Fold, Piece, Tail};
pub use inventory::Inventory;
pub use own::{Kind, Original, recognise, recognise_scanned};
pub use scan::{Damage, Event, Position, Scan, Supply};
pub use sidecar::{Sidecar, SidecarBlocks};
pub use walk::ReadAt;

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
