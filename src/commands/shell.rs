//! `stillpoint completions` and `stillpoint man`: what a shell and `man` want to know of the command line.

use clap::CommandFactory as _;
use stillpoint::Error;

use super::{Code, print};
use crate::cli::{Cli, Completions, Man};

/// Prints the completions of a shell.
pub fn completions(args: &Completions) -> Result<Code, Error> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), env!("CARGO_PKG_NAME"), &mut script);
    print(&String::from_utf8_lossy(&script))?;
    Ok(Code::Done)
}

/// Writes one page for the program and one for each verb.
pub fn man(args: &Man) -> Result<Code, Error> {
    std::fs::create_dir_all(&args.dir).map_err(Error::io("create", &args.dir))?;
    clap_mangen::generate_to(Cli::command(), &args.dir).map_err(Error::io("write into", &args.dir))?;
    Ok(Code::Done)
}
