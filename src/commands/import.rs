//! `stillpoint import`: a calibration of another program, converted into our own format.

use std::path::Path;

use serde_json::json;
use stillpoint::Error;
use stillpoint::report::{self, Axes, Findings, ImportError};

use super::code::Code;
use super::files::{reads, text_of, write};
use crate::cli;

pub fn run(args: &cli::Import) -> Result<Code, Error> {
    let mut imus = read(&args.calibration, args.pointing.axes)?;
    if let Some(topic) = &args.topic {
        let [imu] = imus.as_mut_slice() else {
            let several = format!("--topic names one IMU, and {} holds {}", args.calibration.display(), imus.len());
            return Err(Error::Usage(several));
        };
        (imu.name, imu.topic) = (topic.clone(), topic.clone());
    }
    let text = format!("{:#}\n", json!({"imus": report::imus(&imus)}));
    write(&text, args.output.as_deref(), args.force, &reads([&args.calibration], &[]))?;
    Ok(Code::Done)
}

/// Reads a calibration in any format.
pub fn read(path: &Path, axes: Option<Axes>) -> Result<Vec<Findings>, Error> {
    report::import(&text_of(path)?, axes).map_err(|error| match error {
        ImportError::Axes(_) => Error::Usage(format!("{}: {error}", path.display())),
        error => Error::input(path, error.to_string()),
    })
}

/// Reads the calibration to compare with, if there is one.
pub fn against(typed: &cli::Against) -> Result<Option<Vec<Findings>>, Error> {
    match (&typed.against, typed.pointing.axes) {
        (Some(path), axes) => read(path, axes).map(Some),
        (None, Some(_)) => Err(Error::Usage("--axes is of the calibration that --against names; name one".to_owned())),
        (None, None) => Ok(None),
    }
}
