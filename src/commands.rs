//! One module per verb: arguments → work of the library → printed result.

mod annotate;
mod config;
mod export;
mod import;
mod listing;
mod manifest;
mod merge;
mod progress;
mod repair;
mod report;
mod shard;
mod shell;
mod simulate;
mod stream;
mod strip;
mod summary;
mod table;
mod tail;
mod text;
mod topics;
mod view;
mod watch;

use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use stillpoint::config::{Config, Layer};
use stillpoint::run::{self, Partial, Reads, Stop};
use stillpoint::{Error, printable_json};

use crate::cli::{Cli, Command, Configuration};

/// Runs a command to its end; reports an error that made it fail.
pub fn run(cli: Cli, stop: &Stop) -> Code {
    let json = cli.json;
    let done = match cli.command {
        Command::Annotate(args) => annotate::run(&args, json, stop),
        Command::Tail(args) => tail::run(&args, json, stop),
        Command::Watch(args) => watch::run(&args, json, stop),
        Command::Topics(args) => topics::run(&args, json, stop),
        Command::Export(args) => export::run(&args, stop),
        Command::Import(args) => import::run(&args),
        Command::Merge(args) => merge::run(&args, json, stop),
        Command::Report(args) => report::run(&args, json, stop),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
        Command::Repair(args) => repair::run(&args, json),
        Command::Strip(args) => strip::run(&args, json, stop),
        Command::Simulate(args) => simulate::run(&args, json),
        Command::Config(verb) => config::run(verb, json, stop),
    };
    done.unwrap_or_else(|error| Code::of(&error))
}

/// Most bytes that are read from standard input (64 MiB).
const LONGEST_TEXT: u64 = 64 << 20;

/// Outcome of a command, from the mildest to the gravest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Code {
    #[default]
    Done,
    Damaged,
    Uncalibrated,
    Passing,
    /// Of a list: no retry helps.
    Hopeless,
    Refused,
    Usage,
}

impl Code {
    /// The code of an error, which is logged here and nowhere else.
    pub fn of(error: &Error) -> Self {
        match error {
            // Requested, and no fault.
            Error::Stopped | Error::Paused => tracing::info!("{error}"),
            error => tracing::error!("{error}"),
        }
        match error {
            Error::Usage(_) | Error::Config(_) => Self::Usage,
            error if error.is_passing() => Self::Passing,
            _ => Self::Refused,
        }
    }

    /// Exit code of the program.
    pub fn number(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Refused => 1,
            Self::Usage => 2,
            Self::Damaged => 3,
            Self::Uncalibrated => 4,
            Self::Passing => 5,
            Self::Hopeless => 6,
        }
    }
}

/// The code of a command whose input has this number of damaged places.
fn damaged(damages: u64, accepted: bool) -> Code {
    if damages > 0 && !accepted { Code::Damaged } else { Code::Done }
}

/// Range of gravity on the surface of the Earth, in m/s².
const ON_EARTH: std::ops::RangeInclusive<f64> = 9.76..=9.84;

/// The effective configuration: the file, overlaid with the settings.
fn configuration(typed: &Configuration) -> Result<Config, Error> {
    let mut layers = Vec::new();
    if let Some(path) = &typed.config {
        layers.push(layer(path)?);
    }
    for setting in &typed.set {
        layers.push(Layer::set(setting)?);
    }
    let config = Config::load(&layers)?;
    if let Some(gravity) = config.fit.gravity.filter(|gravity| !ON_EARTH.contains(gravity)) {
        tracing::warn!(
            "fit.gravity = {gravity} m/s² is that of no place on Earth (9.76 to 9.84): every scale is wrong by as much if it is a slip"
        );
    }
    Ok(config)
}

/// Whether a path means standard input or output.
fn is_pipe(path: &Path) -> bool {
    path.as_os_str() == "-"
}

fn layer(path: &Path) -> Result<Layer, Error> {
    if is_pipe(path) {
        let why = "-: a configuration is read by its name, and again on SIGHUP, not from a pipe; name a file";
        return Err(Error::Usage(why.to_owned()));
    }
    let text = stillpoint::run::text(path);
    // An unreadable configuration is a fault of the command line, not of a recording.
    let unreadable = |source| Error::Io { doing: "read the configuration", path: path.into(), source };
    let text = text.map_err(|e| Error::Usage(unreadable(e).to_string()))?;
    Ok(Layer::file(&path.display().to_string(), &text))
}

/// Opens the server for viewers, if requested.
#[cfg(feature = "live")]
fn live(viewing: &crate::cli::Viewing, config: &Config) -> Result<Option<stillpoint::run::Live>, Error> {
    let stillpoint::config::Limits { viewers, viewer_kib, viewer_rate, .. } = config.limits;
    let allowed = viewing.live_allow.clone();
    let viewers = stillpoint::run::Viewers { most: viewers, owed: viewer_kib << 10, rate: viewer_rate, allowed };
    let live = viewing.live.map(|address| stillpoint::run::Live::open(address, viewers)).transpose()?;
    if let Some(live) = &live {
        tracing::info!("live at ws://{}", live.address());
    }
    Ok(live)
}

/// Writes a text to its destination: a new file, or standard output. An equal file is left as it is.
fn write(text: &str, output: Option<&Path>, force: bool, reads: &Reads) -> Result<(), Error> {
    // The formats written here that contain names have strings with JSON's escapes.
    let text = &*printable_json(text);
    let Some(path) = output.filter(|path| !is_pipe(path)) else { return print(text) };
    if run::is_url(path) {
        reads.refuse(path)?;
        return run::put_text(path, text, force);
    }
    let partial = partial(path, force, reads)?;
    partial.file().write_all(text.as_bytes()).map_err(Error::io("write", path))?;
    finish(partial, force)
}

/// Files that a command reads: its inputs, and those that its options name.
fn reads<'a>(inputs: impl IntoIterator<Item = &'a PathBuf>, named: &[&'a Option<PathBuf>]) -> Reads {
    Reads::of(inputs.into_iter().chain(named.iter().filter_map(|path| path.as_ref())))
}

/// Opens a result to be written: a file that is read is never replaced, any other only with `force`.
fn partial(path: &Path, force: bool, reads: &Reads) -> Result<Partial, Error> {
    reads.refuse(path)?;
    if force { Partial::create(path, reads) } else { Partial::create_new(path) }
}

/// Gives a result its name. An existing file may already be equal.
fn finish(partial: Partial, force: bool) -> Result<(), Error> {
    let path = partial.target().to_owned();
    if force || path.symlink_metadata().is_err() {
        return partial.finish(false);
    }
    match partial.equals(&path).map_err(Error::io("read", &path))? {
        true => Ok(()),
        false => Err(Error::Exists(path)),
    }
}

/// Makes a folder to write into, with those above it.
fn make_folder(path: &Path) -> Result<(), Error> {
    match std::fs::create_dir_all(path) {
        Err(_) if path.is_file() => Err(Error::input(path, "is a file; name a folder to write into")),
        made => made.map_err(Error::io("make the folder", path)),
    }
}

/// Text of a file or of standard input; any other path is refused.
fn text_of(path: &Path) -> Result<String, Error> {
    if is_pipe(path) {
        let text = std::io::read_to_string(std::io::stdin().take(LONGEST_TEXT));
        return text.map_err(Error::io("read", "standard input".as_ref()));
    }
    stillpoint::run::text(path).map_err(Error::io("read", path))
}

/// Prints a result on standard output. A reader that stops early is no error.
fn print(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(Error::Io { doing: "write to", path: "standard output".into(), source: e })
        }
        _ => Ok(()),
    }
}

/// A path for JSON, which has only Unicode.
fn name(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn print_json(value: &serde_json::Value) -> Result<(), Error> {
    print(&format!("{}\n", printable_json(&value.to_string())))
}
