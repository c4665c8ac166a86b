//! Answers to the offer of a chunk.

use crate::record::chunk::Opened;

/// Answer to the offer of a chunk, see [`offering_chunks`](super::Scan::offering_chunks).
#[derive(Debug)]
pub enum Supply {
    /// The chunk has been opened.
    Opened(Opened),
    /// Its messages are not needed: it is not read, and its content is taken from the message indexes that follow it, or
    /// from the chunk index where that is [known](super::Scan::knowing).
    Unread,
    /// The scan shall read it itself.
    Absent,
}

impl Supply {
    pub(super) fn into_opened(self) -> Option<Opened> {
        match self {
            Self::Opened(opened) => Some(opened),
            Self::Unread | Self::Absent => None,
        }
    }
}
