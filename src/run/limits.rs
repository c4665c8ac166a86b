//! Resource limits of the process.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// Lets the process open as many files as the system allows: the usual limit is low (1024), and a recording of many
/// splits has all of them open.
pub fn allow_many_files() {
    let limit = getrlimit(Resource::Nofile);
    // If this is refused, opening one file too many reports it.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
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
