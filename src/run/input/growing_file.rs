//! The file of a recording while its recorder writes it. It is only ever read, and looked at by polling, which every
//! file system allows. What its bytes say is left to [`Scan`](crate::record::Scan).

use std::fs::{File, Metadata, TryLockError};
use std::io;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::Error;
use crate::pipeline::events::Ending;
use crate::record::{CLOSING, is_closing};
use crate::run::input::regular;

/// Bytes in front of a place by which a file is known again.
const KNOWN: usize = 64;

/// Clocks of file systems stand still for less than this.
const TICK: Duration = Duration::from_millis(20);

/// A file that may grow.
#[derive(Debug)]
pub(crate) struct GrowingFile {
    path: PathBuf,
    file: File,
    /// Device and inode.
    id: (u64, u64),
    length: u64,
    /// When it was written to last; `None` if that is so short ago that more may be written at the same time.
    written: Option<SystemTime>,
    /// A place that was read through, and the bytes in front of it, which do not change any more.
    known: (u64, Vec<u8>),
}

/// What became of a file since it was looked at last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    Same,
    /// There is more, or the length of what was open has been filled in.
    Grown,
    /// Its name is gone, or stands for another file. What had been written is still there.
    Unnamed(Ending),
    /// What had been written is not there any more.
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
        // Nobody changes it in place while it is followed. Where locks are unknown, nobody does anyway.
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

    /// Whether it has grown, if only in what its bytes say, or what else became of it.
    pub(crate) fn look(&mut self) -> Result<Look, Error> {
        let metadata = self.file.metadata().map_err(Error::io("read", &self.path))?;
        let (length, written) = (metadata.len(), written(&metadata));
        if length < self.length {
            return Ok(Look::Lost);
        }
        if length > self.length || self.written.is_none() || written != self.written {
            (self.length, self.written) = (length, written);
            // It may have been cut off and written anew since.
            return Ok(if self.is_known()? { Look::Grown } else { Look::Lost });
        }
        Ok(match std::fs::metadata(&self.path) {
            Ok(named) if id(&named) != self.id => Look::Unnamed(Ending::Replaced),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Look::Unnamed(Ending::Deleted),
            // A file system that is out of reach comes back, or leaves the file idle.
            Ok(_) | Err(_) => Look::Same,
        })
    }

    /// Fills `buffer` with the bytes from `offset` on; `false` if they are not there any more.
    pub(crate) fn read(&self, buffer: &mut [u8], offset: u64) -> Result<bool, Error> {
        match self.file.read_exact_at(buffer, offset) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
            read => read.map(|()| true).map_err(Error::io("read", &self.path)),
        }
    }

    /// Everything in front of this byte has been read, and will not change; `false` if something did.
    pub(crate) fn passed(&mut self, offset: u64) -> Result<bool, Error> {
        let mut bytes = vec![0; KNOWN.min(offset as usize)];
        let start = offset - bytes.len() as u64;
        // In this order, so that what was written anew meanwhile is not taken for what was read.
        let passed = self.read(&mut bytes, start)? && self.is_known()?;
        if passed {
            self.known = (offset, bytes);
        }
        Ok(passed)
    }

    /// What the file is known again by.
    pub(crate) fn known(&self) -> &(u64, Vec<u8>) {
        &self.known
    }

    /// Takes over what it was known by. Whether it is the same file.
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

    /// Whether its last bytes are those that end a recording.
    pub(crate) fn is_closed(&self) -> bool {
        let mut closing = [0; CLOSING];
        let start = self.length.checked_sub(CLOSING as u64);
        let read = start.is_some_and(|start| self.read(&mut closing, start).unwrap_or(false));
        read && is_closing(&closing)
    }
}

/// When a file was written to last, unless its next change could bear the same time.
fn written(metadata: &Metadata) -> Option<SystemTime> {
    let modified = metadata.modified().ok()?;
    // A time in the future is that of another machine's clock.
    (!modified.elapsed().is_ok_and(|age| age < TICK)).then_some(modified)
}

fn id(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}
