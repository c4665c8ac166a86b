//! Source of a recording's bytes: a file, or an object in a store.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

use crate::Error;
use crate::run::output::in_place::{self, Access};
use crate::run::store::{Object, is_url};

/// Bytes that can be read from any offset.
#[derive(Debug)]
pub(crate) enum Source {
    /// A file, with its length in bytes and its modification time when it was opened.
    File(File, (u64, SystemTime)),
    /// An object.
    Object(Arc<Object>),
}

impl Source {
    /// Opens a file or an object.
    pub(crate) fn open(path: &Path, access: Access) -> Result<Self, Error> {
        if is_url(path) {
            return match access {
                Access::Read => Ok(Self::Object(Arc::new(Object::open(path)?))),
                Access::Change => {
                    Err(Error::Usage(format!("{}: an object cannot be changed in place", path.display())))
                }
            };
        }
        let file = in_place::open(path, access)?;
        let state = state(&file).map_err(Error::io("read", path))?;
        Ok(Self::File(file, state))
    }

    /// A file that is already open, of this length.
    pub(crate) fn of_file(file: File, length: u64) -> Self {
        Self::File(file, (length, SystemTime::UNIX_EPOCH))
    }

    /// A second handle to the same.
    pub(crate) fn again(&self) -> io::Result<Self> {
        Ok(match self {
            Self::File(file, state) => Self::File(file.try_clone()?, *state),
            Self::Object(object) => Self::Object(Arc::clone(object)),
        })
    }

    /// Length in bytes.
    pub(crate) fn length(&self) -> u64 {
        match self {
            Self::File(_, (length, _)) => *length,
            Self::Object(object) => object.length(),
        }
    }

    /// Length and, of an object, its version.
    pub(crate) fn identity(&self) -> String {
        match self {
            Self::File(_, (length, _)) => length.to_string(),
            Self::Object(object) => object.identity(),
        }
    }

    /// Whether it is as it was when it was opened. An object is never read otherwise.
    pub(crate) fn is_unchanged(&self) -> bool {
        match self {
            Self::File(file, before) => state(file).is_ok_and(|now| now == *before),
            Self::Object(_) => true,
        }
    }

    pub(crate) fn is_object(&self) -> bool {
        matches!(self, Self::Object(_))
    }

    /// The object, if it is one.
    pub(crate) fn object(&self) -> Option<&Object> {
        match self {
            Self::File(..) => None,
            Self::Object(object) => Some(object),
        }
    }

    /// The file, if it is one.
    pub(crate) fn file(&self) -> Option<&File> {
        match self {
            Self::File(file, _) => Some(file),
            Self::Object(_) => None,
        }
    }

    /// Fills `buffer` with the bytes from `offset` on.
    pub(crate) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        match self {
            Self::File(file, _) => file.read_exact_at(buffer, offset),
            Self::Object(object) => object.read_exact_at(buffer, offset),
        }
    }
}

fn state(file: &File) -> io::Result<(u64, SystemTime)> {
    let metadata = file.metadata()?;
    Ok((metadata.len(), metadata.modified()?))
}
