//! Annotations to be folded into a recording: topics and blocks of messages, without ids. The writer assigns the ids,
//! since a sidecar counts from 1 and an annotated recording uses the lowest free ones.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::wire::{Fields, Put as _};

/// A topic that annotations are written to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topic {
    /// Full name, as [`topic::of`](crate::topic::of) gives it.
    pub name: String,
    /// Type name of its messages. Empty for messages without schema, as are the two fields below. A schema that the
    /// recording already has is written with that schema's id.
    pub schema_name: String,
    /// Language of the schema: `ros2msg` or `protobuf`, for instance.
    pub schema_encoding: String,
    /// The schema, in that language.
    pub schema: Vec<u8>,
    /// Encoding of the messages: `cdr` or `protobuf`, for instance.
    pub message_encoding: String,
    /// Metadata of the channel.
    pub metadata: BTreeMap<String, String>,
}

/// One annotation. Its publish time is its log time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Annotation {
    /// Index into the list of topics.
    pub topic: usize,
    /// Number of the message on its topic, from 0.
    pub sequence: u32,
    /// Log time of the sample that caused it.
    pub log_time: u64,
    /// The encoded message.
    pub data: Vec<u8>,
}

/// The annotations of one chunk (or, in a recording with messages outside chunks, of one run of loose messages).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// Annotations in the order of writing, never empty.
    pub annotations: Vec<Annotation>,
}

impl Block {
    /// Appends the block in the form that [`read`](Self::read) parses, to be kept until all ids are known.
    pub fn write(&self, out: &mut Vec<u8>) {
        for annotation in &self.annotations {
            out.put_u32(annotation.topic as u32);
            out.put_u32(annotation.sequence);
            out.put_u64(annotation.log_time);
            out.put_blob(&annotation.data);
        }
    }

    /// Parses the bytes that [`write`](Self::write) appended; `None` if they are malformed.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let mut fields = Fields(bytes);
        let mut annotations = Vec::new();
        while !fields.0.is_empty() {
            annotations.push(Annotation {
                topic: fields.u32()? as usize,
                sequence: fields.u32()?,
                log_time: fields.u64()?,
                data: fields.blob()?.to_vec(),
            });
        }
        Some(Self { annotations })
    }
}
