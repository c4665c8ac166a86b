//! Extraction of the original from an annotated recording, byte for byte.

use std::path::Path;

use crate::Error;
use crate::record::Piece;
use crate::run::input::recording::{Recording, Watch};
use crate::run::input::rosbag2::METADATA;
use crate::run::input::splits::Input;
use crate::run::output::file::Output;
use crate::run::output::folder::Folder;
use crate::run::output::written::Written;

/// Bytes of one copy: large enough for the kernel, small enough to stop between two (64 MiB).
const COPY: u64 = 64 << 20;

/// Writes the bytes of a recording as a file or folder of their own.
///
/// # Errors
///
/// If the recording cannot be read or the output cannot be written; nothing is left behind.
pub fn strip(input: &Input, output: &Path, force: bool, sync: bool, watch: Watch<'_>) -> Result<Written, Error> {
    let Some(bag) = &input.bag else {
        let reads = input.reads();
        let copies = input.splits.iter().map(|split| copy(split, Output::open(output, force, &reads)?, sync, watch));
        return copies.last().unwrap_or(Ok(Written::Before));
    };
    let folder = Folder::open(output, force, input.reads())?;
    let mut done = 0;
    for (split, name) in input.splits.iter().zip(bag.names()) {
        copy(split, folder.output(name)?, sync, &|at| watch(done + at))?;
        done += split.length();
    }
    bag.blank().try_for_each(|name| folder.copy(bag, name, sync))?;
    bag.original().map_or(Ok(()), |text| folder.put(METADATA, text, sync))?;
    folder.finish(sync)
}

fn copy(recording: &Recording, mut output: Output, sync: bool, watch: Watch<'_>) -> Result<Written, Error> {
    let mut from = 0;
    while from < recording.length() {
        watch(from)?;
        let until = recording.length().min(from + COPY);
        output.put(&Piece::Original(from..until), recording)?;
        from = until;
    }
    output.finish(recording, sync)
}
