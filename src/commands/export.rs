//! `stillpoint export`: the calibration for other programs.

use stillpoint::Error;
use stillpoint::report::{self, Options, Parameters, RandomWalk, Readings};
use stillpoint::run::{self, Input, Stop};

use super::progress::Progress;
use super::{Code, configuration, damaged, reads, text_of, write};
use crate::cli;

pub fn run(args: &cli::Export, stop: &Stop) -> Result<Code, Error> {
    let config = configuration(&args.configuration)?;
    let options = options(args)?;
    let recording = Input::open(&args.input)?;
    let found = {
        let progress = Progress::new(&recording, stop);
        run::findings(&recording, &config, &|done| progress.watch(done))?
    };
    let exported = report::export(&found.imus, args.format, &options)
        .map_err(|error| Error::input(&args.input, error.to_string()))?;
    let reads = reads([&args.input], &[&args.configuration.config, &args.in_force]);
    write(&exported.text, args.output.as_deref(), args.force, &reads)?;
    exported.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    found.damage.iter().for_each(|damage| tracing::warn!("damaged {damage}"));
    if found.damages > 1 {
        tracing::warn!("{} damages in all", found.damages);
    }
    Ok(damaged(found.damages, args.accept_damage))
}

fn options(args: &cli::Export) -> Result<Options, Error> {
    let readings = match &args.in_force {
        Some(path) => {
            let parameters = Parameters::parse(&text_of(path)?);
            let unknown = "is no parameter file; save one from the ground station";
            Readings::Corrected(parameters.ok_or_else(|| Error::input(path, unknown))?)
        }
        None if args.raw => Readings::Raw,
        None => Readings::Unsaid,
    };
    let random_walk = args.random_walk.as_deref().map(random_walk).transpose()?;
    let (imu, sensor) = (args.imu.clone(), args.sensor.clone());
    Ok(Options { imu, sensor, readings, axes: args.axes, slot: args.slot, random_walk })
}

fn random_walk(text: &str) -> Result<RandomWalk, Error> {
    if text == "bound" {
        return Ok(RandomWalk::Bound);
    }
    let numbers = text.split(',').map(|number| number.trim().parse().ok().filter(|number: &f64| *number > 0.0));
    match numbers.collect::<Option<Vec<_>>>().as_deref() {
        Some(&[accel, gyro]) if accel.is_finite() && gyro.is_finite() => Ok(RandomWalk::Given([accel, gyro])),
        _ => Err(Error::Usage("--random-walk takes two positive numbers, ACCEL,GYRO, or the word bound".to_owned())),
    }
}
