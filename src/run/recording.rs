//! A recording on disk: opening it, and reading it through a scan. What its messages mean is left to the caller.

use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::record::{Event, Inventory, Scan};

/// Reads of less would cost more than the bytes (1 MiB).
const READ: usize = 1 << 20;

/// To be called between pieces of work with the bytes of the recording that are done; an error gives the work up.
pub type Watch<'a> = &'a dyn Fn(u64) -> Result<(), Error>;

/// A recording, wherever its bytes stand in the file.
#[derive(Debug)]
pub struct Recording {
    file: File,
    path: PathBuf,
    /// Its bytes, as parts of the file one behind the other.
    parts: Vec<Range<u64>>,
}

impl Recording {
    /// Opens a file. All of it is the recording.
    ///
    /// # Errors
    ///
    /// If it is missing, empty, not a file, or may not be read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let file = File::open(path).map_err(Error::io("read", path))?;
        let metadata = file.metadata().map_err(Error::io("read", path))?;
        if metadata.is_dir() {
            let why = match path.join("metadata.yaml").exists() {
                true => "rosbag2 folders are not read yet; name the .mcap files in it",
                false => "is a folder; name the .mcap files in it",
            };
            return Err(Error::input(path, why));
        }
        if !metadata.is_file() {
            return Err(Error::input(path, "is not a regular file; save it as one first"));
        }
        Ok(Self { file, path: path.to_owned(), parts: vec![0..metadata.len()] })
    }

    /// TEMP
    pub fn open_original(path: &Path) -> Result<Self, Error> {
        Self::open(path)
    }

    /// TEMP
    pub fn open_annotated(path: &Path) -> Result<Self, Error> {
        Self::open(path)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its length in bytes.
    pub fn length(&self) -> u64 {
        self.parts.iter().map(|part| part.end - part.start).sum()
    }

    /// The file that its bytes stand in.
    pub(super) fn file(&self) -> &File {
        &self.file
    }

    /// Where in the file a range of the recording stands; what lies beyond its end stands nowhere.
    pub(super) fn parts_of(&self, range: Range<u64>) -> Vec<Range<u64>> {
        let mut begins = 0;
        let mut found = Vec::new();
        for part in &self.parts {
            let ends = begins + (part.end - part.start);
            let (from, until) = (range.start.max(begins), range.end.min(ends));
            if from < until {
                found.push(part.start + (from - begins)..part.start + (until - begins));
            }
            begins = ends;
        }
        found
    }

    /// Fills `buffer` with the bytes from `offset` on.
    ///
    /// # Errors
    ///
    /// If the system refuses, or the file has become shorter.
    pub(super) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> Result<(), Error> {
        let mut rest = buffer;
        for part in self.parts_of(offset..offset + rest.len() as u64) {
            let (now, later) = rest.split_at_mut((part.end - part.start) as usize);
            read_exact_at(&self.file, now, part.start).map_err(Error::io("read", &self.path))?;
            rest = later;
        }
        match rest.is_empty() {
            true => Ok(()),
            false => Err(Error::io("read", &self.path)(io::ErrorKind::UnexpectedEof.into())),
        }
    }

    /// Reads a range in blocks.
    ///
    /// # Errors
    ///
    /// If the system refuses, or what `watch` returns.
    pub(super) fn read(&self, range: Range<u64>, watch: Watch<'_>, mut each: impl FnMut(&[u8])) -> Result<(), Error> {
        let mut buffer = vec![0; READ.min(range.end.saturating_sub(range.start) as usize)];
        let mut from = range.start;
        while from < range.end {
            watch(from)?;
            buffer.truncate((range.end - from) as usize);
            self.read_exact_at(&mut buffer, from)?;
            each(&buffer);
            from += buffer.len() as u64;
        }
        Ok(())
    }

    /// Reads all of it, passing on what the scan tells.
    ///
    /// # Errors
    ///
    /// If it is not MCAP, if the system refuses, or what `watch` returns.
    pub fn scan(&self, watch: Watch<'_>, mut each: impl FnMut(Event<'_>)) -> Result<Inventory, Error> {
        let length = self.length();
        let mut scan = Scan::finished(length);
        loop {
            match scan.next_event().map_err(|e| Error::input(&self.path, e.to_string()))? {
                Event::Read { offset, length: wanted } => {
                    watch(offset)?;
                    let ahead = (length - offset).min(wanted.max(READ) as u64) as usize;
                    self.read_exact_at(scan.insert(ahead), offset)?;
                    scan.notify_read(ahead);
                }
                Event::Wait | Event::End => return Ok(scan.into_inventory()),
                event => each(event),
            }
        }
    }
}

#[cfg(unix)]
pub(super) fn read_exact_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}
