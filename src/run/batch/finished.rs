//! Finished work: a result that a store already has.

use std::path::Path;

use super::settings::settings;
use crate::Error;
use crate::config::Config;
use crate::run::input::recording::Recording;
use crate::run::store::{ResultMark, check, is_url, known_identity, marked};

/// A result that a store has, of the same recording and configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EarlierResult {
    /// Number of damaged places in the recording, and whether every IMU was calibrated; `None` where the result does not
    /// tell.
    pub outcome: Option<(u64, bool)>,
}

/// Whether an output in a store is the result of this input and configuration: one request, and nothing of the input.
/// Whether the input has changed since is known only if it was listed.
///
/// # Errors
///
/// If the store refuses, the output is something else, or the input is a URL that names no recording.
pub fn finished(input: &Path, output: &Path, config: &Config) -> Result<Option<EarlierResult>, Error> {
    if is_url(input) {
        // One with a query is another recording than what its path alone names.
        check(input)?;
    }
    if !is_url(output) {
        return Ok(None);
    }
    let identity = match is_url(input) {
        true => known_identity(input),
        false => std::fs::metadata(input).ok().filter(std::fs::Metadata::is_file).map(|found| found.len().to_string()),
    };
    let wanted = ResultMark { input: identity.unwrap_or_default(), ..ResultMark::of(config) };
    let Some(found) = marked(output)? else { return Ok(None) };
    match found {
        Some(mark) if mark.is_of(&wanted) => Ok(Some(EarlierResult { outcome: mark.outcome })),
        // Put there by another program, from a run on files for instance.
        None if Recording::open(output)?.settings()? == Some(settings(config)) => {
            Ok(Some(EarlierResult { outcome: None }))
        }
        _ => Err(Error::Exists(output.to_owned())),
    }
}
