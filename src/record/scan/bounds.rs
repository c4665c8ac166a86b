//! What is to be made of a record's length.

use super::search::Search;

/// How far ahead a record's end is looked for, in bytes (16 MiB).
pub(super) const REACH: u64 = 1 << 24;

/// What is to be made of a record's length.
pub(super) enum Bounds {
    /// It is right, as far as one can tell.
    Sound,
    /// It is wrong, but the next record begins here.
    Ends(u64),
    /// The next record must be searched for.
    Lost(Search),
}
