//! The two encodings of annotations, both derived from one descriptor set. The ROS 2 message types are in
//! [`ros2`](super::ros2).

use std::collections::BTreeMap;
use std::sync::LazyLock;

use prost::{Message as _, Name};
use prost_reflect::{DescriptorPool, DynamicMessage, FileDescriptor, MessageDescriptor};
use prost_types::FileDescriptorSet;
use serde::{Deserialize, Serialize};

use super::{log, ros2, ros2msg};
use crate::engine::Message;
use crate::messages::DESCRIPTORS;
use crate::record::Topic;

/// Encoding of annotations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Encoding {
    /// CDR with `ros2msg` schemas, types `stillpoint_msgs/msg/…`.
    Ros2,
    /// Protobuf with descriptor sets, types `stillpoint.…`.
    Protobuf,
}

impl Encoding {
    /// Topic with this name for messages of this kind.
    pub(super) fn topic(self, name: String, message: &Message) -> Topic {
        let (schema_name, schema) = match (self, message) {
            (Self::Protobuf, _) => protobuf_schema(&encoded(message).descriptor),
            (Self::Ros2, Message::Log(_)) => (log::SCHEMA_NAME.to_owned(), log::SCHEMA.into()),
            (Self::Ros2, _) => ros2_schema(&encoded(message).descriptor),
        };
        let (schema_encoding, message_encoding) = match self {
            Self::Protobuf => ("protobuf", "protobuf"),
            Self::Ros2 => ("ros2msg", "cdr"),
        };
        Topic {
            name,
            schema_name,
            schema_encoding: schema_encoding.into(),
            schema,
            message_encoding: message_encoding.into(),
            metadata: BTreeMap::new(),
        }
    }

    /// Encodes a message.
    pub(super) fn encode(self, message: &Message) -> Vec<u8> {
        match (self, message) {
            (Self::Protobuf, _) => encoded(message).bytes,
            (Self::Ros2, Message::Log(log)) => log::encode(log),
            (Self::Ros2, _) => ros2::encode(&encoded(message).reflect()),
        }
    }
}

fn protobuf_schema(message: &MessageDescriptor) -> (String, Vec<u8>) {
    let mut set = FileDescriptorSet::default();
    add_with_dependencies(&message.parent_file(), &mut set);
    (message.full_name().to_owned(), set.encode_to_vec())
}

/// Adds a file after its dependencies, since some readers build their pool in one pass.
fn add_with_dependencies(file: &FileDescriptor, set: &mut FileDescriptorSet) {
    if set.file.iter().any(|known| known.name() == file.name()) {
        return;
    }
    for dependency in file.dependencies() {
        add_with_dependencies(&dependency, set);
    }
    set.file.push(file.file_descriptor_proto().clone());
}

fn ros2_schema(message: &MessageDescriptor) -> (String, Vec<u8>) {
    (ros2::Type::of(message).schema_name(), ros2msg::schema(message).into_bytes())
}

/// A message in protobuf, with its descriptor.
struct Encoded {
    descriptor: MessageDescriptor,
    bytes: Vec<u8>,
}

fn encoded(message: &Message) -> Encoded {
    match message {
        Message::Stillness(message) => Encoded::of(message),
        Message::Segment(message) => Encoded::of(message),
        Message::Turn(message) => Encoded::of(message),
        Message::Noise(message) => Encoded::of(message),
        Message::Coverage(message) => Encoded::of(message),
        Message::Calibration(message) => Encoded::of(message.as_ref()),
        Message::Log(message) => Encoded::of(message),
    }
}

impl Encoded {
    fn of<M: prost::Message + Name>(message: &M) -> Self {
        Self { descriptor: descriptor::<M>(), bytes: message.encode_to_vec() }
    }

    fn reflect(self) -> DynamicMessage {
        #[expect(clippy::expect_used, reason = "the types are generated from these descriptors")]
        DynamicMessage::decode(self.descriptor, self.bytes.as_slice()).expect("a message fits its own descriptor")
    }
}

/// Descriptor of a message type.
pub(super) fn descriptor<M: Name>() -> MessageDescriptor {
    #[expect(clippy::expect_used, reason = "a constant, checked by tests/schemas.rs")]
    static POOL: LazyLock<DescriptorPool> =
        LazyLock::new(|| DescriptorPool::decode(DESCRIPTORS).expect("the embedded descriptor set is whole"));
    #[expect(clippy::expect_used, reason = "the types are generated from these descriptors")]
    POOL.get_message_by_name(&M::full_name()).expect("every generated type is in the descriptor set")
}
