//! Recordings and results that URLs name. Against a store that is not ours: `tests/interop/stores.py`.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;

mod absent;
mod bucket;
mod prefixes;
mod server;
mod web;

use common::Folder;

#[test]
fn what_grows_or_changes_in_place_is_no_object() {
    let folder = Folder::with_demo();
    folder.refuses("annotate s3://bucket/x.mcap --in-place", 2, &["s3://bucket/x.mcap", "changed in place", "sidecar"]);
    folder.refuses("tail s3://bucket/x.mcap", 2, &["does not grow", "annotate takes it"]);
    folder.refuses("annotate demo.mcap --manifest gs://bucket/m", 2, &["line by line", "name a file"]);
    folder.refuses("watch s3://bucket/in --out-dir here", 2, &["--out-dir"]);
}
