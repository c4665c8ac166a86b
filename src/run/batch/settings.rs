//! Settings that determine the bytes of annotations.

use std::collections::BTreeMap;

use crate::config::Config;

/// Settings that determine the bytes of the annotations.
pub(in crate::run) fn settings(config: &Config) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("configuration".to_owned(), config.canonical()),
    ])
}
