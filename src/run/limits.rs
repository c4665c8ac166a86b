//! Resource limits of the process.

use std::path::Path;

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::signal::unix::{Signal, SignalKind, signal};

use crate::Error;

/// Files that are open beside those of the recording.
const OTHERS: u64 = 24;

/// Lets the process open as many files as the system allows: the usual limit is low (1024), and a recording of many
/// splits has all of them open.
pub fn allow_many_files() {
    let limit = getrlimit(Resource::Nofile);
    // If this is refused, opening one file too many reports it.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// Refuses a recording of so many files of which more would be open at a time than the process may have: `each` for
/// every one of them.
///
/// # Errors
///
/// If the limit is too low, with the one that suffices.
pub(crate) fn check_files(path: &Path, files: usize, each: u64) -> Result<(), Error> {
    let Some(limit) = getrlimit(Resource::Nofile).current else { return Ok(()) };
    let needed = each * files as u64 + OTHERS;
    if files < 2 || needed <= limit {
        return Ok(());
    }
    let fewer = if each > 1 { ", or write a copy (-o) or --sidecar, which need fewer" } else { "" };
    Err(Error::input(
        path,
        format!(
            "{files} files are one recording, for which {needed} files are open at a time, and this process may open {limit}: raise \
             the limit (ulimit -n {needed}){fewer}"
        ),
    ))
}

/// Makes writing beyond the file-size limit fail, like on a full disk, instead of ending the process, while the
/// returned value lives.
///
/// To be called within tokio's runtime.
pub fn outlive_file_size_limit() -> Option<Signal> {
    /// SIGXFSZ.
    const FILE_SIZE: i32 = 25;
    signal(SignalKind::from_raw(FILE_SIZE)).ok()
}
