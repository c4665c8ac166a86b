//! What the system allows a process.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// Lets the process open as many files as the system allows at most: mostly it starts with leave for few (1024), and a
/// recording of many splits is open in all of them.
pub fn allow_many_files() {
    let limit = getrlimit(Resource::Nofile);
    // Where it is refused, the first file too many says so.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// Lets a file that would become longer than the process may make one be refused, as on a full disk, instead of ending
/// the process, for as long as what is returned is kept.
///
/// To be called within tokio's runtime.
pub fn outlive_file_size_limit() -> Option<Signal> {
    /// SIGXFSZ.
    const FILE_SIZE: i32 = 25;
    signal(SignalKind::from_raw(FILE_SIZE)).ok()
}
