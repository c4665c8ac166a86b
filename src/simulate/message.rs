//! Readings as messages, in each of the encodings, with their schemas. `write` gives them their topics.

mod content;
mod ros;
mod schema;
mod vendor;

pub(super) use self::content::{Body, Header};
pub(super) use self::schema::{Schema, Type};
use super::Encoding;

impl Encoding {
    /// Profile of recordings in this encoding.
    pub(super) fn profile(self) -> &'static str {
        match self {
            Self::Ros2 => "ros2",
            Self::Ros1 => "ros1",
            Self::Protobuf | Self::Json => "",
        }
    }

    /// Message encoding in channel records.
    pub(super) fn message_encoding(self) -> &'static str {
        match self {
            Self::Ros2 => "cdr",
            Self::Ros1 => "ros1",
            Self::Protobuf => "protobuf",
            Self::Json => "json",
        }
    }

    pub(super) fn schema(self, of: Type) -> Schema {
        match self {
            Self::Ros2 => ros::ros2_schema(of),
            Self::Ros1 => ros::ros1_schema(of),
            Self::Protobuf => vendor::protobuf_schema(of),
            Self::Json => vendor::json_schema(of),
        }
    }

    pub(super) fn encode(self, header: Header<'_>, body: Body) -> Vec<u8> {
        match self {
            Self::Ros2 => ros::ros2(header, body),
            Self::Ros1 => ros::ros1(header, body),
            Self::Protobuf => vendor::protobuf(header, body),
            Self::Json => vendor::json(header, body),
        }
    }
}
