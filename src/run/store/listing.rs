//! Objects under a prefix.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

use futures_util::TryStreamExt as _;
use object_store::ObjectMeta;

use super::client::{ObjectPlace, wait};
use super::listed::Listed;
use super::refusal::{LIST, refused};
use crate::Error;

static IDENTITIES: LazyLock<Mutex<BTreeMap<PathBuf, String>>> = LazyLock::new(Mutex::default);

/// Lists the MCAP files under a prefix, in the order of their names.
pub(crate) fn list(prefix: &Path) -> Result<Vec<Listed>, Error> {
    let ObjectPlace { path, key, store, .. } = ObjectPlace::of(prefix)?;
    let found = wait(&path, async {
        let found: Result<Vec<_>, _> = store.list(Some(&key)).try_collect().await;
        found.map_err(|refusal| refused(&path, LIST, refusal))
    })?;
    let text = path.to_string_lossy();
    let bucket = text.strip_suffix('/').unwrap_or(&text);
    let bucket = bucket.strip_suffix(key.as_ref()).unwrap_or(bucket).trim_end_matches('/');
    let mut identities = IDENTITIES.lock().unwrap_or_else(PoisonError::into_inner);
    let listed = found.iter().filter(|object| object.location.as_ref().ends_with(".mcap")).map(|object| {
        let path = PathBuf::from(format!("{bucket}/{}", object.location));
        let version = identity(object);
        identities.insert(path.clone(), version.clone());
        Listed { path, length: object.size, version, modified_ms: object.last_modified.timestamp_millis() }
    });
    let mut listed: Vec<_> = listed.collect();
    listed.sort_unstable_by(|a, b| a.path.as_os_str().cmp(b.path.as_os_str()));
    Ok(listed)
}

/// Length and version of an object.
pub(super) fn identity(object: &ObjectMeta) -> String {
    let version = match &object.e_tag {
        Some(tag) => tag.chars().filter(char::is_ascii_graphic).filter(|&c| c != '"').collect(),
        None => object.last_modified.timestamp_millis().to_string(),
    };
    format!("{}:{version}", object.size)
}

/// The same of an object that was listed before, else nothing: then it would cost a request.
pub(crate) fn known_identity(path: &Path) -> Option<String> {
    IDENTITIES.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned()
}
