//! File of a recording that its recorder is still writing. It is only read, and checked by polling, which every file
//! system allows. [`Scan`](crate::record::Scan) parses its bytes.

use std::fs::{File, Metadata, TryLockError};
use std::io;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::Error;
use crate::pipeline::events::Ending;
use crate::record::{CLOSING, is_closing};
use crate::run::input::regular;

/// Number of bytes in front of an offset by which a file is recognised.
const KNOWN: usize = 64;

/// Upper bound of the resolution of a file system's clock.
const TICK: Duration = Duration::from_millis(20);

/// A file that may grow.
#[derive(Debug)]
pub(crate) struct GrowingFile {
    path: PathBuf,
    file: File,
    /// Device and inode.
    id: (u64, u64),
    length: u64,
    /// Time of the last write; `None` if it is so recent that another write may get the same time.
    written: Option<SystemTime>,
    /// An offset up to which all was read, and the bytes in front of it, which no longer change.
    known: (u64, Vec<u8>),
}

/// Change of a file since the last look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    Same,
    /// There are more bytes, or bytes within the known length were filled in, or some that were not read yet are gone.
    Grown,
    /// Its name is gone or belongs to another file. The bytes written before are still there.
    Unnamed(Ending),
    /// Bytes written before are gone.
    Lost,
}

impl GrowingFile {
    /// Opens a file; `None` while it is missing or empty.
    pub(crate) fn open(path: &Path) -> Result<Option<Self>, Error> {
        let file = match regular::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) if regular::is_foreign(&error) => {
                return Err(Error::input(path, format!("{error}; name the file that is being recorded")));
            }
            opened => opened.map_err(Error::io("read", path))?,
        };
        // Nobody changes it in place while it is followed. Without lock support, nobody does anyway.
        if let Err(TryLockError::WouldBlock) = file.try_lock_shared() {
            return Err(Error::Busy(path.to_owned()));
        }
        let metadata = file.metadata().map_err(Error::io("read", path))?;
        let (id, length, written) = (id(&metadata), metadata.len(), written(&metadata));
        Ok((length > 0).then(|| Self { path: path.to_owned(), file, id, length, written, known: (0, Vec::new()) }))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    /// Looks for new bytes, lost bytes, and a removed or replaced name.
    pub(crate) fn look(&mut self) -> Result<Look, Error> {
        let metadata = self.file.metadata().map_err(Error::io("read", &self.path))?;
        let (length, written) = (metadata.len(), written(&metadata));
        if length != self.length || self.written.is_none() || written != self.written {
            (self.length, self.written) = (length, written);
            // It may have been truncated and rewritten since. Room that a recorder gives back was never read.
            return Ok(if self.is_known()? { Look::Grown } else { Look::Lost });
        }
        Ok(match std::fs::metadata(&self.path) {
            Ok(named) if id(&named) != self.id => Look::Unnamed(Ending::Replaced),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Look::Unnamed(Ending::Deleted),
            // An unreachable file system comes back, or leaves the file idle.
            Ok(_) | Err(_) => Look::Same,
        })
    }

    /// Fills `buffer` with the bytes from `offset` on; `false` if they are gone.
    pub(crate) fn read(&self, buffer: &mut [u8], offset: u64) -> Result<bool, Error> {
        match self.file.read_exact_at(buffer, offset) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
            read => read.map(|()| true).map_err(Error::io("read", &self.path)),
        }
    }

    /// Marks everything in front of this byte as read and final; `false` if any of it changed.
    pub(crate) fn passed(&mut self, offset: u64) -> Result<bool, Error> {
        let mut bytes = vec![0; KNOWN.min(offset as usize)];
        let start = offset - bytes.len() as u64;
        // In this order, so that bytes rewritten meanwhile are not taken for those that were read.
        let passed = self.read(&mut bytes, start)? && self.is_known()?;
        if passed {
            self.known = (offset, bytes);
        }
        Ok(passed)
    }

    /// Offset and bytes by which the file is recognised.
    pub(crate) fn known(&self) -> &(u64, Vec<u8>) {
        &self.known
    }

    /// Takes over offset and bytes of an earlier run. Returns whether it is the same file.
    pub(crate) fn recognise(&mut self, known: &(u64, Vec<u8>)) -> Result<bool, Error> {
        self.known = known.clone();
        self.is_known()
    }

    fn is_known(&self) -> Result<bool, Error> {
        let (offset, bytes) = &self.known;
        let mut found = vec![0; bytes.len()];
        let start = offset.saturating_sub(bytes.len() as u64);
        Ok(*offset <= self.length && self.read(&mut found, start)? && found == *bytes)
    }

    /// Whether its last bytes are the closing bytes of a recording.
    pub(crate) fn is_closed(&self) -> bool {
        let mut closing = [0; CLOSING];
        let start = self.length.checked_sub(CLOSING as u64);
        let read = start.is_some_and(|start| self.read(&mut closing, start).unwrap_or(false));
        read && is_closing(&closing)
    }
}

/// Time of the last write, unless the next write could get the same time.
fn written(metadata: &Metadata) -> Option<SystemTime> {
    let modified = metadata.modified().ok()?;
    // A time in the future comes from another machine's clock.
    (!modified.elapsed().is_ok_and(|age| age < TICK)).then_some(modified)
}

fn id(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}
