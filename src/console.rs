//! Standard error, which people read: what `tracing` says, one plain line each. Standard output is left to the commands.

use std::fmt::{Debug, Write as _};
use std::io::Write as _;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::Context;
use tracing_subscriber::prelude::*;

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
        event.record(&mut Message(&mut text));
        // Nobody is left to tell if standard error is gone.
        let _ = writeln!(std::io::stderr().lock(), "{}", printable(&text));
    }
}

struct Message<'a>(&'a mut String);

impl Visit for Message<'_> {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

/// The text without control characters that a recording's names could smuggle into a terminal; colours stay.
fn printable(text: &str) -> String {
    let is_colour = |rest: &str| {
        let parameters = rest.strip_prefix('[').and_then(|rest| rest.split_once('m'));
        parameters.is_some_and(|(digits, _)| digits.bytes().all(|b| b.is_ascii_digit() || b == b';'))
    };
    let keep = |(at, c): (usize, char)| match c {
        '\n' => c,
        '\u{1b}' if is_colour(text.get(at + 1..).unwrap_or_default()) => c,
        c if c.is_control() => char::REPLACEMENT_CHARACTER,
        c => c,
    };
    text.char_indices().map(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::printable;

    #[test]
    fn names_cannot_smuggle_escapes_into_the_terminal() {
        assert_eq!(printable("\u{1b}[1;32mok\u{1b}[0m\n"), "\u{1b}[1;32mok\u{1b}[0m\n");
        assert_eq!(printable("/a\u{1b}]0;x\u{7}\r"), "/a\u{fffd}]0;x\u{fffd}\u{fffd}");
    }
}
