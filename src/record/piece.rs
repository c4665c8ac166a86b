//! A piece of a file that is written: bytes, or where they are.

use std::ops::Range;

/// A part of the annotated recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// These bytes of the original.
    Original(Range<u64>),
    /// These bytes.
    Bytes(Vec<u8>),
    /// All chunk indexes that were taken, one behind the other: so many bytes.
    Indexes(u64),
}
