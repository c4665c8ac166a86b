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

/// Folders between a prefix and an object under it.
pub fn folders_below(prefix: &Path, object: &Path) -> PathBuf {
    let below = object.strip_prefix(prefix).ok().and_then(Path::parent);
    below.map(Path::to_owned).unwrap_or_default()
}

/// A recording under a prefix, and its sidecar: beside it, or in the same place under another prefix.
pub(super) struct WithSidecar {
    pub(super) recording: Listed,
    pub(super) sidecar: PathBuf,
    /// The sidecar as it is listed, if it is there.
    pub(super) there: Option<Listed>,
}

/// Recordings under a prefix, with their sidecars.
pub(super) fn with_sidecars(prefix: &Path, out: Option<&Path>) -> Result<Vec<WithSidecar>, Error> {
    let (mut results, recordings): (Vec<_>, Vec<_>) =
        list(prefix)?.into_iter().partition(|object| is_result(&object.path));
    if let Some(out) = out.filter(|out| !out.starts_with(prefix)) {
        results.extend(list(out)?.into_iter().filter(|object| is_result(&object.path)));
    }
    let results: BTreeMap<_, _> = results.into_iter().map(|object| (object.path.clone(), object)).collect();
    let recordings = recordings.into_iter().filter(|object| object.path.starts_with(prefix));
    let with = recordings.map(|recording| {
        let folder = out.map(|out| under(out, &folders_below(prefix, &recording.path)));
        let sidecar = default_output(&recording.path, false, folder.as_deref(), true);
        let there = results.get(&sidecar).cloned();
        WithSidecar { recording, sidecar, there }
    });
    Ok(with.collect())
}

/// A folder below another one, which may be a prefix.
pub fn under(folder: &Path, below: &Path) -> PathBuf {
    // An empty name would be a slash more.
    if below.as_os_str().is_empty() { folder.to_owned() } else { folder.join(below) }
}
