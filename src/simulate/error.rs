//! Errors of the simulation.

use super::builtin::BUILTIN;

/// Reason why a recording cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The text is not TOML, or not a scenario.
    #[error("scenario{}: {problem}", at(.line, .key))]
    Scenario {
        /// Line in the text, from 1, if known.
        line: Option<usize>,
        /// Key of the value, if known.
        key: Option<String>,
        /// Description of the problem.
        problem: String,
    },
    /// A value cannot be simulated.
    #[error("scenario, {key}: {problem}")]
    Value {
        /// Key of the value, `gyroscope.rate_hz` for instance; poses count from 0.
        key: String,
        /// Description of the problem and of the allowed values.
        problem: String,
    },
    /// There is no built-in scenario of this name.
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
