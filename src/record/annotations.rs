//! What is folded into a recording: topics and blocks of messages, without ids. Ids are given by whoever writes them,
//! since a sidecar counts from 1 and an annotated recording takes the lowest that are free.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::wire::{Fields, Put as _};

/// A topic that annotations are written to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Topic {
    /// Full name, as [`topic::of`](crate::topic::of) gives it.
    pub name: String,
    /// Type name of its messages; empty, with the two below, for messages without schema. What is the same as a schema
    /// of the recording is written with its id.
    pub schema_name: String,
    /// Language of the schema: `ros2msg` or `protobuf`, for instance.
    pub schema_encoding: String,
    /// The schema, in that language.
    pub schema: Vec<u8>,
    /// Encoding of the messages: `cdr` or `protobuf`, for instance.
    pub message_encoding: String,
    /// What is noted of the channel.
    pub metadata: BTreeMap<String, String>,
}

/// One annotation. Its publish time is its log time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Annotation {
    /// Index into the list of topics.
    pub topic: usize,
    /// Counts from 0 on each topic.
    pub sequence: u32,
    /// Log time of the sample that caused it.
    pub log_time: u64,
    /// The encoded message.
    pub data: Vec<u8>,
}

/// The annotations of one chunk (or, in a recording with messages outside chunks, of one run of loose messages).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Block {
    /// In the order of writing, never empty.
    pub annotations: Vec<Annotation>,
}

impl Block {
    /// Appends the block in a form that [`read`](Self::read) takes back, to be kept until all ids are known.
    pub fn write(&self, out: &mut Vec<u8>) {
        for annotation in &self.annotations {
            out.put_u32(annotation.topic as u32);
            out.put_u32(annotation.sequence);
            out.put_u64(annotation.log_time);
            out.put_blob(&annotation.data);
        }
    }

    /// The block that these bytes are; `None` if they are none.
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
