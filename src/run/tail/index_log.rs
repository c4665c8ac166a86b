//! Index log: the chunk indexes of a followed recording and of its sidecar, in a file beside the checkpoint.
//!
//! They grow with the recording and never change; a checkpoint that contained them would take ever longer to rewrite.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};

use crc32fast::Hasher;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::run::input::regular;

/// First bytes of the file.
const MAGIC: &[u8; 16] = b"stillpointindex1";
/// Most bytes kept in memory (256 KiB).
const ROOM: usize = 256 << 10;
/// Length of an item's head in bytes: kind and length.
const HEAD: usize = 1 + 4;

/// Content of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ItemKind {
    /// Chunk indexes of the recording.
    Chunks = 0,
    /// Chunks of the recording with damaged message indexes.
    Reindexed = 1,
    /// Chunk indexes of the sidecar.
    Sidecar = 2,
}

/// Written length of a log in bytes, and the CRC-32 of these bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Mark {
    pub(super) length: u64,
    crc: u32,
}

/// Items, appended one after the other.
#[derive(Debug)]
pub(super) struct IndexLog {
    path: PathBuf,
    /// Whether something else has the name. It stays, and the log is unnamed.
    foreign: bool,
    /// `None` before the first write.
    file: Option<File>,
    written: Mark,
    pending: Vec<u8>,
}

impl IndexLog {
    /// An empty log, without a file.
    ///
    /// # Errors
    ///
    /// If the system does not show what has its name.
    pub(super) fn new(path: PathBuf) -> Result<Self, Error> {
        let foreign = regular::begins_with(&path, MAGIC).map_err(Error::io("read", &path))? == Some(false);
        Ok(Self { path, foreign, file: None, written: Mark::default(), pending: Vec::new() })
    }

    /// Whether it survives a kill, so that a checkpoint may rely on it.
    pub(super) fn is_durable(&self) -> bool {
        !self.foreign
    }

    /// Continues behind a mark; `false` if the bytes in front of it are gone.
    pub(super) fn resume(&mut self, mark: Mark) -> Result<bool, Error> {
        self.pending.clear();
        (self.file, self.written) = (None, Mark::default());
        if mark.length == 0 {
            return Ok(true);
        }
        if self.foreign || !self.is_there().map_err(Error::io("read", &self.path))? {
            return Ok(false);
        }
        let file = regular::open_own_to_change(&self.path).map_err(Error::io("read", &self.path))?;
        if file.metadata().map_err(Error::io("read", &self.path))?.len() < mark.length {
            return Ok(false);
        }
        let mut crc = Hasher::new();
        read(&file, 0..mark.length, |bytes| crc.update(bytes)).map_err(Error::io("read", &self.path))?;
        if crc.finalize() != mark.crc {
            return Ok(false);
        }
        (self.file, self.written) = (Some(file), mark);
        Ok(true)
    }

    /// Appends an item, unless it has no bytes.
    pub(super) fn push(&mut self, kind: ItemKind, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.pending.push(kind as u8);
            self.pending.extend((bytes.len() as u32).to_le_bytes());
            self.pending.extend(bytes);
        }
    }

    /// Whether more bytes are pending than should stay in memory.
    pub(super) fn is_full(&self) -> bool {
        self.pending.len() > ROOM
    }

    /// Writes the pending items. If that fails, the next call tries again.
    pub(super) fn flush(&mut self) -> Result<Mark, Error> {
        if self.pending.is_empty() {
            return Ok(self.written);
        }
        let refused = Error::io("write", &self.path);
        let begun = match self.file.take() {
            Some(file) => Ok(file),
            None => self.begin().inspect(|_| self.written = mark_behind(Mark::default(), MAGIC)),
        };
        let file = begun.map_err(refused)?;
        let written = file.write_all_at(&self.pending, self.written.length);
        self.file = Some(file);
        written.map_err(Error::io("write", &self.path))?;
        self.written = mark_behind(self.written, &self.pending);
        self.pending.clear();
        Ok(self.written)
    }

    /// Handle of the file, for syncing.
    pub(super) fn file(&self) -> Result<Option<File>, Error> {
        let file = self.file.as_ref().map(File::try_clone).transpose();
        file.map_err(Error::io("write", &self.path))
    }

    /// Passes on the items of a byte range, in order.
    pub(super) fn items(
        &self,
        range: std::ops::Range<u64>,
        mut each: impl FnMut(u8, &[u8]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Some(file) = &self.file else { return Ok(()) };
        let mut at = range.start.max(MAGIC.len() as u64);
        let mut item = Vec::new();
        while at < range.end {
            let mut head = [0; HEAD];
            file.read_exact_at(&mut head, at).map_err(Error::io("read", &self.path))?;
            let [kind, length @ ..] = head;
            let length = u32::from_le_bytes(length);
            if at + HEAD as u64 + u64::from(length) > range.end {
                return Err(Error::io("read", &self.path)(io::ErrorKind::UnexpectedEof.into()));
            }
            item.resize(length as usize, 0);
            file.read_exact_at(&mut item, at + HEAD as u64).map_err(Error::io("read", &self.path))?;
            each(kind, &item)?;
            at += (HEAD + item.len()) as u64;
        }
        Ok(())
    }

    /// Creates the file, replacing one that a killed run left.
    fn begin(&self) -> io::Result<File> {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !self.foreign && self.is_there()? {
            std::fs::remove_file(&self.path)?;
        }
        let file = match self.foreign {
            true => tempfile::tempfile_in(folder)?,
            false => OpenOptions::new().read(true).write(true).create_new(true).open(&self.path)?,
        };
        if let Err(error) = file.write_all_at(MAGIC, 0) {
            // What has no beginning would not be recognised.
            if !self.foreign {
                let _ = std::fs::remove_file(&self.path);
            }
            return Err(error);
        }
        Ok(file)
    }

    /// Forgets all items and removes the file.
    pub(super) fn remove(&mut self) -> Result<(), Error> {
        self.file = None;
        (self.written, self.pending) = (Mark::default(), Vec::new());
        match !self.foreign && self.is_there().map_err(Error::io("read", &self.path))? {
            true => std::fs::remove_file(&self.path).map_err(Error::io("remove", &self.path)),
            false => Ok(()),
        }
    }

    /// Whether a log has the name.
    fn is_there(&self) -> io::Result<bool> {
        Ok(regular::begins_with(&self.path, MAGIC)? == Some(true))
    }
}

fn mark_behind(Mark { length, crc }: Mark, bytes: &[u8]) -> Mark {
    let mut hasher = Hasher::new_with_initial(crc);
    hasher.update(bytes);
    Mark { length: length + bytes.len() as u64, crc: hasher.finalize() }
}

fn read(file: &File, range: std::ops::Range<u64>, mut each: impl FnMut(&[u8])) -> io::Result<()> {
    let mut buffer = vec![0; ROOM];
    let mut at = range.start;
    while at < range.end {
        buffer.truncate((range.end - at) as usize);
        file.read_exact_at(&mut buffer, at)?;
        each(&buffer);
        at += buffer.len() as u64;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn items(log: &IndexLog, mark: Mark) -> Vec<(u8, Vec<u8>)> {
        let mut found = Vec::new();
        let keep = |kind, bytes: &[u8]| {
            found.push((kind, bytes.to_vec()));
            Ok(())
        };
        log.items(0..mark.length, keep).unwrap();
        found
    }

    #[test]
    fn a_log_goes_on_behind_its_mark() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.indexes");
        let mut log = IndexLog::new(path.clone()).unwrap();
        assert_eq!(log.flush().unwrap(), Mark::default());
        assert!(!path.exists(), "nothing was said");
        log.push(ItemKind::Chunks, b"one");
        let mark = log.flush().unwrap();
        log.push(ItemKind::Sidecar, b"lost");
        log.flush().unwrap();

        let mut again = IndexLog::new(path.clone()).unwrap();
        assert!(again.resume(mark).unwrap());
        again.push(ItemKind::Reindexed, b"two");
        let mark = again.flush().unwrap();
        assert_eq!(items(&again, mark), [(0, b"one".to_vec()), (1, b"two".to_vec())]);
        again.remove().unwrap();
        assert!(!path.exists());
        assert!(!again.resume(mark).unwrap(), "it is gone");
    }

    #[test]
    fn what_was_changed_is_not_gone_on_with_and_what_is_not_ours_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.indexes");
        let mut log = IndexLog::new(path.clone()).unwrap();
        log.push(ItemKind::Chunks, b"one");
        let mark = log.flush().unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        assert!(!IndexLog::new(path.clone()).unwrap().resume(mark).unwrap());

        std::fs::write(&path, "a stranger's").unwrap();
        let mut log = IndexLog::new(path.clone()).unwrap();
        log.push(ItemKind::Chunks, b"one");
        let mark = log.flush().unwrap();
        assert!(!log.is_durable() && items(&log, mark) == [(0, b"one".to_vec())]);
        log.remove().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"a stranger's");
    }
}
