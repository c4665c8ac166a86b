//! `stillpoint repair`: undoes the change of a recording during which a run was killed.

use serde_json::json;
use stillpoint::Error;
use stillpoint::run;
use tracing::info;

use super::code::Code;
use super::printing::{name, print_json};
use crate::cli;

pub fn run(args: &cli::Repair, json: bool) -> Result<Code, Error> {
    for input in &args.inputs {
        let repaired = run::take_back(input)?;
        match json {
            true => print_json(&json!({"input": name(input), "repaired": repaired}))?,
            false if repaired => {}
            false => info!("{}: nothing was left half done", input.display()),
        }
    }
    Ok(Code::Done)
}
