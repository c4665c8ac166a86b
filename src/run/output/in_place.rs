//! Replacing the end of a file so that no crash loses it, and repairing a file on which a run was killed meanwhile.
//!
//! What is written is left to the caller, who has staged all of it before the file is touched.
//!
//! # Protocol
//!
//! The beginning of the file stays; what follows byte `from` is replaced. Beside `FILE` stands `FILE.stillpoint-backup`
//! from before the first changed byte until after the last one is on the device:
//!
//! 1. The backup (of which file, where the change begins, the old length, the old bytes from there on, checksums) is
//!    written without a name, synced, named, and its folder synced. From here on, the old file can be had back.
//! 2. The new bytes are written over the old, the length is set, the file is synced.
//! 3. The backup is removed: **the commit**. Its folder is synced, so that it does not come back after a power failure.
//!
//! A backup that is found without anybody at work says that a run died between 1 and 3. Who only reads says so and
//! changes nothing; who opens the file to change it takes the change back first. That too can be killed at any time,
//! since it only ever writes what the backup says. An error within step 2, a full disk above all, is answered in the same
//! way at once: the old bytes need no room that the file did not have.
//!
//! Anybody may put a file of that name beside a recording. A backup counts if it is a regular file under this one name,
//! made by us or by who owns the recording, and tells the recording's own number (inode) and what precedes the change in
//! it; the change never begins in front of the first record. Any other is left alone: reading goes on as if it were not
//! there, and changing is refused, since its name is needed.
//!
//! Who is at work is told by `flock`, which the system releases when a process dies: one process may change the file, or
//! any number may read it. The file stays the same inode, so that owner, mode and extended attributes stay; one with
//! further names (hard links) is refused, since a repair could not be found from them.

use std::fs::{File, TryLockError};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

use mcap::MAGIC as MCAP;

use crate::Error;
use crate::run::input::regular;
use crate::run::output::partial::{Partial, sync_folder};

/// What a backup begins with; another layout gets another number.
const MAGIC: &[u8; 16] = b"stillpointback02";
/// Of magic, number of the file, place of the change, old length, three checksums.
const HEAD: usize = 16 + 8 + 8 + 8 + 4 + 4 + 4;
/// How much of what precedes the change is in the checksum, at either end (64 KiB).
const PRECEDING: u64 = 1 << 16;
const BLOCK: usize = 1 << 20;

/// What a file is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Others may read it, too.
    Read,
    /// Nobody else may.
    Change,
}

/// Opens a file; to be changed, after taking back what a killed run left half done. It stays locked until it is closed.
///
/// # Errors
///
/// If it is no regular file, the system refuses, another process is at work on it, it is to be read and a killed run left
/// it half changed, or it cannot be repaired.
pub(crate) fn open(path: &Path, access: Access) -> Result<File, Error> {
    match access {
        Access::Read => {
            let file = regular::open(path).map_err(|error| unreadable(path, error))?;
            // Where locks are unknown, nobody changes a file in place either.
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

/// Takes back what a killed run left half done. Whether there was anything.
///
/// # Errors
///
/// As `open` for [`Access::Change`].
pub fn take_back(path: &Path) -> Result<bool, Error> {
    repair(&lock(path)?, path)
}

/// Opens a file for nobody else.
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

/// Refuses a file that would change under other names, too.
///
/// # Errors
///
/// If it has such names, or the system refuses to say so.
pub(crate) fn check(file: &File, path: &Path) -> Result<(), Error> {
    let why = "has further names (hard links), under which it would change as well; use -o instead of --in-place";
    match file.metadata().map_err(Error::io("change", path))?.nlink() {
        ..=1 => Ok(()),
        _ => Err(Error::input(path, why)),
    }
}

/// Replaces what follows byte `from` of a file that was opened for [`Access::Change`].
///
/// # Errors
///
/// If the system refuses; the file is as it was then, or will be when it is opened next.
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

/// Beside the file itself, wherever links lead.
fn backup_of(path: &Path) -> Option<PathBuf> {
    let path = path.canonicalize().ok()?;
    let mut name = path.file_name()?.to_owned();
    name.push(".stillpoint-backup");
    Some(path.with_file_name(name))
}

/// The old end of a file, in a file of its own.
struct Backup {
    path: PathBuf,
    file: File,
    /// Where the old bytes stood.
    range: Range<u64>,
}

impl Backup {
    /// Saves a range, through the end, of a file.
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

    /// What stands in the place of a file's backup: nothing, its backup, or why that is none.
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

    /// Where the bytes belong that a backup holds, if it is whole and that of `of`.
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

    /// Puts the old bytes back, and removes the backup.
    fn restore(&self, mut file: &File) -> io::Result<()> {
        let mut kept = &self.file;
        // First room for what was there.
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

/// The two ends of what stands in front of the change.
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
