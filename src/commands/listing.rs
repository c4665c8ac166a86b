//! Inputs named on the command line and in a list.

use std::path::{Path, PathBuf};

use stillpoint::Error;

use super::text_of;

/// The inputs in the order in which they are named, those of the list last.
pub fn inputs(named: &[PathBuf], list: Option<&Path>) -> Result<Vec<PathBuf>, Error> {
    let mut inputs = named.to_vec();
    let Some(list) = list else { return Ok(inputs) };
    let text = text_of(list).map_err(|error| Error::Usage(error.to_string()))?;
    let lines = text.lines().map(|line| line.strip_suffix('\r').unwrap_or(line));
    inputs.extend(lines.filter(|line| !line.trim().is_empty()).map(PathBuf::from));
    if inputs.is_empty() {
        return Err(Error::Usage(format!("{}: the list names no recording", list.display())));
    }
    Ok(inputs)
}
