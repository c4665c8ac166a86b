//! An output while it is being written: a locked file beside its final name, renamed into place when it is whole.
//!
//! What is written is left to the caller. Dropped early, it leaves nothing behind.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::Error;

/// A file that gets its name when it is whole.
#[derive(Debug)]
pub struct Partial {
    file: File,
    path: PathBuf,
    target: PathBuf,
    /// Whether what stands under the name in the end is replaced.
    replaces: bool,
    finished: bool,
}

impl Partial {
    /// The same, for a name that nothing has: what gets it meanwhile is not replaced.
    ///
    /// # Errors
    ///
    /// As [`Partial::create`].
    pub fn create_new(target: &Path) -> Result<Self, Error> {
        let mut partial = Self::create(target)?;
        partial.replaces = false;
        Ok(partial)
    }

    /// Opens `TARGET.partial`, empty. One that a killed run left is taken over.
    ///
    /// # Errors
    ///
    /// [`Error::Busy`] while another process writes it, [`Error::Io`] if the system refuses.
    pub fn create(target: &Path) -> Result<Self, Error> {
        let mut name = target.file_name().unwrap_or_default().to_owned();
        name.push(".partial");
        let path = target.with_file_name(name);
        let refused = |error| Error::io("write", target)(error);
        loop {
            let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
            let file = options.map_err(refused)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(Error::Busy(target.to_owned())),
                Err(TryLockError::Error(error)) => return Err(refused(error)),
            }
            // Its last owner may have renamed or removed it between our opening and locking it.
            if same_file(&file, &path) {
                // ext4 writes out at once, when it is closed, what was ever cut to nothing.
                if file.metadata().map_err(refused)?.len() > 0 {
                    file.set_len(0).map_err(refused)?;
                }
                return Ok(Self { file, path, target: target.to_owned(), replaces: true, finished: false });
            }
        }
    }

    /// What is written so far.
    pub fn file(&self) -> &File {
        &self.file
    }

    /// Where it will be.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Whether another file holds the same.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub fn equals(&self, other: &Path) -> io::Result<bool> {
        is_end(&File::open(other)?, 0, &self.file)
    }

    /// Gives the whole file its name, on the device if asked to.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the system refuses, [`Error::Exists`] if the name has been taken; nothing is left behind then.
    pub fn finish(mut self, sync: bool) -> Result<(), Error> {
        let done = self.publish(sync).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => Error::Exists(self.target.clone()),
            _ => Error::io("write", &self.target)(error),
        });
        self.finished = done.is_ok();
        done
    }

    fn publish(&self, sync: bool) -> io::Result<()> {
        if sync {
            self.file.sync_all()?;
        }
        match self.replaces {
            true => std::fs::rename(&self.path, &self.target)?,
            false => rename_new(&self.path, &self.target)?,
        }
        if sync { sync_folder(&self.target) } else { Ok(()) }
    }
}

/// Whether what follows byte `from` of a file is `end`.
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

/// Gives a file a name that nothing has.
fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // Not every file system knows how.
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) if to.symlink_metadata().is_err() => {
            std::fs::rename(from, to)
        }
        Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => Err(io::ErrorKind::AlreadyExists.into()),
        done => Ok(done?),
    }
}

/// Waits until the names in the folder of `path` are on the device.
pub(crate) fn sync_folder(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

impl Drop for Partial {
    fn drop(&mut self) {
        if !self.finished {
            // There is nobody to tell, and the next run takes over what could not be removed.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Whether a file is what stands at a path.
pub(crate) fn same_file(file: &File, path: &Path) -> bool {
    let id = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    file.metadata().map(id).ok().is_some_and(|ours| std::fs::metadata(path).map(id).ok() == Some(ours))
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

    #[test]
    fn nothing_stands_under_the_final_name_before_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.mcap");
        let partial = Partial::create(&target).unwrap();
        partial.file().write_all(b"whole").unwrap();
        assert_eq!(names(folder.path()), ["out.mcap.partial"]);
        partial.finish(true).unwrap();
        assert_eq!(names(folder.path()), ["out.mcap"]);
        assert_eq!(std::fs::read(target).unwrap(), b"whole");
    }

    #[test]
    fn giving_up_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        drop(Partial::create(&folder.path().join("out.mcap")).unwrap());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn what_a_killed_run_left_is_taken_over_and_what_another_writes_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out.mcap");
        std::fs::write(folder.path().join("out.mcap.partial"), b"half of something").unwrap();
        let partial = Partial::create(&target).unwrap();
        assert_eq!(partial.file().metadata().unwrap().len(), 0);
        assert!(matches!(Partial::create(&target), Err(Error::Busy(_))));
        assert_eq!(names(folder.path()), ["out.mcap.partial"], "the other one's file stays");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let error = Partial::create(Path::new("/no/such/folder/out.mcap")).unwrap_err().to_string();
        assert_eq!(error, "/no/such/folder/out.mcap: cannot write: no such file or folder");
    }
}
