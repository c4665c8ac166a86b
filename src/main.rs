//! The `stillpoint` program, which [`stillpoint::program`] is.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(stillpoint::program::run(std::env::args_os()))
}
