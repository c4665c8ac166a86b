//! Errors that make a command fail, each in one line that says what, where, and the next step.
//!
//! Errors of the pure layers are wrapped here; the program maps errors to exit codes.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::{config, record};

/// Reason why a command, or its work on one recording, was given up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The command line contradicts itself.
    #[error("{0}")]
    Usage(String),
    /// The configuration is wrong.
    #[error(transparent)]
    Config(#[from] config::Error),
    /// The system refused an operation.
    #[error("{}: cannot {doing}: {}", path.display(), Reason { doing, path, source })]
    Io {
        /// The attempted operation, as a verb.
        doing: &'static str,
        /// Its path.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// A store could not be reached, or is in trouble that passes.
    #[error("{}: cannot {doing}: {why}; the same command may succeed later", path.display())]
    OutOfReach {
        /// The attempted operation, as a verb.
        doing: &'static str,
        /// Its path.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The input cannot be processed.
    #[error("{}: {why}", path.display())]
    Input {
        /// Its path.
        path: PathBuf,
        /// The reason, and what to do.
        why: String,
    },
    /// The input was read, and is not a recording, or cannot be annotated.
    #[error("{}: {why}", path.display())]
    Unfit {
        /// Its path.
        path: PathBuf,
        /// The reason, and what to do.
        why: String,
    },
    /// The output exists and is something else.
    #[error("{}: exists and is not the result of this input and configuration; choose another name or replace it with --force", .0.display())]
    Exists(PathBuf),
    /// The output is one of the files that are read.
    #[error("{}: is itself read by this command; choose another name", .0.display())]
    Itself(PathBuf),
    /// The output of an annotation is one of the files that are read.
    #[error("{}: is itself read by this command; choose another name (annotate --in-place writes into a recording)", .0.display())]
    ItselfAnnotated(PathBuf),
    /// Another process is at work on the file.
    #[error("{}: another stillpoint is at work on this file; wait for it or choose another name", .0.display())]
    Busy(PathBuf),
    /// The work exceeded its time limit.
    #[error("took longer than {} s, as long as it may (--time-limit)", .0.as_secs())]
    Overdue(std::time::Duration),
    /// A signal requested to stop.
    #[error("stopped on request; nothing was left behind")]
    Stopped,
    /// A signal requested to stop, and the finished work is kept.
    #[error("stopped on request; the same command goes on from here")]
    Paused,
}

impl Error {
    /// A refusal by the system, with the attempted operation and its path.
    pub fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, path: path.to_owned(), source }
    }

    /// The same of an annotation, which may be written into the recording.
    #[must_use]
    pub fn of_annotating(self) -> Self {
        match self {
            Self::Itself(path) => Self::ItselfAnnotated(path),
            error => error,
        }
    }

    /// Whether the device or quota is full.
    pub fn is_full(&self) -> bool {
        use io::ErrorKind::{QuotaExceeded, StorageFull};
        matches!(self, Self::Io { source, .. } if matches!(source.kind(), StorageFull | QuotaExceeded))
    }

    /// Whether a retry may succeed: the device, the network or the system is in trouble, not the input.
    pub fn is_passing(&self) -> bool {
        use rustix::io::Errno;
        const PASSING: [Errno; 19] = [
            Errno::IO,
            Errno::STALE,
            Errno::NOSPC,
            Errno::DQUOT,
            Errno::INTR,
            Errno::AGAIN,
            Errno::NOMEM,
            Errno::NFILE,
            Errno::MFILE,
            Errno::TIMEDOUT,
            Errno::NETDOWN,
            Errno::NETUNREACH,
            Errno::HOSTDOWN,
            Errno::HOSTUNREACH,
            Errno::CONNRESET,
            Errno::CONNABORTED,
            Errno::NOTCONN,
            Errno::NOLCK,
            Errno::NXIO,
        ];
        if matches!(self, Self::OutOfReach { .. }) {
            return true;
        }
        let code = |source: &io::Error| source.raw_os_error().map(Errno::from_raw_os_error);
        matches!(self, Self::Io { source, .. } if code(source).is_some_and(|code| PASSING.contains(&code)))
    }

    /// Error of reading records: trouble of the system, or an input that cannot be processed.
    pub fn reading(path: &Path) -> impl FnOnce(record::Error) -> Self {
        move |error| match error {
            record::Error::Read { cause, .. } => Self::of_bytes(path)(cause),
            error => Self::input(path, error.to_string()),
        }
    }

    /// Error of reading bytes: a refusal of the system, or one that a store gave in its place.
    pub(crate) fn of_bytes(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| match error.downcast::<Self>() {
            Ok(error) => error,
            Err(error) => Self::io("read", path)(error),
        }
    }

    /// An input that cannot be processed.
    pub fn input(path: &Path, why: impl Into<String>) -> Self {
        Self::Input { path: path.to_owned(), why: why.into() }
    }

    /// An input that is not a recording, or cannot be annotated.
    pub fn unfit(path: &Path, why: impl Into<String>) -> Self {
        Self::Unfit { path: path.to_owned(), why: why.into() }
    }
}

/// Text of a refusal; the most common ones with the next step.
struct Reason<'a> {
    doing: &'a str,
    path: &'a Path,
    source: &'a io::Error,
}

impl fmt::Display for Reason<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reads = self.doing.starts_with("read");
        f.write_str(match self.source.kind() {
            io::ErrorKind::NotFound if reads && self.path.to_string_lossy().contains(['*', '?']) => {
                "no such file: nothing matches the pattern here"
            }
            io::ErrorKind::NotFound => match self.missing_folder() {
                Some(folder) => {
                    let folder = folder.display();
                    return write!(f, "no such folder as {folder}; make it (mkdir -p {folder}) or choose another");
                }
                None => "no such file or folder",
            },
            io::ErrorKind::AddrInUse => "another program listens there; stop it, or name another port",
            io::ErrorKind::AddrNotAvailable => {
                "this machine has no such address; 127.0.0.1 is for itself alone, 0.0.0.0 for everybody"
            }
            io::ErrorKind::PermissionDenied if self.doing == "listen on" => {
                "permission denied; ports below 1024 are the system's, name another one"
            }
            io::ErrorKind::PermissionDenied => "permission denied; check its owner and mode, or use another folder",
            io::ErrorKind::NotADirectory => "a part of its path is a file, no folder",
            io::ErrorKind::IsADirectory => "is a folder; name a file",
            io::ErrorKind::InvalidFilename => "the name is too long for the file system",
            io::ErrorKind::ReadOnlyFilesystem => "the file system is read-only; choose another folder with -o",
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "no space left; free some or choose another disk with -o"
            }
            io::ErrorKind::UnexpectedEof => "it became shorter while it was read",
            _ if self.source.raw_os_error() == Some(rustix::io::Errno::MFILE.raw_os_error()) => {
                "this process may open no more files at a time; raise the limit (ulimit -n)"
            }
            io::ErrorKind::FileTooLarge => "the file system or a limit allows no file of this size",
            _ => return self.source.fmt(f),
        })
    }
}

impl Reason<'_> {
    /// The missing folder into which a file should be written, if that is the cause.
    fn missing_folder(&self) -> Option<&Path> {
        let folder = self.path.parent().filter(|folder| self.doing == "write" && !folder.as_os_str().is_empty())?;
        (!folder.exists()).then_some(folder)
    }
}
