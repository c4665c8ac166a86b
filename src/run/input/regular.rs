//! A regular file, opened without waiting: what stands under a name may be a FIFO that nobody writes, or a device without
//! an end. What is in the file is left to the caller.

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::Path;

use rustix::fs::OFlags;

/// Opens what a user names, wherever links lead.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    checked(options().open(path)?)
}

/// The same, to be read and changed.
pub(crate) fn open_to_change(path: &Path) -> io::Result<File> {
    checked(options().write(true).open(path)?)
}

/// Opens what Stillpoint wrote beside a recording. A link is none of it, nor is a file that has further names.
pub(crate) fn open_own(path: &Path) -> io::Result<File> {
    own(OpenOptions::new().read(true), path)
}

/// The same, to be read and changed.
pub(crate) fn open_own_to_change(path: &Path) -> io::Result<File> {
    own(OpenOptions::new().read(true).write(true), path)
}

fn own(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    let flags = OFlags::NONBLOCK | OFlags::NOFOLLOW;
    let file = match options.custom_flags(flags.bits() as i32).open(path) {
        Err(_) if path.is_symlink() => return Err(foreign("is a link")),
        opened => checked(opened?)?,
    };
    match file.metadata()?.nlink() {
        ..=1 => Ok(file),
        _ => Err(foreign("has further names (hard links)")),
    }
}

/// All of a small file, refused if it is longer than `limit` bytes.
pub(crate) fn read(file: File, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("is longer than {limit} bytes")));
    }
    Ok(bytes)
}

/// The text of a small file that a user names (configuration, calibration): of at most 64 MiB.
///
/// # Errors
///
/// If it is no regular file, longer, or no text, or the system refuses.
pub fn text(path: &Path) -> io::Result<String> {
    const LONGEST: u64 = 64 << 20;
    let bytes = read(open(path)?, LONGEST)?;
    String::from_utf8(bytes).map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is no text (UTF-8)"))
}

/// Whether a file is in the way that Stillpoint did not make.
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
