//! Replacing the end of a file so that no crash loses it, and repairing a file on which a run was killed meanwhile. The
//! caller stages all new bytes before the file is touched.
//!
//! # Protocol
//!
//! The beginning of the file stays; the bytes from offset `from` on are replaced. `FILE.stillpoint-backup` exists
//! beside `FILE` from before the first changed byte until after the last one is on the device:
//!
//! 1. The backup (identity of the file, offset of the change, old length, old bytes from there on, checksums) is
//!    written without a name, synced, named, and its folder synced. From here on, the old file can be restored.
//! 2. The new bytes are written over the old ones, the length is set, the file is synced.
//! 3. The backup is removed: **the commit**. Its folder is synced, so that it does not come back after a power failure.
//!
//! A backup without a process at work means that a run died between 1 and 3. A reader reports this and changes nothing;
//! opening the file to change it undoes the change first. The undoing can be killed at any time, too, since it only
//! writes what the backup holds. An error within step 2, typically a full disk, is undone in the same way at once: the
//! old bytes need no more room than the file had.
//!
//! Anybody may put a file of that name beside a recording. A backup counts only if it is a regular file with this
//! single name, owned by root, by us or by the owner of the recording, and names the recording's own inode and the
//! checksum of the bytes in front of the change; the change never begins before the first record. Any other file is
//! left alone: reading ignores it, and changing is refused, since its name is needed.
//!
//! `flock` tells who is at work; the system releases it when a process dies: one process may change the file, or any
//! number may read it. The file keeps its inode, so that owner, mode and extended attributes stay. A file with further
//! names (hard links) is refused, since a repair could not be found from them.

use std::fs::{File, TryLockError};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

use mcap::MAGIC as MCAP;

use crate::Error;
use crate::run::input::regular;
use crate::run::output::partial::{Partial, sync_folder};

/// First bytes of a backup; another layout gets another number.
const MAGIC: &[u8; 16] = b"stillpointback02";
/// Length of the head in bytes: magic, inode, offset of the change, old length, three checksums.
const HEAD: usize = 16 + 8 + 8 + 8 + 4 + 4 + 4;
/// Bytes in front of the change that the checksum covers, at either end (64 KiB).
const PRECEDING: u64 = 1 << 16;
const BLOCK: usize = 1 << 20;

/// Purpose that a file is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reading; others may read it, too.
    Read,
    /// Changing; nobody else may open it.
    Change,
}

/// Opens a file and locks it until it is closed. Opening it to change undoes what a killed run left half done.
///
/// # Errors
///
/// If it is not a regular file, the system refuses, another process is at work on it, it is opened to read and a killed
/// run left it half changed, or it cannot be repaired.
pub(crate) fn open(path: &Path, access: Access) -> Result<File, Error> {
    match access {
        Access::Read => {
            let file = regular::open(path).map_err(|error| unreadable(path, error))?;
            // Without lock support, nobody changes a file in place either.
            if let Err(TryLockError::WouldBlock) = file.try_lock_shared() {
                return Err(Error::Busy(path.to_owned()));
            }
            match Backup::find(&file, path)? {
                None => {}
                Some(Ok(_)) => {
                    let why = "a run was killed while it changed this file; `stillpoint repair` takes the change back, \
                               `stillpoint annotate --in-place` does it anew";
                    return Err(Error::input(path, why));
                }
                Some(Err(why)) => tracing::warn!("{why}; it is left alone"),
            }
            Ok(file)
        }
        Access::Change => {
            let file = lock(path)?;
            repair(&file, path)?;
            Ok(file)
        }
    }
}

/// Undoes what a killed run left half done. Returns whether there was anything.
///
/// # Errors
///
/// As `open` for [`Access::Change`].
pub fn take_back(path: &Path) -> Result<bool, Error> {
    repair(&lock(path)?, path)
}

/// Opens a file to change it and locks out everybody else.
fn lock(path: &Path) -> Result<File, Error> {
    let refused = |e| Error::io("change", path)(e);
    let file = regular::open_to_change(path).map_err(|error| match regular::is_foreign(&error) {
        true => unreadable(path, error),
        false => refused(error),
    })?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(Error::Busy(path.to_owned())),
        Err(TryLockError::Error(error)) => Err(refused(error)),
    }
}

fn repair(file: &File, path: &Path) -> Result<bool, Error> {
    let Some(backup) = Backup::find(file, path)? else { return Ok(false) };
    let backup = backup.map_err(|why| Error::input(path, format!("{why}: move one of them elsewhere")))?;
    backup.restore(file).map_err(Error::io("change", path))?;
    tracing::warn!("{}: a run was killed while it changed this file; the change was taken back", path.display());
    Ok(true)
}

fn unreadable(path: &Path, error: io::Error) -> Error {
    match regular::is_foreign(&error) {
        true => Error::input(path, format!("{error}; save it as one first")),
        false => Error::io("read", path)(error),
    }
}

/// Refuses a file that would change under further names, too.
///
/// # Errors
///
/// If it has such names, or the system does not tell.
pub(crate) fn check(file: &File, path: &Path) -> Result<(), Error> {
    let why = "has further names (hard links), under which it would change as well; use -o instead of --in-place";
    match file.metadata().map_err(Error::io("change", path))?.nlink() {
        ..=1 => Ok(()),
        _ => Err(Error::input(path, why)),
    }
}

/// Replaces the bytes from offset `from` on, in a file that was opened for [`Access::Change`].
///
/// # Errors
///
/// If the system refuses; the file is then as before, or will be when it is opened next.
pub(crate) fn replace_end(file: &File, path: &Path, from: u64, staged: &File) -> Result<(), Error> {
    let refused = |e| Error::io("change", path)(e);
    check(file, path)?;
    if from < MCAP.len() as u64 {
        return Err(Error::input(path, "would change from its first byte on, which nothing could take back"));
    }
    let metadata = file.metadata().map_err(refused)?;
    let Some(beside) = backup_of(path) else { return Err(refused(io::ErrorKind::NotFound.into())) };
    let backup = Backup::write(&beside, file, from..metadata.len())?;
    let changed = write_end(file, from, staged).and_then(|()| std::fs::remove_file(&beside));
    if let Err(error) = changed {
        return Err(match backup.restore(file) {
            Ok(()) => refused(error),
            Err(_) => {
                let name = beside.display();
                Error::input(
                    path,
                    format!("changed by half ({error}); {name} keeps the rest: run stillpoint on it again"),
                )
            }
        });
    }
    sync_folder(&beside).map_err(refused)
}

fn write_end(mut file: &File, from: u64, mut staged: &File) -> io::Result<()> {
    staged.rewind()?;
    file.seek(SeekFrom::Start(from))?;
    let length = io::copy(&mut staged, &mut file)?;
    file.set_len(from + length)?;
    file.sync_all()
}

/// Path of a file's backup: beside the file itself, with links resolved.
fn backup_of(path: &Path) -> Option<PathBuf> {
    let path = path.canonicalize().ok()?;
    let mut name = path.file_name()?.to_owned();
    name.push(".stillpoint-backup");
    Some(path.with_file_name(name))
}

/// The old end of a file, saved in a file of its own.
struct Backup {
    path: PathBuf,
    file: File,
    /// Range of the old bytes in the file.
    range: Range<u64>,
}

impl Backup {
    /// Saves a range that ends at the end of the file.
    fn write(path: &Path, file: &File, range: Range<u64>) -> Result<Self, Error> {
        let refused = |e| Error::io("write", path)(e);
        let partial = Partial::create_new(path)?;
        let mut out = partial.file();
        let mut write = || {
            let mut head = MAGIC.to_vec();
            head.extend(file.metadata()?.ino().to_le_bytes());
            head.extend(range.start.to_le_bytes());
            head.extend(range.end.to_le_bytes());
            head.extend(checksum(file, preceding(range.start))?.to_le_bytes());
            head.extend(checksum(file, [range.clone(), 0..0])?.to_le_bytes());
            head.extend(crc32fast::hash(&head).to_le_bytes());
            out.write_all(&head)?;
            let mut from = file;
            from.seek(SeekFrom::Start(range.start))?;
            io::copy(&mut from.take(range.end - range.start), &mut out)?;
            out.try_clone()
        };
        let copy = write().map_err(refused)?;
        partial.finish(true)?;
        Ok(Self { path: path.to_owned(), file: copy, range })
    }

    /// Finds what has the name of a file's backup: nothing, the backup, or something else and why.
    fn find(of: &File, name: &Path) -> Result<Option<Result<Self, String>>, Error> {
        let Some(path) = backup_of(name) else { return Ok(None) };
        let foreign = |why: &str| Ok(Some(Err(format!("{} is not the backup of this file{why}", path.display()))));
        let file = match regular::open_own(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) if regular::is_foreign(&error) => return foreign(&format!(": it {error}")),
            opened => opened.map_err(Error::io("read", &path))?,
        };
        match Self::read(&file, of).map_err(Error::io("read", &path))? {
            Some(range) => Ok(Some(Ok(Self { path, file, range }))),
            None => foreign(""),
        }
    }

    /// Range of the bytes that a backup holds, if it is complete and belongs to `of`.
    fn read(file: &File, of: &File) -> io::Result<Option<Range<u64>>> {
        let (kept, changed) = (file.metadata()?, of.metadata()?);
        let owner = rustix::process::geteuid().as_raw();
        if ![0, owner, changed.uid()].contains(&kept.uid()) || kept.len() < HEAD as u64 {
            return Ok(None);
        }
        let mut head = [0; HEAD];
        file.read_exact_at(&mut head, 0)?;
        let Some(head) = Head::parse(&head) else { return Ok(None) };
        let Range { start, end } = head.range;
        let fits = end.checked_sub(start) == Some(kept.len() - HEAD as u64) && start <= changed.len();
        if !fits || head.inode != changed.ino() || start < MCAP.len() as u64 {
            return Ok(None);
        }
        let same = checksum(of, preceding(start))? == head.preceding
            && checksum(file, [HEAD as u64..kept.len(), 0..0])? == head.kept;
        Ok(same.then_some(head.range))
    }

    /// Restores the old bytes, and removes the backup.
    fn restore(&self, mut file: &File) -> io::Result<()> {
        let mut kept = &self.file;
        // First makes room for the old bytes.
        if file.metadata()?.len() > self.range.end {
            file.set_len(self.range.end)?;
        }
        kept.seek(SeekFrom::Start(HEAD as u64))?;
        file.seek(SeekFrom::Start(self.range.start))?;
        io::copy(&mut kept, &mut file)?;
        file.sync_all()?;
        std::fs::remove_file(&self.path)?;
        sync_folder(&self.path)
    }
}

struct Head {
    inode: u64,
    range: Range<u64>,
    preceding: u32,
    kept: u32,
}

impl Head {
    fn parse(bytes: &[u8; HEAD]) -> Option<Self> {
        let (body, crc) = bytes.split_last_chunk::<4>()?;
        let (magic, fields) = body.split_first_chunk::<16>()?;
        let (inode, fields) = fields.split_first_chunk::<8>()?;
        let (start, fields) = fields.split_first_chunk::<8>()?;
        let (end, fields) = fields.split_first_chunk::<8>()?;
        let (preceding, kept) = fields.split_first_chunk::<4>()?;
        let whole = magic == MAGIC && u32::from_le_bytes(*crc) == crc32fast::hash(body);
        whole.then_some(Self {
            inode: u64::from_le_bytes(*inode),
            range: u64::from_le_bytes(*start)..u64::from_le_bytes(*end),
            preceding: u32::from_le_bytes(*preceding),
            kept: u32::from_le_bytes(*kept.first_chunk()?),
        })
    }
}

/// The first and the last bytes in front of the change.
fn preceding(start: u64) -> [Range<u64>; 2] {
    [0..start.min(PRECEDING), start.saturating_sub(PRECEDING)..start]
}

fn checksum(file: &File, ranges: [Range<u64>; 2]) -> io::Result<u32> {
    let mut crc = crc32fast::Hasher::new();
    for mut range in ranges {
        let mut buffer = vec![0; BLOCK.min(range.end.saturating_sub(range.start) as usize)];
        while range.start < range.end {
            buffer.truncate((range.end - range.start) as usize);
            file.read_exact_at(&mut buffer, range.start)?;
            crc.update(&buffer);
            range.start += buffer.len() as u64;
        }
    }
    Ok(crc.finalize())
}
