//! `stillpoint config`: the commented default, and the check of a file.

use serde_json::json;
use stillpoint::Error;
use stillpoint::config::Config;

use super::{Code, layer, print, print_json};
use crate::cli;

pub fn run(verb: cli::Config, json: bool) -> Result<Code, Error> {
    match verb {
        cli::Config::Show if json => print_json(&json!(Config::default()))?,
        cli::Config::Show => print(Config::COMMENTED)?,
        cli::Config::Check { file } => {
            let config = Config::load(&[layer(&file)?])?;
            match json {
                true => print_json(&json!(config))?,
                false => tracing::info!("{}: valid", file.display()),
            }
        }
    }
    Ok(Code::Done)
}
