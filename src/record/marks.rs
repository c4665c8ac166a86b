//! Names of what an annotated recording holds beside the original and its annotations.

/// Name of the metadata record that says how annotations came about.
pub(super) const METADATA: &str = "stillpoint";
/// Its key for the length in bytes of what was copied from the original, in an annotated recording.
pub(super) const PREFIX: &str = "prefix";
/// Its key for the length of the message indexes behind the prefix that a recording which was cut off lacked.
pub(super) const COMPLETED: &str = "completed";
/// Its key for the length of what stands behind the metadata once more, since it is whole behind the prefix of a damaged
/// recording, with what else defines its channels.
pub(super) const RECOVERED: &str = "recovered";
/// Its key for where the last whole record of such a recording ends.
pub(super) const WHOLE: &str = "whole";
/// Name of the attachment that keeps what stands behind the prefix in the original.
pub(super) const TAIL: &str = "stillpoint.tail";
/// Name of the attachment that holds the message indexes of chunks behind which they are damaged.
pub(super) const INDEXES: &str = "stillpoint.indexes";
/// What our headers start with.
pub(super) const LIBRARY: &str = "stillpoint ";
