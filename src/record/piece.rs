//! Pieces of a file that is written: their bytes, or the place of their bytes.

use std::ops::Range;

/// A piece of an annotated recording or sidecar.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece {
    /// Byte range of the original.
    Original(Range<u64>),
    /// Literal bytes.
    Bytes(Vec<u8>),
    /// All chunk indexes that were taken, in order; their total length in bytes.
    Indexes(u64),
}
