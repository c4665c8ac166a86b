//! What a scan tells. Finding it is left to [`Scan`](super::Scan).

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::record::{Channel, Message, Schema};

/// What a [`Scan`](super::Scan) has to tell.
#[derive(Debug)]
pub enum Event<'a> {
    /// At least `length` bytes are needed from byte `offset` of the recording on: [`insert`](super::Scan::insert) them.
    Read {
        /// Where they stand.
        offset: u64,
        /// How many are needed at least.
        length: usize,
    },
    /// A chunk record begins here: say what becomes of it with [`supply`](super::Scan::supply).
    Chunk {
        /// Where it stands.
        offset: u64,
        /// Length of its body.
        length: u64,
    },
    /// Everything whole has been told. Go on after [`extend`](super::Scan::extend)
    /// or [`finish`](super::Scan::finish).
    Wait,
    /// The header of the recording.
    Header {
        /// Conventions that it follows, `ros2` for instance.
        profile: &'a str,
        /// The program that wrote it.
        library: &'a str,
    },
    /// A schema, the first time.
    Schema(&'a Schema),
    /// A channel, the first time; before its messages, except for those that only the summary knows.
    Channel(&'a Channel),
    /// A message.
    Message(Message<'a>),
    /// The chunk of the messages just told has ended. A message outside a chunk counts as one.
    ChunkEnd,
    /// Something is not as it should be. What is whole is told all the same.
    Damage(Damage),
    /// Nothing follows.
    End,
}

/// Something that is wrong with a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Damage {
    /// Byte in the recording.
    pub offset: u64,
    /// So many bytes from there on are not used.
    pub length: u64,
    /// What was found there, in words.
    pub what: String,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at byte {}: {}", self.offset, self.what)?;
        match self.length {
            0 => Ok(()),
            length => write!(f, "; {length} bytes are not used"),
        }
    }
}
