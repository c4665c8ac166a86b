//! Verdict on a record's length.

use super::search::Search;

/// Verdict on a record's length.
pub(super) enum Bounds {
    /// Right, as far as one can tell.
    Sound,
    /// Wrong, but the next record begins at this offset.
    Ends(u64),
    /// Wrong, and the next record must be searched for.
    Lost(Search),
}
