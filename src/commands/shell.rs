//! `stillpoint completions` and `stillpoint man`: descriptions of the command line for a shell and for `man`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::CommandFactory as _;
use stillpoint::Error;
use stillpoint::run::Reads;

use super::code::Code;
use super::files::{finish, make_folder, partial};
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
    let mut all = Vec::new();
    pages(program, &args.dir, &mut all)?;
    // None is written where one of them stands for something else.
    let differs = |(path, text): &&(PathBuf, Vec<u8>)| std::fs::read(path).is_ok_and(|found| found != *text);
    if let Some((path, _)) = all.iter().find(differs).filter(|_| !args.force) {
        return Err(Error::Exists(path.clone()));
    }
    for (path, text) in &all {
        let partial = partial(path, args.force, &Reads::default())?;
        partial.file().write_all(text).map_err(Error::io("write", path))?;
        finish(partial, args.force)?;
    }
    Ok(Code::Done)
}

/// Pages of a command and of its subcommands, each with the path in a folder.
fn pages(command: clap::Command, folder: &Path, all: &mut Vec<(PathBuf, Vec<u8>)>) -> Result<(), Error> {
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        pages(verb.clone(), folder, all)?;
    }
    let page = clap_mangen::Man::new(command);
    let (path, mut text) = (folder.join(page.get_filename()), Vec::new());
    page.render(&mut text).map_err(Error::io("write", &path))?;
    all.push((path, text));
    Ok(())
}
