//! `stillpoint export`: the calibration for other programs.

use std::path::Path;

use stillpoint::Error;
use stillpoint::config::Change;
use stillpoint::report::{self, ExportError, Options, Parameters, Readings};
use stillpoint::run::{self, Input, Stop};

use super::code::{Code, damaged};
use super::configuration::configuration;
use super::files::{reads, text_of, write};
use super::progress::Progress;
use super::unapplied;
use crate::cli;

pub fn run(args: &cli::Export, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let options = options(&args.convention)?;
    let recording = Input::open(&args.input)?;
    let found = {
        let progress = Progress::new(&recording, stop);
        run::findings(&recording, &config, &|done| progress.watch(done))?
    };
    let annotated = found.annotated_with.as_deref().map(|stored| (args.input.as_path(), stored));
    // The limits are those of reading.
    let applies = |change: &Change| ["output.", "limits."].iter().any(|table| change.key.starts_with(table));
    unapplied::say(&args.configuration, annotated, applies)?;
    let exported = report::export(&found.imus, args.format, &options).map_err(refused(&args.input))?;
    let reads = reads([&args.input], &[&args.configuration.config, &args.convention.in_force]);
    write(&exported.text, args.output.as_deref(), args.force, &reads)?;
    exported.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    found.damage.iter().for_each(|damage| tracing::warn!("damaged {damage}"));
    if found.damages > 1 {
        tracing::warn!("{} damages in all", found.damages);
    }
    found.missing.iter().for_each(|missing| tracing::warn!("{missing}"));
    Ok(damaged(found.damages, args.accept_damage))
}

/// Refusal to export what is at this path: the fault of the command line, or of the calibration.
pub fn refused(path: &Path) -> impl FnOnce(ExportError) -> Error {
    move |error| match error.is_usage() {
        true => Error::Usage(format!("{}: {error}", path.display())),
        false => Error::input(path, error.to_string()),
    }
}

/// Options of the format.
pub fn options(args: &cli::Convention) -> Result<Options, Error> {
    let readings = match &args.in_force {
        Some(path) => {
            let parameters = Parameters::parse(&text_of(path)?);
            let unknown = "is no parameter file; save one from the ground station";
            Readings::Corrected(parameters.ok_or_else(|| Error::input(path, unknown))?)
        }
        None if args.raw => Readings::Raw,
        None => Readings::Unsaid,
    };
    Ok(Options {
        imu: args.imu.clone(),
        sensor: args.sensor.clone(),
        readings,
        axes: args.pointing.axes,
        slot: args.slot,
        random_walk: args.random_walk,
    })
}
