//! The `stillpoint` program: arguments → command → exit code.

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::thread;
use std::time::Duration;

use clap::{CommandFactory as _, Parser as _};
use stillpoint::run::{self, Stop};
use tokio::runtime::Builder;

use crate::{cli, commands, console};

/// Longest wait for work to stop after a signal. Work that does not yield is abandoned: incomplete files have no names
/// yet.
const PATIENCE: Duration = Duration::from_secs(4);

/// Runs the program with these arguments, its own name first, and returns its exit code. To be called once in a process:
/// it takes the process's signals and standard streams, and exits by itself where the command line is wrong.
pub fn run(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args: Vec<_> = args.into_iter().collect();
    let stop = Stop::default();
    // First of all: help, too, may be written to a file that must not grow.
    let listening = listen(stop.clone());
    let cli = cli::Cli::try_parse_from(&args).unwrap_or_else(|error| refuse(&error, &args));
    console::log_to_stderr(&cli);
    run::allow_many_files();
    if let Err(why) = listening {
        tracing::error!("cannot listen for signals: {why}");
        return 1;
    }
    let code = commands::run(cli, &stop).number();
    // A process that is not Rust's does not flush it at its end.
    let _ = io::stdout().flush();
    stop.signal().map_or(code, |signal| 128 + signal)
}

/// Reports an error in the command line in one line, like every other error, and exits. Help that is asked for is printed
/// as it is.
fn refuse(error: &clap::Error, args: &[OsString]) -> ! {
    use clap::error::ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    match error.kind() {
        DisplayHelp | DisplayHelpOnMissingArgumentOrSubcommand | DisplayVersion => error.exit(),
        // Where standard error cannot be written to, the exit code says it all.
        _ => drop(writeln!(io::stderr(), "{}", stillpoint::printable(&mistake(error, args)))),
    }
    std::process::exit(2);
}

/// A mistake in the command line: what and where, what may have been meant, and which help says more.
fn mistake(error: &clap::Error, args: &[OsString]) -> String {
    let text = error.to_string();
    let trimmed = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut lines = text.lines();
    let what: Vec<_> = lines.by_ref().map(trimmed).take_while(|line| !line.is_empty()).collect();
    // A value that is wrong says what is right.
    if error.kind() == clap::error::ErrorKind::ValueValidation {
        return what.join(" ");
    }
    let tips: Vec<_> = lines.clone().filter_map(|line| line.trim().strip_prefix("tip: ")).map(trimmed).collect();
    let usage = lines.find_map(|line| line.strip_prefix("Usage: ")).unwrap_or_default();
    let is_verb = |word: &&str| word.starts_with(|c: char| c.is_ascii_lowercase());
    let mut verbs: Vec<_> = usage.split_whitespace().skip(1).take_while(is_verb).collect();
    let program = cli::Cli::command();
    if verbs.is_empty() {
        // Values have no usage.
        let typed = args.iter().skip(1).filter_map(|word| program.find_subcommand(word));
        verbs.extend(typed.map(clap::Command::get_name).take(1));
    }
    let help = ["stillpoint"].into_iter().chain(verbs).chain(["--help"]).collect::<Vec<_>>().join(" ");
    [what.join(" ")].into_iter().chain(tips).chain([format!("see {help}")]).collect::<Vec<_>>().join("; ")
}

/// Listens for signals, from now on, on a thread of its own.
fn listen(stop: Stop) -> Result<(), String> {
    let runtime = run::runtime(|| Builder::new_current_thread().enable_all().build());
    let runtime = runtime.map_err(|error| error.to_string())?;
    let (beyond, requested) = runtime.block_on(async { (run::outlive_file_size_limit(), stop.clone().on_signal()) });
    let requested = requested.map_err(|error| error.to_string())?;
    let signals = async move {
        let _beyond = beyond;
        tokio::spawn(requested);
        let signal = stop.overdue(PATIENCE).await;
        tracing::error!("stopped on request, in the midst of work that did not yield");
        std::process::exit(128 + i32::from(signal))
    };
    let spawned = thread::Builder::new().name("signals".to_owned()).spawn(move || runtime.block_on(signals));
    spawned.map(drop).map_err(|error| error.to_string())
}
