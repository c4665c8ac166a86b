//! Names of the records that an annotated recording holds beside the original and its annotations.

/// Name of the metadata record that says how the annotations were made.
pub(super) const METADATA: &str = "stillpoint";
/// Its key for the length in bytes of the prefix copied from the original, in an annotated recording.
pub(super) const PREFIX: &str = "prefix";
/// Its key for the length in bytes of message indexes after the prefix that the original, which was cut off, lacked.
pub(super) const COMPLETED: &str = "completed";
/// Its key for the length in bytes of what follows the metadata of a damaged recording: definitions that only the
/// summary had, and copies of the whole records after the prefix.
pub(super) const RECOVERED: &str = "recovered";
/// Its key for the offset at which the last whole record of a damaged recording ends.
pub(super) const WHOLE: &str = "whole";
/// Name of the attachment that keeps the bytes after the prefix of the original.
pub(super) const TAIL: &str = "stillpoint.tail";
/// Name of the attachment that holds new message indexes of chunks whose own are damaged or missing.
pub(super) const INDEXES: &str = "stillpoint.indexes";
/// First bytes of the library name in our headers.
pub(super) const LIBRARY: &str = "stillpoint ";
