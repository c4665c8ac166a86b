//! `stillpoint export`: the calibration for other programs.

use std::io::Write as _;

use serde_json::json;
use stillpoint::Error;
use stillpoint::run::{self, Partial, Recording, Stop};

use super::progress::Progress;
use super::{Code, configuration, json, print};
use crate::cli;

pub fn run(args: &cli::Export, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let recording = Recording::open(&args.input)?;
    let findings = {
        let progress = Progress::new(&recording, stop);
        run::findings(&recording, &config, &|done| progress.watch(done))?
    };
    let text = match args.format {
        cli::Format::Json => format!("{:#}\n", json!({"imus": json::imus(&findings)})),
    };
    let Some(path) = &args.output else { return print(&text).map(|()| Code::Done) };
    if path.exists() && !args.force {
        return Err(Error::Exists(path.clone()));
    }
    let partial = Partial::create(path)?;
    partial.file().write_all(text.as_bytes()).map_err(Error::io("write", path))?;
    partial.finish(false)?;
    Ok(Code::Done)
}
