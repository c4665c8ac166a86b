//! The `stillpoint` program: arguments → command → exit code.
#![forbid(unsafe_code)]

mod cli;
mod commands;
mod console;

use clap::Parser as _;
use std::process::ExitCode;
use stillpoint::run::{self, Stop};

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    console::log_to_stderr(&cli);
    run::allow_many_files();

    let stop = Stop::default();
    tokio::spawn(stop.clone().on_signal());
    let work = tokio::task::spawn_blocking({
        let stop = stop.clone();
        move || commands::run(cli, &stop)
    });
    match work.await {
        Ok(code) => stop.signal().map_or(code.into(), |signal| ExitCode::from(128 + signal)),
        Err(panic) => std::panic::resume_unwind(panic.into_panic()),
    }
}
