//! What tests ask for from beyond the repository: recordings of others, interpreters, rights, and new random numbers.
//!
//! What is missing is a failure where `CI=true`; elsewhere the test is skipped, and says so.
#![allow(dead_code, clippy::unwrap_used)]

use std::fmt::Display;
use std::io::Write as _;
use std::path::PathBuf;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

/// The repository whose tests run. Asked for when they run, since one folder of built tests may serve several clones.
pub fn root() -> PathBuf {
    std::env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| PathBuf::from("."), PathBuf::from)
}

/// What was found, or a printed skip; in CI it must be there.
pub fn needed<T>(found: Option<T>, missing: impl Display) -> Option<T> {
    if found.is_none() {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "missing: {missing}");
        let thread = std::thread::current();
        // Not `eprintln`, which is not shown of tests that pass.
        let line = format!("skipped: {}: {missing}\n", thread.name().unwrap_or("a test"));
        std::io::stderr().write_all(line.as_bytes()).unwrap();
    }
    found
}

/// An input that failed once, `STILLPOINT_CASES` or `../shared/cases`.
pub fn case(name: &str) -> Option<PathBuf> {
    let default = root().join("../shared/cases");
    let path = std::env::var_os("STILLPOINT_CASES").map_or(default, PathBuf::from).join(name);
    needed(path.exists().then_some(&path), format_args!("{} is not there", path.display())).cloned()
}

/// A file or folder among the recordings of others, `STILLPOINT_DATA` or `../shared/data`.
pub fn data(name: &str) -> Option<PathBuf> {
    let path = data_path(name);
    needed(path.exists().then_some(&path), format_args!("{} is not there", path.display())).cloned()
}

/// Where that is, if it is there.
pub fn data_path(name: &str) -> PathBuf {
    let default = root().join("../shared/data");
    std::env::var_os("STILLPOINT_DATA").map_or(default, PathBuf::from).join(name)
}

/// A real recording.
pub fn recording(name: &str) -> Option<PathBuf> {
    data(&format!("recordings/{name}"))
}

/// The interpreter with readers that are not ours, which `STILLPOINT_PYTHON` names.
pub fn python() -> Option<String> {
    needed(std::env::var("STILLPOINT_PYTHON").ok(), "STILLPOINT_PYTHON names no interpreter (CONTRIBUTING says how)")
}

/// Random numbers that are new in each run, or those of `STILLPOINT_SEED`; the seed is shown where a test fails.
pub fn randomness() -> ChaCha8Rng {
    let seed = std::env::var("STILLPOINT_SEED").map_or_else(|_| rand::random(), |seed| seed.parse().unwrap());
    eprintln!("STILLPOINT_SEED={seed}");
    ChaCha8Rng::seed_from_u64(seed)
}
