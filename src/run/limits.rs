//! What the system allows a process.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Lets the process open as many files as the system allows at most: mostly it starts with leave for few (1024), and a
/// recording of many splits is open in all of them.
pub fn allow_many_files() {
    let limit = getrlimit(Resource::Nofile);
    // Where it is refused, the first file too many says so.
    let _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}
