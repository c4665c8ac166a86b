//! Runtimes of tokio, where the system may refuse what they need.

use std::io;
use std::panic::{self, UnwindSafe};

use tokio::runtime::Runtime;

/// Builds a runtime. Where the system refuses a file descriptor or a thread for it, tokio panics, and here that is an error.
///
/// # Errors
///
/// If the system refuses what it needs.
pub fn runtime(build: impl FnOnce() -> io::Result<Runtime> + UnwindSafe) -> io::Result<Runtime> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let built = panic::catch_unwind(build);
    panic::set_hook(hook);
    built
        .unwrap_or_else(|_| Err(io::Error::other("the system refuses a file or a thread for it, see ulimit -n and -u")))
}
