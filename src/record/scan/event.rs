//! Events of a scan. [`Scan`](super::Scan) finds them.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::record::{Channel, Message, Schema};

/// Event of a [`Scan`](super::Scan).
#[derive(Debug)]
pub enum Event<'a> {
    /// At least `length` bytes are needed from byte `offset` of the recording on: [`insert`](super::Scan::insert) them.
    Read {
        /// Offset of the first byte.
        offset: u64,
        /// Least number of bytes.
        length: usize,
    },
    /// A chunk record begins here: answer with [`supply`](super::Scan::supply).
    Chunk {
        /// Offset of the record.
        offset: u64,
        /// Length of its body, in bytes.
        length: u64,
    },
    /// All whole records have been emitted. Continue after [`extend`](super::Scan::extend) or
    /// [`finish`](super::Scan::finish).
    Wait,
    /// The header of the recording.
    Header {
        /// Profile: the conventions that it follows, `ros2` for instance.
        profile: &'a str,
        /// Program that wrote the recording.
        library: &'a str,
    },
    /// A schema, at its first definition.
    Schema(&'a Schema),
    /// A channel, at its first definition; before its messages, unless only the summary defines it.
    Channel(&'a Channel),
    /// A message.
    Message(Message<'a>),
    /// End of the chunk whose messages were just emitted. A message outside chunks counts as a chunk.
    ChunkEnd,
    /// Damage. Whole records are emitted nevertheless.
    Damage(Damage),
    /// End of the recording.
    End,
}

/// Damage in a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Damage {
    /// Offset in the recording.
    pub offset: u64,
    /// Number of bytes from there on that are not used.
    pub length: u64,
    /// Description in words.
    pub what: String,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at byte {}: {}", self.offset, self.what)?;
        match self.length {
            0 => Ok(()),
            1 => f.write_str("; 1 byte is not used"),
            length => write!(f, "; {length} bytes are not used"),
        }
    }
}
