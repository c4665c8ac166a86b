//! Why there is no simulated recording.

use super::builtin::BUILTIN;

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The text is not TOML, or not a scenario.
    #[error("scenario{}: {problem}", at(.line, .key))]
    Scenario {
        /// Line in the text, from 1, if it is known.
        line: Option<usize>,
        /// Key of the value, if it is known.
        key: Option<String>,
        /// What is wrong with it.
        problem: String,
    },
    /// A value that cannot be simulated.
    #[error("scenario, {key}: {problem}")]
    Value {
        /// Its key, `gyroscope.rate_hz` for instance; poses count from 0.
        key: String,
        /// What is wrong with it, and what would be right.
        problem: String,
    },
    /// No built-in scenario is called so.
    #[error("no built-in scenario is called {0:?}; there are {known}", known = known_names())]
    Unknown(String),
    /// The recording could not be written.
    #[error("the simulated recording could not be written: {0}")]
    Write(#[from] mcap::McapError),
}

fn at(line: &Option<usize>, key: &Option<String>) -> String {
    let line = line.map(|line| format!(", line {line}"));
    let key = key.as_ref().map(|key| format!(", {key}"));
    format!("{}{}", line.unwrap_or_default(), key.unwrap_or_default())
}

fn known_names() -> String {
    BUILTIN.map(|(name, _)| name).join(", ")
}
