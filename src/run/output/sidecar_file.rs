//! A growing sidecar on disk: valid at any time up to its last block, and locked against a second writer. The caller
//! decides when to resume it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::record::{Block, ReadAt, SidecarBlocks, Topic};
use crate::run::input::regular;
use crate::run::output::partial::same_file;

/// A file that grows block by block.
#[derive(Debug)]
pub(crate) struct SidecarFile {
    path: PathBuf,
    file: File,
    length: u64,
    /// Bytes not written yet.
    pending: Vec<u8>,
}

impl SidecarFile {
    /// Opens an existing sidecar or creates an empty one. The system releases the lock when the process ends, for
    /// whatever reason.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let file = match OpenOptions::new().read(true).write(true).create_new(true).open(path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                regular::open_own_to_change(path).map_err(|error| match regular::is_foreign(&error) {
                    true => Error::input(path, format!("{error}, where the annotations would grow: move it elsewhere")),
                    false => Error::io("write", path)(error),
                })?
            }
            made => made.map_err(Error::io("write", path))?,
        };
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(Error::Busy(path.to_owned())),
            Err(TryLockError::Error(error)) => return Err(Error::io("lock", path)(error)),
        }
        let length = file.metadata().map_err(Error::io("read", path))?.len();
        Ok(Self { path: path.to_owned(), file, length, pending: Vec::new() })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Number of bytes written.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Drops all behind the first `length` bytes.
    pub(crate) fn cut(&mut self, length: u64) -> Result<(), Error> {
        self.pending.clear();
        self.length = length;
        self.file.set_len(length).map_err(Error::io("write", &self.path))
    }

    /// Begins anew, in a new file: the old one is not overwritten.
    pub(crate) fn begin_anew(&mut self) -> Result<(), Error> {
        if self.length > 0 || !same_file(&self.file, &self.path) {
            self.remove()?;
            *self = Self::open(&self.path)?;
        }
        self.cut(0)
    }

    /// Releases the lock: nothing more is written.
    pub(crate) fn unlock(&self) -> Result<(), Error> {
        self.file.unlock().map_err(Error::io("unlock", &self.path))
    }

    /// Removes the file, unless its name belongs to another file by now.
    pub(crate) fn remove(&self) -> Result<(), Error> {
        match same_file(&self.file, &self.path) {
            true => std::fs::remove_file(&self.path).map_err(Error::io("remove", &self.path)),
            false => Ok(()),
        }
    }

    /// Appends bytes; they are written by [`flush`](Self::flush).
    pub(crate) fn put(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
    }

    /// Whether bytes are not written yet.
    pub(crate) fn has_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Writes the pending bytes. If that fails, the next call tries again.
    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        if self.pending.is_empty() {
            return Ok(());
        }
        if let Err(error) = self.file.write_all_at(&self.pending, self.length) {
            // Part of it may be there. If it cannot even be cut off, it is overwritten later.
            let _ = self.file.set_len(self.length);
            return Err(Error::io("write", &self.path)(error));
        }
        self.length += self.pending.len() as u64;
        self.pending.clear();
        Ok(())
    }

    /// The written blocks of these topics, one after the other.
    pub(crate) fn blocks<'a>(&'a self, topics: &'a [Topic]) -> impl FnMut() -> Result<Option<Block>, Error> + 'a {
        let mut blocks = SidecarBlocks::new(self.length);
        let mut file = FileBytes(&self.file);
        move || blocks.next(&mut file, topics).map_err(Error::reading(&self.path))
    }
}

struct FileBytes<'a>(&'a File);

impl ReadAt for FileBytes<'_> {
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        self.0.read_exact_at(buffer, offset)
    }
}
