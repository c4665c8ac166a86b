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
}
