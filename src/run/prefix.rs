//! Contents of a prefix of an object store, by the names alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::run::output::names::default_output;
use crate::run::store::{Listed, list};

/// Ending of annotations alone.
const SIDECAR: &str = ".stillpoint.mcap";
/// Ending of annotated recordings.
const ANNOTATED: &str = ".annotated.mcap";

/// Whether a name is that of annotations alone.
pub fn is_sidecar_name(path: &Path) -> bool {
    path.as_os_str().to_string_lossy().ends_with(SIDECAR)
}

fn is_result(path: &Path) -> bool {
    is_sidecar_name(path) || path.as_os_str().to_string_lossy().ends_with(ANNOTATED)
}

/// Recordings under a prefix, without results of Stillpoint.
///
/// # Errors
///
/// If the store refuses, or there are none.
pub fn recordings_under(prefix: &Path) -> Result<Vec<PathBuf>, Error> {
    let found = list(prefix)?.into_iter().map(|object| object.path);
    some(prefix, found.filter(|path| !is_result(path)).collect(), "no recording (.mcap) lies under it; check its name")
}

/// Results of Stillpoint under a prefix; of a recording that has both, the annotations alone, which are shorter.
///
/// # Errors
///
/// If the store refuses, or there are none.
pub fn results_under(prefix: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut by_recording = BTreeMap::new();
    for path in list(prefix)?.into_iter().map(|object| object.path).filter(|path| is_result(path)) {
        let text = path.to_string_lossy();
        let stem = text.strip_suffix(SIDECAR).or_else(|| text.strip_suffix(ANNOTATED)).unwrap_or(&text).to_owned();
        if is_sidecar_name(&path) || !by_recording.contains_key(&stem) {
            by_recording.insert(stem, path);
        }
    }
    let why = "no result of Stillpoint lies under it; annotate its recordings first, or list them with --inputs-from";
    some(prefix, by_recording.into_values().collect(), why)
}

fn some(prefix: &Path, found: Vec<PathBuf>, why: &str) -> Result<Vec<PathBuf>, Error> {
    if found.is_empty() { Err(Error::input(prefix, why)) } else { Ok(found) }
}

/// Recordings under a prefix, and for each whether its sidecar lies beside it or in the same place under another prefix.
pub(super) fn with_sidecars(prefix: &Path, out: Option<&Path>) -> Result<Vec<(Listed, PathBuf, bool)>, Error> {
    let mut found = list(prefix)?;
    if let Some(out) = out.filter(|out| !out.starts_with(prefix)) {
        found.extend(list(out)?);
    }
    let names: std::collections::BTreeSet<_> = found.iter().map(|object| object.path.clone()).collect();
    let recordings = found.into_iter().filter(|object| object.path.starts_with(prefix) && !is_result(&object.path));
    let with = recordings.map(|object| {
        let folder = out.map(|out| {
            let under = object.path.strip_prefix(prefix).ok().and_then(Path::parent);
            under.filter(|under| !under.as_os_str().is_empty()).map_or_else(|| out.to_owned(), |under| out.join(under))
        });
        let sidecar = default_output(&object.path, false, folder.as_deref(), true);
        let is_there = names.contains(&sidecar);
        (object, sidecar, is_there)
    });
    Ok(with.collect())
}
