//! A regular file, opened without blocking: a name may belong to a FIFO without a writer, or to an endless device.

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::Path;

use rustix::fs::OFlags;

use crate::record::is_beginning;

/// Opens a file that the user names, following links.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    checked(options().open(path)?)
}

/// Opens the same for reading and writing.
pub(crate) fn open_to_change(path: &Path) -> io::Result<File> {
    checked(options().write(true).open(path)?)
}

/// Opens a file that Stillpoint wrote beside a recording. Refuses a link, and a file with further names (hard links).
pub(crate) fn open_own(path: &Path) -> io::Result<File> {
    own(OpenOptions::new().read(true), path)
}

/// Opens the same for reading and writing.
pub(crate) fn open_own_to_change(path: &Path) -> io::Result<File> {
    own(OpenOptions::new().read(true).write(true), path)
}

fn own(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    let flags = OFlags::NONBLOCK | OFlags::NOFOLLOW;
    let file = match options.custom_flags(flags.bits() as i32).open(path) {
        Err(_) if path.is_symlink() => return Err(foreign("is a link")),
        Err(_) if path.symlink_metadata().is_ok_and(|found| !found.is_file()) => {
            return Err(foreign("is not a regular file"));
        }
        opened => checked(opened?)?,
    };
    match file.metadata()?.nlink() {
        ..=1 => Ok(file),
        _ => Err(foreign("has further names (hard links)")),
    }
}

/// Whether a file of Stillpoint's stands there: one that begins like this, or is empty, as a kill may leave it. `None` if
/// nothing does.
///
/// # Errors
///
/// If the system does not show it, which says nothing about whose it is.
pub(crate) fn begins_with(path: &Path, start: &[u8]) -> io::Result<Option<bool>> {
    let file = match open_own(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) if is_foreign(&error) || error.kind() == io::ErrorKind::PermissionDenied => return Ok(Some(false)),
        opened => opened?,
    };
    let mut found = Vec::new();
    file.take(start.len() as u64).read_to_end(&mut found)?;
    Ok(Some(found.is_empty() || found == start))
}

/// Reads all of a small file; refuses one that is longer than `limit` bytes.
pub(crate) fn read(file: File, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("is longer than {limit} bytes")));
    }
    Ok(bytes)
}

/// Reads the text of a small file that the user names (configuration, calibration), of at most 64 MiB.
///
/// # Errors
///
/// If it is not a regular file, too long or not UTF-8, or the system refuses.
pub fn text(path: &Path) -> io::Result<String> {
    const LONGEST: u64 = 64 << 20;
    let bytes = read(open(path)?, LONGEST)?;
    String::from_utf8(bytes).map_err(|error| {
        let is_recording = is_beginning(error.as_bytes());
        let why = if is_recording { "it is a recording (MCAP), no text" } else { "it is no text (UTF-8)" };
        io::Error::new(io::ErrorKind::InvalidData, why)
    })
}

/// Whether the error says that a file in this place was not made by Stillpoint.
pub(crate) fn is_foreign(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::InvalidInput
}

fn options() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).custom_flags(OFlags::NONBLOCK.bits() as i32);
    options
}

fn checked(file: File) -> io::Result<File> {
    match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(foreign("is not a regular file")),
    }
}

fn foreign(why: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, why)
}
