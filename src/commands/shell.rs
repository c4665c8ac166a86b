//! `stillpoint completions` and `stillpoint man`: descriptions of the command line for a shell and for `man`.

use std::path::Path;

use clap::CommandFactory as _;
use stillpoint::Error;
use stillpoint::run::{Partial, Reads};

use super::code::Code;
use super::files::make_folder;
use super::printing::print;
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
    make_folder(&args.dir)?;
    let mut program = Cli::command().disable_help_subcommand(true);
    program.build();
    pages(program, &args.dir)?;
    Ok(Code::Done)
}

/// Writes the pages of a command and of its subcommands.
fn pages(command: clap::Command, folder: &Path) -> Result<(), Error> {
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        pages(verb.clone(), folder)?;
    }
    let page = clap_mangen::Man::new(command);
    let path = folder.join(page.get_filename());
    let partial = Partial::create(&path, &Reads::default())?;
    page.render(&mut partial.file()).map_err(Error::io("write", &path))?;
    partial.finish(false)
}
