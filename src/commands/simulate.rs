//! `stillpoint simulate`: a recording with known truth.

use std::io::{BufWriter, Write as _};
use std::path::Path;

use serde_json::json;
use stillpoint::config::{Layer, overlay};
use stillpoint::simulate::{self, BUILTIN, Scenario};
use stillpoint::{Error, Stamp};
use tracing::info;

use super::code::Code;
use super::configuration::layer;
use super::files::{finish, partial, reads};
use super::printing::{name, print, print_json};
use crate::cli;

pub fn run(args: &cli::Simulate, json: bool) -> Result<Code, Error> {
    let layer = scenario(&args.scenario)?;
    let Some(output) = &args.output else { return print(layer.text()).map(|()| Code::Done) };
    let mut table: toml::Table = layer.parse()?;
    for setting in &args.set {
        overlay(&mut table, Layer::set(setting)?.parse()?);
    }
    let invalid = |error: simulate::Error| Error::Usage(format!("{}: {error}", args.scenario));
    let scenario = Scenario::from_table(table).map_err(invalid)?;
    let partial = partial(output, args.force, &reads([&args.scenario.clone().into()], &[]))?;
    let mut file = BufWriter::new(partial.file());
    let truth = simulate::record(&scenario, &mut file).map_err(|error| match error {
        simulate::Error::Write(cause) => Error::input(output, format!("cannot write: {cause}")),
        error => invalid(error),
    })?;
    file.flush().map_err(Error::io("write", output))?;
    drop(file);
    finish(partial, args.force)?;

    let seconds = |rests: &[simulate::Rest]| {
        let end = rests.last().map(|rest| rest.end).unwrap_or_default();
        rests.first().map_or(0.0, |rest: &simulate::Rest| Stamp::seconds_since(end, rest.start))
    };
    match json {
        true => print_json(&json!({"output": name(output), "truth": truth}))?,
        false => info!(
            "wrote {}: {} rests in {:.0} s; --json prints the truth",
            output.display(),
            truth.rests.len(),
            seconds(&truth.rests)
        ),
    }
    Ok(Code::Done)
}

/// A built-in scenario by name, or a file.
fn scenario(name: &str) -> Result<Layer, Error> {
    if let Some((_, text)) = BUILTIN.iter().find(|(known, _)| *known == name) {
        return Ok(Layer::file(name, text));
    }
    if !Path::new(name).exists() {
        let known = BUILTIN.map(|(name, _)| name).join(", ");
        return Err(Error::Usage(format!("{name}: no such file, and no built-in scenario ({known})")));
    }
    layer(Path::new(name))
}
