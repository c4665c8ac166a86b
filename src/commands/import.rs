//! `stillpoint import`: a calibration of another program, converted into our own format.

use std::io::Read as _;
use std::path::Path;

use serde_json::json;
use stillpoint::record::{START, is_beginning};
use stillpoint::report::{self, Axes, Findings, ImportError};
use stillpoint::{Error, shell_word};

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
    if is_recording(path) {
        let first = format!("stillpoint export {} --format json", shell_word(&path.to_string_lossy()));
        return Err(Error::input(
            path,
            format!("is a recording, no calibration; write its calibration first: {first} -o FILE"),
        ));
    }
    report::import(&text_of(path)?, axes).map_err(|error| match error {
        ImportError::Axes(_) => Error::Usage(format!("{}: {error}", path.display())),
        error => Error::input(path, error.to_string()),
    })
}

/// Whether a path leads to a recording, as far as its name or its first bytes tell.
fn is_recording(path: &Path) -> bool {
    let mut start = [0; START];
    // Only a file is opened: of a pipe, bytes would be lost.
    let mut begins = || std::fs::File::open(path)?.read_exact(&mut start);
    path.is_file() && begins().is_ok() && is_beginning(&start) || path.join("metadata.yaml").is_file()
}

/// Reads the calibration to compare with, if there is one.
pub fn against(typed: &cli::Against) -> Result<Option<Vec<Findings>>, Error> {
    match (&typed.against, typed.pointing.axes) {
        (Some(path), axes) => read(path, axes).map(Some),
        (None, Some(_)) => Err(Error::Usage("--axes is of the calibration that --against names; name one".to_owned())),
        (None, None) => Ok(None),
    }
}
