//! What makes a command fail, each in one line that says what, where, and the next step.
//!
//! Errors of the pure layers are wrapped here; exit codes are left to the program.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::{config, record};

/// Why a command, or its work on one recording, was given up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The command line contradicts itself.
    #[error("{0}")]
    Usage(String),
    /// The configuration is wrong.
    #[error(transparent)]
    Config(#[from] config::Error),
    /// The system refused.
    #[error("{}: cannot {doing}: {}", path.display(), Reason { doing, path, source })]
    Io {
        /// What was attempted, as a verb.
        doing: &'static str,
        /// On what.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The input cannot be worked on.
    #[error("{}: {why}", path.display())]
    Input {
        /// Which.
        path: PathBuf,
        /// Why not, and what to do.
        why: String,
    },
    /// The input was read, and is no recording, or none that can be annotated.
    #[error("{}: {why}", path.display())]
    Unfit {
        /// Which.
        path: PathBuf,
        /// Why not, and what to do.
        why: String,
    },
    /// The output exists and is something else.
    #[error("{}: exists and is not the result of this input and configuration; choose another name or replace it with --force", .0.display())]
    Exists(PathBuf),
    /// The output is one of the files that are read.
    #[error("{}: is itself read by this command; choose another name, or write into the recording with annotate --in-place", .0.display())]
    Itself(PathBuf),
    /// Another process is at work on the file.
    #[error("{}: another stillpoint is at work on this file; wait for it or choose another name", .0.display())]
    Busy(PathBuf),
    /// The work has taken longer than it may.
    #[error("took longer than {} s, as long as it may (--time-limit)", .0.as_secs())]
    Overdue(std::time::Duration),
    /// A signal asked to stop.
    #[error("stopped on request; nothing was left behind")]
    Stopped,
    /// A signal asked to stop, and what was done is kept.
    #[error("stopped on request; the same command goes on from here")]
    Paused,
}

impl Error {
    /// A refusal of the system, with what was attempted on which path.
    pub fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, path: path.to_owned(), source }
    }

    /// Whether there is no room for what is to be written.
    pub fn is_full(&self) -> bool {
        use io::ErrorKind::{QuotaExceeded, StorageFull};
        matches!(self, Self::Io { source, .. } if matches!(source.kind(), StorageFull | QuotaExceeded))
    }

    /// Whether the same may succeed later: it is the device, the network or the system that is in trouble.
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
        let code = |source: &io::Error| source.raw_os_error().map(Errno::from_raw_os_error);
        matches!(self, Self::Io { source, .. } if code(source).is_some_and(|code| PASSING.contains(&code)))
    }

    /// What reading records came to: trouble of the system, or an input that cannot be worked on.
    pub fn reading(path: &Path) -> impl FnOnce(record::Error) -> Self {
        move |error| match error {
            record::Error::Read { cause, .. } => Self::io("read", path)(cause),
            error => Self::input(path, error.to_string()),
        }
    }

    /// An input that cannot be worked on.
    pub fn input(path: &Path, why: impl Into<String>) -> Self {
        Self::Input { path: path.to_owned(), why: why.into() }
    }

    /// An input that is no recording, or none that can be annotated.
    pub fn unfit(path: &Path, why: impl Into<String>) -> Self {
        Self::Unfit { path: path.to_owned(), why: why.into() }
    }
}

/// The commonest refusals with the next step.
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
            io::ErrorKind::FileTooLarge => "the file system or a limit allows no file of this size",
            _ => return self.source.fmt(f),
        })
    }
}

impl Reason<'_> {
    /// The folder that a file should be written into, if that is what is missing.
    fn missing_folder(&self) -> Option<&Path> {
        let folder = self.path.parent().filter(|folder| self.doing == "write" && !folder.as_os_str().is_empty())?;
        (!folder.exists()).then_some(folder)
    }
}
