//! One module per verb: arguments → work of the library → printed result.

mod annotate;
mod code;
mod config;
mod configuration;
mod export;
mod files;
mod import;
mod listing;
#[cfg(feature = "live")]
mod live;
mod manifest;
mod merge;
mod outputs;
mod printing;
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
mod unapplied;
mod view;
mod watch;

use stillpoint::run::Stop;

pub use self::code::Code;
use crate::cli::{Cli, Command};

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
