//! An object under a prefix.

use std::path::PathBuf;

/// An object that a listing names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Listed {
    pub(crate) path: PathBuf,
    /// Length in bytes.
    pub(crate) length: u64,
    /// Version that tells it from another one of the same name.
    pub(crate) version: String,
    /// Time when the store got it, in milliseconds by the store's own clock. Of one that was sent in parts it may be the time
    /// of the first.
    pub(crate) modified_ms: i64,
}
