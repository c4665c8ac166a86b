//! The original out of an annotated recording, byte for byte.

use std::path::Path;

use super::output::{Output, Written};
use super::recording::{Recording, Watch};
use crate::Error;
use crate::record::Piece;

/// Large enough for the kernel, small enough to stop between two (64 MiB).
const COPY: u64 = 64 << 20;

/// Writes the bytes of a recording, wherever they stand, as a file of their own.
///
/// # Errors
///
/// If the recording cannot be read or the output cannot be written; nothing is left behind.
pub fn strip(
    recording: &Recording,
    output: &Path,
    force: bool,
    sync: bool,
    watch: Watch<'_>,
) -> Result<Written, Error> {
    let mut output = Output::open(output, force)?;
    let mut from = 0;
    while from < recording.length() {
        watch(from)?;
        let until = recording.length().min(from + COPY);
        output.put(&Piece::Original(from..until), recording)?;
        from = until;
    }
    output.finish(recording, sync)
}
