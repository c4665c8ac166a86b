//! `stillpoint strip`: extracts the original from an annotated recording.

use serde_json::json;
use stillpoint::Error;
use stillpoint::run::{self, Input, Stop};
use tracing::info;

use super::code::Code;
use super::printing::{name, print_json};
use super::progress::Progress;
use crate::cli;

pub fn run(args: &cli::Strip, json: bool, stop: &Stop) -> Result<Code, Error> {
    let recording = Input::open_annotated(&args.input)?;
    let written = {
        let progress = Progress::new(&recording, stop);
        let written = run::strip(&recording, &args.output, args.force, args.sync, &|done| progress.watch(done));
        written.map_err(|error| match error {
            Error::Exists(path) if recording.reads().contains(&path) => Error::Itself(path),
            error => error,
        })?
    };
    match (json, written) {
        (true, _) => {
            print_json(&json!({"input": name(&args.input), "output": name(&args.output), "bytes": recording.length()}))?
        }
        (false, run::Written::Now) => info!("wrote {}", args.output.display()),
        (false, run::Written::Before) => info!("{} is already the original: nothing to do", args.output.display()),
    }
    Ok(Code::Done)
}
