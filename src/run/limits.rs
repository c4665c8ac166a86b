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
    let Some(limit) = open_files() else { return };
    // If this is refused, opening one file too many reports it.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// Limit of open files; `None` where the system does not tell. The call that asks for it counts on an answer, which a
/// sandbox may refuse, so Linux is asked by its file.
fn open_files() -> Option<Rlimit> {
    if !cfg!(target_os = "linux") {
        return Some(getrlimit(Resource::Nofile));
    }
    parse(&std::fs::read_to_string("/proc/self/limits").ok()?)
}

/// Limit of open files in the text of `/proc/self/limits`.
fn parse(text: &str) -> Option<Rlimit> {
    let mut numbers = text.lines().find_map(|line| line.strip_prefix("Max open files"))?.split_whitespace();
    // The outer `None` is a fault, the inner one no limit.
    let mut next = || match numbers.next()? {
        "unlimited" => Some(None),
        number => number.parse().ok().map(Some),
    };
    Some(Rlimit { current: next()?, maximum: next()? })
}

/// Refuses a recording of so many files of which more would be open at a time than the process may have: `each` for
/// every one of them.
///
/// # Errors
///
/// If the limit is too low, with the one that suffices.
pub(crate) fn check_files(path: &Path, files: usize, each: u64) -> Result<(), Error> {
    let Some(limit) = open_files().and_then(|limit| limit.current) else { return Ok(()) };
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_open_files_is_read_off_the_file_of_the_system() {
        let text = "Limit                     Soft Limit           Hard Limit           Units     \n\
                    Max processes             31340                31340                processes \n\
                    Max open files            1024                 unlimited            files     \n";
        assert_eq!(parse(text), Some(Rlimit { current: Some(1024), maximum: None }));
        assert_eq!(parse("Max open files            1024"), None);
        assert_eq!(parse("Max open files            many                 more"), None);
        assert_eq!(parse(""), None);
        if cfg!(target_os = "linux") {
            assert_eq!(open_files(), Some(getrlimit(Resource::Nofile)), "the same as by the call");
        }
    }
}
