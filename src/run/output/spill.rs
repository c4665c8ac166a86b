//! Bytes that would grow with the recording, kept in an unnamed file until they are needed.

use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use tempfile::SpooledTempFile;

use crate::Error;
use crate::pipeline::time_merge::Shelf;
use crate::run::store::is_url;

/// Most bytes kept in memory (256 KiB): most recordings need no file at all.
const ROOM: usize = 256 << 10;

/// Bytes that are appended first and then read back from the beginning, or as a [`Shelf`] in any order.
pub(crate) struct Spill {
    file: SpooledTempFile,
    /// Path beside which the file is.
    path: PathBuf,
    length: u64,
}

impl Spill {
    /// An empty one on the disk of `path`, or of temporary files if that is in a store; it leaves nothing behind.
    pub(crate) fn beside(path: &Path) -> Self {
        if is_url(path) {
            return Self::temporary();
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self { file: tempfile::spooled_tempfile_in(ROOM, folder), path: path.to_owned(), length: 0 }
    }

    /// An empty one on the disk of temporary files.
    pub(crate) fn temporary() -> Self {
        Self::beside(&std::env::temp_dir().join("stillpoint"))
    }

    /// Appends bytes.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub(crate) fn push(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.length += bytes.len() as u64;
        self.file.write_all(bytes).map_err(Error::io("write temporary data beside it", &self.path))
    }

    /// Appends bytes as one item.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub(crate) fn push_item(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.push(&(bytes.len() as u64).to_le_bytes())?;
        self.push(bytes)
    }

    /// Rewinds to the beginning.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub(crate) fn rewind(&mut self) -> Result<(), Error> {
        self.file.rewind().map_err(Error::io("read temporary data beside it", &self.path))
    }

    /// Passes all bytes on, block by block.
    ///
    /// # Errors
    ///
    /// If the system refuses, or what `each` returns.
    pub(crate) fn read(&mut self, mut each: impl FnMut(&[u8]) -> Result<(), Error>) -> Result<(), Error> {
        self.rewind()?;
        let mut buffer = vec![0; ROOM.min(self.length as usize)];
        while self.length > 0 {
            buffer.truncate(self.length as usize);
            self.file.read_exact(&mut buffer).map_err(Error::io("read temporary data beside it", &self.path))?;
            each(&buffer)?;
            self.length -= buffer.len() as u64;
        }
        Ok(())
    }

    /// The next item; `None` behind the last.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub(crate) fn next_item(&mut self) -> Result<Option<Vec<u8>>, Error> {
        if self.length == 0 {
            return Ok(None);
        }
        let read = |file: &mut SpooledTempFile| -> io::Result<Vec<u8>> {
            let mut length = [0; 8];
            file.read_exact(&mut length)?;
            let mut item = vec![0; u64::from_le_bytes(length) as usize];
            file.read_exact(&mut item)?;
            Ok(item)
        };
        let item = read(&mut self.file).map_err(Error::io("read temporary data beside it", &self.path))?;
        self.length = self.length.saturating_sub(8 + item.len() as u64);
        Ok(Some(item))
    }
}

impl Shelf for Spill {
    fn append(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.file.seek(SeekFrom::End(0)).map_err(Error::io("write temporary data beside it", &self.path))?;
        self.push(bytes)
    }

    fn read_at(&mut self, at: u64, into: &mut [u8]) -> Result<(), Error> {
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(into));
        read.map_err(Error::io("read temporary data beside it", &self.path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_pushed_comes_back_in_memory_or_not() {
        let folder = tempfile::tempdir().unwrap();
        for size in [1, ROOM / 2, 3 * ROOM] {
            let mut items = Spill::beside(&folder.path().join("out.mcap"));
            let given: Vec<_> = (0..3).map(|n| vec![n; size * usize::from(n)]).collect();
            given.iter().for_each(|item| items.push_item(item).unwrap());
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "it has no name");
            items.rewind().unwrap();
            for item in &given {
                assert!(items.next_item().unwrap().as_ref() == Some(item));
            }
            assert_eq!(items.next_item().unwrap(), None);

            let mut bytes = Spill::beside(&folder.path().join("out.mcap"));
            given.iter().for_each(|item| bytes.push(item).unwrap());
            let mut back = Vec::new();
            let collect = |piece: &[u8]| {
                back.extend_from_slice(piece);
                Ok(())
            };
            bytes.read(collect).unwrap();
            assert!(back == given.concat());
        }
    }
}
