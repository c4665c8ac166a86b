//! Standard error, for people: the events of `tracing`, one plain line each. The commands write standard output.

use std::fmt::{Debug, Write as _};
use std::io::Write as _;

use console::Term;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::Context;
use tracing_subscriber::prelude::*;

use stillpoint::printable;

use crate::cli::Cli;

/// Sends events to standard error: with `-v` all of ours, with `-q` errors only.
pub fn log_to_stderr(cli: &Cli) {
    let level = match (cli.verbose, cli.quiet) {
        (true, _) => Level::DEBUG,
        (_, true) => Level::ERROR,
        _ => Level::INFO,
    };
    tracing_subscriber::registry().with(Stderr.with_filter(Targets::new().with_target("stillpoint", level))).init();
}

/// Width of lines in columns: that of the terminal, else a width that is easy to read.
pub fn columns(term: &Term) -> usize {
    const EASY: usize = 100;
    match term.size_checked() {
        Some((_, columns)) if term.is_term() => usize::from(columns).clamp(40, 120),
        _ => EASY,
    }
}

struct Stderr;

impl<S: Subscriber> tracing_subscriber::Layer<S> for Stderr {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = match *event.metadata().level() {
            Level::ERROR => "error: ",
            Level::WARN => "warning: ",
            Level::INFO => "",
            _ => "debug: ",
        }
        .to_owned();
        event.record(&mut LogText(&mut text));
        let text = if event.metadata().target() == COMPOSED { text.into() } else { printable(&text) };
        // Nobody can be informed if standard error is gone.
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }
}

struct LogText<'a>(&'a mut String);

impl Visit for LogText<'_> {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

/// Target of events that have lines and colours of their own, and names that are escaped already.
pub const COMPOSED: &str = "stillpoint::composed";
