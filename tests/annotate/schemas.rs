//! The generated code and the descriptor set are what `schemas/stillpoint.proto` says.
//!
//! `STILLPOINT_UPDATE=1 cargo test --test annotate schemas` writes them anew after the schema was edited.

use std::path::{Path, PathBuf};

use prost::Message as _;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Fails if `path` does not hold `fresh`, or writes it when asked to.
fn expect_generated(path: &Path, fresh: &[u8]) {
    if std::env::var_os("STILLPOINT_UPDATE").is_some() {
        std::fs::write(path, fresh).unwrap();
    }
    let present = std::fs::read(path).unwrap_or_default();
    assert!(
        present == fresh,
        "{} is stale: run STILLPOINT_UPDATE=1 cargo test --test annotate schemas",
        path.display()
    );
}

#[test]
fn generated_code_and_descriptor_set_match_the_schema() {
    let schemas = root().join("schemas");
    let descriptors = protox::compile(["stillpoint.proto", "foxglove/Log.proto"], [&schemas]).unwrap();

    // Units and directions are said in our comments, so they travel with the recording. Positions do not.
    let mut embedded = descriptors.clone();
    for file in &mut embedded.file {
        if file.package() != "stillpoint" {
            file.source_code_info = None;
        }
        if let Some(info) = &mut file.source_code_info {
            info.location.retain(|place| place.leading_comments.is_some() || place.trailing_comments.is_some());
            info.location.iter_mut().for_each(|place| place.span = vec![0, 0, 0]);
        }
    }
    expect_generated(&schemas.join("descriptors.binpb"), &embedded.encode_to_vec());

    let out = tempfile::tempdir().unwrap();
    prost_build::Config::new()
        .out_dir(out.path())
        .enable_type_names()
        .type_attribute("stillpoint.Segment.Reason", "#[derive(serde::Serialize, serde::Deserialize)]")
        .compile_fds(descriptors)
        .unwrap();
    for package in ["stillpoint", "foxglove"] {
        let file = format!("{package}.rs");
        let fresh = std::fs::read(out.path().join(&file)).unwrap();
        expect_generated(&root().join("src/messages").join(&file), &fresh);
    }
}
