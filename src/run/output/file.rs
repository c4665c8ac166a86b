//! Destination of a result: a new file, the recording itself, an existing file to compare with, or an object in a store.
//! [`record`](crate::record) makes the content.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::Error;
use crate::record::Piece;
use crate::run::input::recording::Recording;
use crate::run::output::in_place::{self, Access};
use crate::run::output::partial::{Partial, is_end};
use crate::run::output::reads::Reads;
use crate::run::output::spill::Spill;
use crate::run::output::written::Written;
use crate::run::store::{ResultMark, Upload, is_url};

/// Bytes of one copy: large enough for the kernel, small enough to stop between two (64 MiB).
const COPY: u64 = 64 << 20;

/// Receiver of a result, piece by piece.
pub(crate) struct Output {
    path: PathBuf,
    medium: Medium,
}

enum Medium {
    New(Partial),
    /// An existing file, and the number of bytes that equal the result so far.
    Existing(File, u64),
    /// The recording itself: offset of the change, and all new bytes, staged before the file is touched.
    Itself(u64, File),
    /// An object, which appears when it is complete.
    Object(Box<Upload>),
}

impl Output {
    /// Opens the output of that name. With `force`, an existing one is replaced, unless it is also read; else it is
    /// compared.
    pub(crate) fn open(path: &Path, force: bool, reads: &Reads) -> Result<Self, Error> {
        if is_url(path) {
            reads.refuse(path)?;
            return Ok(Self { path: path.to_owned(), medium: Medium::Object(Box::new(Upload::begin(path, force)?)) });
        }
        let medium = match std::fs::metadata(path) {
            Ok(metadata) if metadata.is_dir() => {
                return Err(Error::input(path, "is a folder; name a file with -o or use --out-dir"));
            }
            Ok(metadata) if !metadata.is_file() => return Err(Error::input(path, "is not a regular file")),
            Ok(_) => {
                let existing = in_place::open(path, Access::Read)?;
                if force { Medium::New(Partial::create(path, reads)?) } else { Medium::Existing(existing, 0) }
            }
            // A dangling link.
            Err(_) if !force && path.symlink_metadata().is_ok() => return Err(Error::Exists(path.to_owned())),
            Err(_) if force => Medium::New(Partial::create(path, reads)?),
            Err(_) => Medium::New(Partial::create_new(path)?),
        };
        Ok(Self { path: path.to_owned(), medium })
    }

    /// Notes the mark that an object gets, and its approximate length in bytes if that is known.
    pub(crate) fn mark(&mut self, mark: &ResultMark, length: u64) {
        if let Medium::Object(upload) = &mut self.medium {
            upload.mark(mark, length);
        }
    }

    /// The file of the recording as its own output; it must have been opened for [`Access::Change`].
    pub(crate) fn itself(recording: &Recording) -> Result<Self, Error> {
        in_place::check(changed(recording)?, recording.path())?;
        let path = recording.path().to_owned();
        let folder = path.canonicalize().ok().and_then(|path| path.parent().map(Path::to_owned)).unwrap_or_default();
        let staged = tempfile::tempfile_in(folder).map_err(Error::io("write temporary data beside it", &path))?;
        Ok(Self { path, medium: Medium::Itself(0, staged) })
    }

    /// Copies the recording ahead of the pieces, since the result mostly begins with it. May run while another thread
    /// reads the recording; `abandon` stops it.
    pub(crate) fn copy_ahead(&self, recording: &Recording, abandon: &AtomicBool) -> Result<(), Error> {
        let Medium::New(partial) = &self.medium else { return Ok(()) };
        // Of an object, only what is needed is read while it is learned from.
        if recording.source().is_object() {
            return Ok(());
        }
        let mut from = 0;
        while from < recording.length() && !abandon.load(Ordering::Relaxed) {
            let until = recording.length().min(from + COPY);
            copy(recording, from..until, partial.file()).map_err(Error::io("write", &self.path))?;
            from = until;
        }
        Ok(())
    }

    /// Path of the output.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Takes the first piece, the beginning of the recording, [copied ahead](Self::copy_ahead).
    pub(crate) fn keep(&mut self, range: Range<u64>, recording: &Recording) -> Result<(), Error> {
        match &mut self.medium {
            Medium::New(_) if recording.source().is_object() => self.put(&Piece::Original(range), recording),
            Medium::New(partial) => {
                let mut file = partial.file();
                let cut = file.set_len(range.end).and_then(|()| file.seek(SeekFrom::Start(range.end)));
                cut.map(|_| ()).map_err(Error::io("write", &self.path))
            }
            Medium::Existing(..) | Medium::Object(_) => self.put(&Piece::Original(range), recording),
            Medium::Itself(from, _) => {
                // What is in its place already needs no change.
                let stays =
                    recording.parts(range.clone()).next().filter(|part| part.start == 0).map_or(0, |part| part.end);
                *from = stays;
                self.put(&Piece::Original(stays..range.end), recording)
            }
        }
    }

    /// Takes a piece of the result.
    pub(crate) fn put(&mut self, piece: &Piece, recording: &Recording) -> Result<(), Error> {
        match (&mut self.medium, piece) {
            (Medium::New(partial), piece) => {
                append(piece, recording, partial.file()).map_err(|error| refused(error, &self.path))
            }
            (Medium::Object(upload), Piece::Bytes(bytes)) => upload.put(bytes),
            (Medium::Object(upload), Piece::Original(range)) => {
                recording.try_read(range.clone(), &|_| Ok(()), |bytes| upload.put(bytes))
            }
            (Medium::Object(_), Piece::Indexes(_)) => Ok(()),
            (Medium::Itself(_, staged), piece) => {
                append(piece, recording, staged).map_err(Error::io("write temporary data beside it", &self.path))
            }
            (Medium::Existing(file, equal), piece) => {
                let there = FileAt { file, path: &self.path };
                *equal = compare(&there, *equal, piece, recording)?.ok_or_else(|| Error::Exists(self.path.clone()))?;
                Ok(())
            }
        }
    }

    /// Takes the last pieces, with `indexes` in place of [`Piece::Indexes`].
    pub(crate) fn close(&mut self, pieces: Vec<Piece>, mut indexes: Spill, recording: &Recording) -> Result<(), Error> {
        for piece in pieces {
            match piece {
                Piece::Indexes(_) => indexes.read(|bytes| self.put(&Piece::Bytes(bytes.to_vec()), recording))?,
                piece => self.put(&piece, recording)?,
            }
        }
        Ok(())
    }

    /// Completes the result.
    pub(crate) fn finish(self, recording: &Recording, sync: bool) -> Result<Written, Error> {
        match self.medium {
            Medium::Object(upload) => upload.finish(),
            Medium::New(partial) => {
                let written = partial.file().try_clone().map_err(Error::io("write", &self.path))?;
                match partial.finish(sync) {
                    // Another process came first, and may have written the same.
                    Err(Error::Exists(path)) if is_copy(&written, &path)? => Ok(Written::Before),
                    finished => finished.map(|()| Written::Now),
                }
            }
            Medium::Itself(from, staged) => {
                let file = changed(recording)?;
                if is_end(file, from, &staged).map_err(Error::io("read", &self.path))? {
                    return Ok(Written::Before);
                }
                recording.check_unchanged()?;
                in_place::replace_end(file, &self.path, from, &staged).map(|()| Written::Now)
            }
            Medium::Existing(file, equal) => {
                match file.metadata().map_err(Error::io("read", &self.path))?.len() == equal {
                    true => Ok(Written::Before),
                    false => Err(Error::Exists(self.path)),
                }
            }
        }
    }
}

/// A refusal to write a file, or one to read the object that is copied into it.
fn refused(error: io::Error, path: &Path) -> Error {
    error.downcast::<Error>().unwrap_or_else(Error::io("write", path))
}

/// The file of a recording that is changed in place.
fn changed(recording: &Recording) -> Result<&File, Error> {
    let none = || Error::Usage(format!("{}: an object cannot be changed in place", recording.path().display()));
    recording.source().file().ok_or_else(none)
}

/// Whether a file has the same bytes as the one of this name.
fn is_copy(file: &File, path: &Path) -> Result<bool, Error> {
    let there = in_place::open(path, Access::Read)?;
    is_end(&there, 0, file).map_err(Error::io("read", path))
}

/// An existing file, and its name for errors.
struct FileAt<'a> {
    file: &'a File,
    path: &'a Path,
}

impl FileAt<'_> {
    /// Whether these bytes stand at an offset. What cannot be read is no difference.
    fn has(&self, at: u64, bytes: &[u8]) -> Result<bool, Error> {
        let mut found = vec![0; bytes.len()];
        match self.file.read_exact_at(&mut found, at) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
            read => read.map(|()| found == bytes).map_err(Error::io("read", self.path)),
        }
    }
}

fn append(piece: &Piece, recording: &Recording, mut to: &File) -> io::Result<()> {
    match piece {
        Piece::Original(range) => copy(recording, range.clone(), to),
        Piece::Bytes(bytes) => to.write_all(bytes),
        // Its bytes come from the spill.
        Piece::Indexes(_) => Ok(()),
    }
}

/// Copies a range. Between two files the kernel copies by itself, or shares the blocks where the file system can.
fn copy(recording: &Recording, range: Range<u64>, mut to: &File) -> io::Result<()> {
    let Some(mut from) = recording.source().file() else { return copy_object(recording, range, to) };
    for part in recording.parts(range) {
        from.seek(SeekFrom::Start(part.start))?;
        let length = part.end - part.start;
        if io::copy(&mut from.take(length), &mut to)? != length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
    Ok(())
}

/// Copies a range of an object, block by block.
fn copy_object(recording: &Recording, range: Range<u64>, mut to: &File) -> io::Result<()> {
    let each = |bytes: &[u8]| to.write_all(bytes).map_err(Error::io("write", recording.path()));
    recording.try_read(range, &|_| Ok(()), each).map_err(|error| match error {
        Error::Io { doing: "write", source, .. } => source,
        error => io::Error::other(error),
    })
}

/// Offset of the next piece if the file has `piece` at `at`; `None` if it differs.
fn compare(there: &FileAt<'_>, at: u64, piece: &Piece, recording: &Recording) -> Result<Option<u64>, Error> {
    match piece {
        Piece::Indexes(_) => Ok(Some(at)),
        Piece::Bytes(bytes) => Ok(there.has(at, bytes)?.then_some(at + bytes.len() as u64)),
        Piece::Original(range) => {
            let mut from = range.start;
            let mut buffer = vec![0; 1 << 20];
            while from < range.end {
                let length = (range.end - from).min(buffer.len() as u64) as usize;
                let Some(bytes) = buffer.get_mut(..length) else { break };
                recording.read_exact_at(bytes, from)?;
                if !there.has(at + (from - range.start), bytes)? {
                    return Ok(None);
                }
                from += length as u64;
            }
            Ok(Some(at + (range.end - range.start)))
        }
    }
}
