//! The `stillpoint` program: arguments → command → exit code.

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::panic;
use std::thread;
use std::time::Duration;

use clap::Parser as _;
use stillpoint::run::{self, Stop};
use tokio::runtime::{Builder, Runtime};

use crate::{cli, commands, console};

/// Longest wait for work to stop after a signal. Work that does not yield is abandoned: incomplete files have no names
/// yet.
const PATIENCE: Duration = Duration::from_secs(4);

/// Runs the program with these arguments, its own name first, and returns its exit code. To be called once in a process:
/// it takes the process's signals and standard streams, and exits by itself where the command line is wrong.
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = cli::Cli::try_parse_from(args).unwrap_or_else(|error| refuse(&error));
    console::log_to_stderr(&cli);
    run::allow_many_files();

    let stop = Stop::default();
    if let Err(why) = listen(stop.clone()) {
        tracing::error!("cannot listen for signals: {why}");
        return 1;
    }
    let code = commands::run(cli, &stop).number();
    // A process that is not Rust's does not flush it at its end.
    let _ = io::stdout().flush();
    stop.signal().map_or(code, |signal| 128 + signal)
}

/// Reports an error in the command line, and exits. An invalid value is reported in one line, like every other error.
fn refuse(error: &clap::Error) -> ! {
    if error.kind() == clap::error::ErrorKind::ValueValidation {
        let text = error.to_string();
        eprintln!("{}", stillpoint::printable(text.lines().next().unwrap_or_default()));
        std::process::exit(2);
    }
    error.exit()
}

/// Listens for signals on a thread of its own.
fn listen(stop: Stop) -> Result<(), String> {
    let runtime = runtime()?;
    let beyond = runtime.block_on(async { run::outlive_file_size_limit() });
    let signals = async move {
        let _beyond = beyond;
        tokio::spawn(stop.clone().on_signal());
        let signal = stop.overdue(PATIENCE).await;
        tracing::error!("stopped on request, in the midst of work that did not yield");
        std::process::exit(128 + i32::from(signal))
    };
    let spawned = thread::Builder::new().name("signals".to_owned()).spawn(move || runtime.block_on(signals));
    spawned.map(drop).map_err(|error| error.to_string())
}

fn runtime() -> Result<Runtime, String> {
    // Where the system refuses a file descriptor, tokio panics.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let built = panic::catch_unwind(|| Builder::new_current_thread().enable_all().build());
    panic::set_hook(hook);
    match built {
        Ok(runtime) => runtime.map_err(|error| error.to_string()),
        Err(_) => Err("the system refuses a file for it, see ulimit -n".to_owned()),
    }
}
