//! An output while it is being written: a new file that gets its name when it is complete. Dropped early, it leaves
//! nothing behind.
//!
//! While it is written it has no name at all, where the file system supports that; else an unguessable one that nothing
//! else has. Either way nothing that exists beside the output is ever opened, written through or taken over. To replace
//! a file it must have a name for an instant; the file of a run that was killed just then is recognised by its own
//! inode in its name, and removed when the next run replaces the same file.

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::{FileExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags, RenameFlags, linkat, openat, renameat_with};
use rustix::io::Errno;

use super::reads::Reads;
use crate::Error;
use crate::run::input::regular;

/// A file that gets its name when it is complete.
#[derive(Debug)]
pub struct Partial {
    file: File,
    /// Its temporary name, if it has one.
    path: Option<PathBuf>,
    target: PathBuf,
    /// Whether an existing file of the final name is replaced.
    replaces: bool,
}

impl Partial {
    /// Creates an empty file that gets the name `target` at the end, or none if that name is taken by then.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub fn create_new(target: &Path) -> Result<Self, Error> {
        let refused = |error| Error::io("write", target)(error);
        let (file, path) = match unnamed(folder_of(target)) {
            Err(error) if cannot(&error) => {
                sweep(target);
                named(target).map(|(file, path)| (file, Some(path))).map_err(refused)?
            }
            file => (file.map_err(refused)?, None),
        };
        // The lock keeps sweeps away while it is written. Without lock support, nothing is swept.
        let _ = file.try_lock();
        Ok(Self { file, path, target: target.to_owned(), replaces: false })
    }

    /// The same, but it replaces an existing file of that name, unless that is one of the files that were read.
    ///
    /// # Errors
    ///
    /// If it is one of them, or the system refuses.
    pub fn create(target: &Path, reads: &Reads) -> Result<Self, Error> {
        reads.refuse(target)?;
        let mut partial = Self::create_new(target)?;
        partial.replaces = true;
        Ok(partial)
    }

    /// The file as written so far.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Final path.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Whether another file has the same bytes.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub fn equals(&self, other: &Path) -> io::Result<bool> {
        is_end(&regular::open(other)?, 0, &self.file)
    }

    /// Gives the complete file its name; with `sync`, waits until both are on the device.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the system refuses, [`Error::Exists`] if the name has been taken; nothing is left behind then.
    pub fn finish(mut self, sync: bool) -> Result<(), Error> {
        self.publish(sync).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => Error::Exists(self.target.clone()),
            _ => Error::io("write", &self.target)(error),
        })
    }

    fn publish(&mut self, sync: bool) -> io::Result<()> {
        if sync {
            self.file.sync_all()?;
        }
        match (&self.path, self.replaces) {
            (None, false) => name(&self.file, &self.target)?,
            (Some(path), false) => rename_new(path, &self.target)?,
            (None, true) => match name(&self.file, &self.target) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    sweep(&self.target);
                    let path = temporary(&self.target, |path| name(&self.file, path), &self.file)?;
                    let path = self.path.insert(path);
                    std::fs::rename(path, &self.target)?;
                }
                named => named?,
            },
            (Some(path), true) => std::fs::rename(path, &self.target)?,
        }
        self.path = None;
        if sync { sync_folder(&self.target) } else { Ok(()) }
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        if let Some(path) = &self.path {
            // The error has no receiver, and the next run removes what could not be removed.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// A file without a name.
fn unnamed(folder: &Path) -> io::Result<File> {
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let file = File::from(openat(CWD, folder, flags, Mode::from_raw_mode(0o666))?);
    // A file that cannot be named later is of no use.
    match place(&file).exists() {
        true => Ok(file),
        false => Err(Errno::OPNOTSUPP.into()),
    }
}

/// Whether the error says that the file system or kernel does not support files without names.
fn cannot(error: &io::Error) -> bool {
    [Errno::OPNOTSUPP, Errno::ISDIR, Errno::INVAL].map(Errno::raw_os_error).contains(&error.raw_os_error().unwrap_or(0))
}

/// Gives an unnamed file a name that nothing has.
fn name(file: &File, path: &Path) -> io::Result<()> {
    Ok(linkat(CWD, place(file), CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

fn place(file: &File) -> PathBuf {
    use std::os::fd::AsRawFd as _;
    format!("/proc/self/fd/{}", file.as_raw_fd()).into()
}

/// Creates a file under a name that nothing has.
fn named(target: &Path) -> io::Result<(File, PathBuf)> {
    let new = |path: &Path| {
        let flags = OFlags::NOFOLLOW.bits() as i32;
        OpenOptions::new().read(true).write(true).create_new(true).custom_flags(flags).open(path)
    };
    let name = prefix(target);
    let made = tempfile::Builder::new().prefix(&name).suffix(ENDING).make_in(folder_of(target), new)?;
    let (file, path) = made.keep().map_err(|kept| kept.error)?;
    let _ = file.try_lock();
    let known = temporary(target, |known| rename_new(&path, known), &file);
    if known.is_err() {
        let _ = std::fs::remove_file(&path);
    }
    Ok((file, known?))
}

const ENDING: &str = ".partial";

/// Gives a file a name that contains its own inode, which marks it as ours.
fn temporary(target: &Path, give: impl Fn(&Path) -> io::Result<()>, file: &File) -> io::Result<PathBuf> {
    let mut start = prefix(target);
    start.push(format!("{:x}-", file.metadata()?.ino()));
    let given = tempfile::Builder::new().prefix(&start).suffix(ENDING).make_in(folder_of(target), give)?;
    given.into_temp_path().keep().map_err(|kept| kept.error)
}

/// Removes the leftovers of killed runs whose file or folder was to be named `target`.
pub(crate) fn sweep(target: &Path) {
    let start = prefix(target);
    let Some(start) = start.to_str() else { return };
    for entry in std::fs::read_dir(folder_of(target)).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let of_ours = name.to_str().and_then(|name| name.strip_prefix(start)?.strip_suffix(ENDING)?.split_once('-'));
        let Some((number, _)) = of_ours else { continue };
        let Ok(metadata) = entry.metadata() else { continue };
        if u64::from_str_radix(number, 16) != Ok(metadata.ino()) {
            continue;
        }
        // A file that is being written is locked.
        let free = File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok());
        // Leftovers that cannot be removed stay for the next run.
        let _ = match metadata.file_type() {
            kind if kind.is_file() && free && metadata.nlink() == 1 => std::fs::remove_file(entry.path()),
            kind if kind.is_dir() && free => std::fs::remove_dir_all(entry.path()),
            _ => Ok(()),
        };
    }
}

/// Prefix of temporary names for `target`.
fn prefix(target: &Path) -> OsString {
    let mut name = OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    name.push(".");
    name
}

/// Creates an empty folder beside `target`, locked, under a name that nothing has.
pub(crate) fn folder_beside(target: &Path) -> io::Result<(PathBuf, File)> {
    sweep(target);
    let name = prefix(target);
    let new = |path: &Path| std::fs::create_dir(path);
    // Not `tempdir_in`, whose errors have lost their number, so that a full disk could not be told from a refusal.
    let made = tempfile::Builder::new().prefix(&name).suffix(ENDING).make_in(folder_of(target), new)?;
    let path = made.into_temp_path().keep().map_err(|kept| kept.error)?;
    let known = File::open(&path).and_then(|lock| {
        let _ = lock.try_lock();
        Ok((temporary(target, |known| rename_new(&path, known), &lock)?, lock))
    });
    if known.is_err() {
        let _ = std::fs::remove_dir(&path);
    }
    known
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether the bytes of a file from offset `from` on equal `end`.
pub(crate) fn is_end(file: &File, from: u64, end: &File) -> io::Result<bool> {
    let length = end.metadata()?.len();
    if file.metadata()?.len() != from + length {
        return Ok(false);
    }
    let (mut found, mut expected) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    let mut at = 0;
    while at < length {
        let next = (length - at).min(found.len() as u64) as usize;
        found.truncate(next);
        expected.truncate(next);
        file.read_exact_at(&mut found, from + at)?;
        end.read_exact_at(&mut expected, at)?;
        if found != expected {
            return Ok(false);
        }
        at += next as u64;
    }
    Ok(true)
}

/// Renames a file to a name that nothing has.
pub(crate) fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // Not every file system supports this.
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) if to.symlink_metadata().is_err() => {
            std::fs::rename(from, to)
        }
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => Err(io::ErrorKind::AlreadyExists.into()),
        done => Ok(done?),
    }
}

/// Waits until the names in the folder of `path` are on the device.
pub(crate) fn sync_folder(path: &Path) -> io::Result<()> {
    File::open(folder_of(path))?.sync_all()
}

/// Whether a path names this very file, links not followed.
pub(crate) fn same_file(file: &File, path: &Path) -> bool {
    let id = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    file.metadata().map(id).ok().is_some_and(|ours| std::fs::symlink_metadata(path).map(id).ok() == Some(ours))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// One partial without a name and one with.
    fn both(target: &Path, replaces: bool) -> [Partial; 2] {
        let (file, path) = named(target).unwrap();
        let mut unnamed = Partial::create_new(target).unwrap();
        unnamed.replaces = replaces;
        [unnamed, Partial { file, path: Some(path), target: target.to_owned(), replaces }]
    }

    #[test]
    fn nothing_stands_under_the_final_name_before_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.mcap");
        for (text, partial) in [b"whole", b"anew_"].into_iter().zip(both(&target, true)) {
            partial.file().write_all(text).unwrap();
            partial.finish(true).unwrap();
            assert_eq!(names(folder.path()).last().unwrap(), "out.mcap");
            assert_eq!(std::fs::read(&target).unwrap(), text);
        }
        assert_eq!(names(folder.path()), ["out.mcap"]);
    }

    #[test]
    fn giving_up_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        drop(both(&folder.path().join("out.mcap"), true));
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_name_that_was_taken_meanwhile_stays_its_owners() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.mcap");
        let partials = both(&target, false);
        std::fs::write(&target, b"theirs").unwrap();
        for partial in partials {
            assert!(matches!(partial.finish(false), Err(Error::Exists(_))));
        }
        assert_eq!(std::fs::read(&target).unwrap(), b"theirs");
        assert_eq!(names(folder.path()), ["out.mcap"]);
    }

    #[test]
    fn what_a_killed_run_left_is_swept_away_and_what_a_stranger_put_there_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.mcap");
        let (file, left) = named(&target).unwrap();
        let (dir, lock) = folder_beside(&target).unwrap();
        std::fs::write(dir.join("half"), b"half of something").unwrap();
        let theirs = [".out.mcap.1-abc.partial", ".out.mcap.partial", ".out.mcap.x.partial", "out.mcap.partial"];
        theirs.iter().for_each(|name| std::fs::write(folder.path().join(name), b"theirs").unwrap());
        sweep(&target);
        assert!(left.exists() && dir.exists(), "what is being written stays");
        drop((file, lock));
        sweep(&target);
        assert_eq!(names(folder.path()), theirs);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = Partial::create_new(Path::new("/no/such/folder/out.mcap")).unwrap_err().to_string();
        assert_eq!(
            error,
            "/no/such/folder/out.mcap: cannot write: no such folder as /no/such/folder; make it (mkdir -p /no/such/folder) or choose another"
        );
    }
}
