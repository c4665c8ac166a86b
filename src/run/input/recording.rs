//! A recording on disk or in a store: opening it and reading its bytes. The caller interprets its messages.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::record::{self, Event, FileKind, Inventory, Limits, Original, ReadAt, recognise, recognise_scanned};
use crate::run::input::source::Source;
use crate::run::output::in_place::Access;

/// Block size of reading; smaller reads would cost more than their bytes (1 MiB).
const READ: usize = 1 << 20;
/// The same where each block is a request (8 MiB).
const REQUEST: usize = 8 << 20;
/// Callback between pieces of work, given the number of bytes that are done; its error stops the work.
pub type Watch<'a> = &'a dyn Fn(u64) -> Result<(), Error>;

/// A recording, wherever its bytes are in the file.
#[derive(Debug)]
pub struct Recording {
    source: Source,
    path: PathBuf,
    original: Original,
    /// Configuration of the annotations beside the original, as TOML.
    annotated_with: Option<String>,
    /// Sign that another program edited the file after it was annotated.
    edited: Option<&'static str>,
}

impl Recording {
    /// Opens a file. The recording is all of it.
    ///
    /// # Errors
    ///
    /// If it is missing, empty, not a file, or may not be read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::open_for(path, Access::Read)
    }

    fn open_for(path: &Path, access: Access) -> Result<Self, Error> {
        let source = Source::open(path, access)?;
        let original = Original::whole(source.length());
        Ok(Self { source, path: path.to_owned(), original, annotated_with: None, edited: None })
    }

    /// A recording of this length whose file is already open.
    pub(crate) fn of_file(file: File, path: &Path, length: u64) -> Self {
        let (source, original) = (Source::of_file(file, length), Original::whole(length));
        Self { source, path: path.to_owned(), original, annotated_with: None, edited: None }
    }

    /// The original in the file, if Stillpoint annotated it.
    pub(crate) fn original_in_it(&self, inventory: &Inventory) -> Result<Option<Self>, Error> {
        match self.kind()? {
            FileKind::Annotated { original, mut settings, .. } => {
                Ok(Some(Self { original, annotated_with: settings.remove("configuration"), ..self.again()? }))
            }
            FileKind::Sidecar { .. } => Err(self.is_a_sidecar()),
            FileKind::Recording | FileKind::Edited { .. } => self.original_within(inventory),
        }
    }

    fn is_a_sidecar(&self) -> Error {
        Error::input(&self.path, "holds annotations alone; name the recording they belong to")
    }

    /// Opens a file. The recording is the original in it if Stillpoint annotated it, else all of it.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open), and if the file holds annotations alone.
    pub fn open_original(path: &Path, access: Access) -> Result<Self, Error> {
        let file = Self::open_for(path, access)?;
        match file.kind()? {
            FileKind::Recording => Ok(file),
            FileKind::Annotated { original, mut settings, .. } => {
                Ok(Self { original, annotated_with: settings.remove("configuration"), ..file })
            }
            FileKind::Sidecar { .. } => Err(file.is_a_sidecar()),
            FileKind::Edited { why } => Ok(Self { edited: Some(why), ..file }),
        }
    }

    /// Note on a recording that was changed after it was annotated, if it was.
    pub(crate) fn edit(&self) -> Option<String> {
        let why = self.edited?;
        Some(format!("was annotated, then edited by another program, or damaged ({why}); what it holds now stays"))
    }

    /// Opens a file that Stillpoint annotated. The recording is the original in it.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open), and if the file holds no original, or was edited since.
    pub fn open_annotated(path: &Path) -> Result<Self, Error> {
        let file = Self::open(path)?;
        let mut kind = file.kind()?;
        if kind == FileKind::Recording {
            let inventory = file.scan(Limits::default(), &|_| Ok(()), &mut |_: Event<'_>| Ok(()))?;
            kind = file.recognise(|bytes| recognise_scanned(bytes, &inventory))?;
        }
        match kind {
            FileKind::Annotated { original, .. } => Ok(Self { original, ..file }),
            FileKind::Recording => {
                Err(Error::input(path, "was not annotated by Stillpoint: there is nothing to strip"))
            }
            FileKind::Sidecar { .. } => Err(Error::input(path, "holds annotations alone: there is no original in it")),
            FileKind::Edited { why } => Err(Error::input(
                path,
                format!("was edited or damaged since it was annotated ({why}): the original is lost"),
            )),
        }
    }

    /// Settings that determined the annotations in the file, if Stillpoint wrote it and nothing changed it since.
    pub(crate) fn settings(&self) -> Result<Option<BTreeMap<String, String>>, Error> {
        Ok(match self.recognise(|bytes| recognise(bytes, self.length()))? {
            FileKind::Annotated { settings, .. } | FileKind::Sidecar { settings } => Some(settings),
            FileKind::Recording | FileKind::Edited { .. } => None,
        })
    }

    /// The original in an annotated recording if its damage does not show in the copy.
    pub(crate) fn damaged_original(&self) -> Result<Option<Self>, Error> {
        match self.recognise(|bytes| recognise(bytes, self.length()))? {
            FileKind::Annotated { original, damaged: true, .. } => Ok(Some(Self { original, ..self.again()? })),
            _ => Ok(None),
        }
    }

    /// Configuration of the annotations beside the original, as TOML, if it was opened for the original.
    pub(crate) fn annotated_with(&self) -> Option<&str> {
        self.annotated_with.as_deref()
    }

    /// The original in an annotated recording that lost its end, which only a scan can recognise.
    pub(crate) fn original_within(&self, inventory: &Inventory) -> Result<Option<Self>, Error> {
        if self.original != Original::whole(self.length()) {
            return Ok(None);
        }
        match self.recognise(|bytes| recognise_scanned(bytes, inventory))? {
            FileKind::Annotated { original, mut settings, .. } => {
                Ok(Some(Self { original, annotated_with: settings.remove("configuration"), ..self.again()? }))
            }
            _ => Ok(None),
        }
    }

    /// A second handle to the same open file; it keeps the lock.
    pub(crate) fn again(&self) -> Result<Self, Error> {
        let source = self.source.again().map_err(Error::io("read", &self.path))?;
        let (path, original) = (self.path.clone(), self.original.clone());
        Ok(Self { source, path, original, annotated_with: self.annotated_with.clone(), edited: self.edited })
    }

    /// Log time of the first message, in nanoseconds; `None` without messages.
    pub(crate) fn first_log_time(&self) -> Result<Option<u64>, Error> {
        let mut first = None;
        let found = self.scan(Limits::default(), &|_| Ok(()), &mut |event: Event<'_>| match event {
            Event::Message(message) => {
                first = Some(message.log_time);
                Err(Error::Stopped)
            }
            _ => Ok(()),
        });
        match found {
            Err(error) if first.is_none() => Err(error),
            _ => Ok(first),
        }
    }

    /// Whether length and modification time of its file are those from when it was opened.
    pub(crate) fn is_unchanged(&self) -> bool {
        self.source.is_unchanged()
    }

    /// Refuses the recording if its file changed since it was opened.
    pub(crate) fn check_unchanged(&self) -> Result<(), Error> {
        match self.is_unchanged() {
            true => Ok(()),
            false => Err(Error::input(&self.path, "changed while it was read: is it still being recorded?")),
        }
    }

    /// Kind of the file, as far as its end tells.
    pub(crate) fn kind(&self) -> Result<FileKind, Error> {
        self.recognise(|bytes| recognise(bytes, self.length()))
    }

    fn recognise(
        &self,
        look: impl FnOnce(&mut Bytes<'_>) -> Result<FileKind, record::Error>,
    ) -> Result<FileKind, Error> {
        look(&mut Bytes(&self.source)).map_err(Error::reading(&self.path))
    }

    /// Path of its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length in bytes.
    pub fn length(&self) -> u64 {
        self.original.length()
    }

    /// Source of its bytes, and of others if it is an original in an annotated recording.
    pub(crate) fn source(&self) -> &Source {
        &self.source
    }

    /// Length and, of an object, version, which tell it from other recordings of the same name.
    pub(crate) fn identity(&self) -> String {
        self.source.identity()
    }

    /// Byte ranges of the file that hold a range of the recording, in order.
    pub(crate) fn parts(&self, range: Range<u64>) -> impl Iterator<Item = Range<u64>> + use<> {
        self.original.pieces(range)
    }

    /// Fills `buffer` with the bytes from `offset` on.
    ///
    /// # Errors
    ///
    /// If the system refuses, or the file has become shorter.
    pub(crate) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> Result<(), Error> {
        let mut rest = buffer;
        for part in self.parts(offset..offset + rest.len() as u64) {
            let (now, later) = rest.split_at_mut((part.end - part.start) as usize);
            self.source.read_exact_at(now, part.start).map_err(Error::of_bytes(&self.path))?;
            rest = later;
        }
        match rest.is_empty() {
            true => Ok(()),
            false => Err(Error::io("read", &self.path)(io::ErrorKind::UnexpectedEof.into())),
        }
    }

    /// Reads a range block by block.
    ///
    /// # Errors
    ///
    /// If the system refuses, or what `watch` returns.
    pub(crate) fn read(&self, range: Range<u64>, watch: Watch<'_>, mut each: impl FnMut(&[u8])) -> Result<(), Error> {
        self.try_read(range, watch, |bytes| {
            each(bytes);
            Ok(())
        })
    }

    /// The same, until `each` returns an error.
    pub(crate) fn try_read(
        &self,
        range: Range<u64>,
        watch: Watch<'_>,
        mut each: impl FnMut(&[u8]) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let block = if self.source.is_object() { REQUEST } else { READ };
        let mut buffer = vec![0; block.min(range.end.saturating_sub(range.start) as usize)];
        let mut from = range.start;
        while from < range.end {
            watch(from)?;
            buffer.truncate((range.end - from) as usize);
            self.read_exact_at(&mut buffer, from)?;
            each(&buffer)?;
            from += buffer.len() as u64;
        }
        Ok(())
    }
}

struct Bytes<'a>(&'a Source);

impl ReadAt for Bytes<'_> {
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        self.0.read_exact_at(buffer, offset)
    }
}

/// Bytes of a recording, wherever they are in its file.
pub(crate) struct Within<'a>(pub(crate) &'a Recording);

impl ReadAt for Within<'_> {
    fn read_at(&mut self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        self.0.read_exact_at(buffer, offset).map_err(|error| match error {
            Error::Io { source, .. } => source,
            error => io::Error::other(error),
        })
    }
}
