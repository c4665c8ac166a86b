//! Recordings with known truth: a [`Scenario`] says which sensors rest and move how, [`samples`] computes what they
//! read, and [`record`] writes that as an MCAP recording. What can be learned from one is left to the other layers.
//!
//! The motion is physical: the gyroscope's true rate is the derivative of the attitude, the true specific force is the
//! reaction to gravity plus the acceleration of the hand, and a rest is a rest. Noise comes from a seeded generator:
//! the same scenario gives the same bytes.
//!
//! ```
//! use stillpoint::simulate::{Scenario, record};
//!
//! let scenario = Scenario::builtin("demo")?;
//! let mut recording = Vec::new();
//! let truth = record(&scenario, &mut recording)?;
//! assert_eq!(truth.rests.len(), 9);
//! assert!(recording.starts_with(b"\x89MCAP0\r\n"));
//! # Ok::<(), stillpoint::simulate::Error>(())
//! ```

mod fault;
mod message;
mod pose;
mod sample;
mod scenario;
mod sensor;
mod trajectory;
mod truth;
mod validate;
mod write;

pub use fault::{Axis, Fault};
pub use sample::{Reading, Samples, samples};
pub use scenario::{
    BUILTIN, Compression, Encoding, Motion, Pose, Recording, Reference, Scenario, Sensitivity, Triad, Vibration,
};
pub use truth::{Rest, TriadTruth, Truth};
pub use write::record;

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
