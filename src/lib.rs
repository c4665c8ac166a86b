//! Stillpoint learns the calibration of inertial sensors from the moments when they rest.
//!
//! It reads IMU messages out of MCAP recordings, finds the zero-velocity segments, fits bias and sensitivity, and
//! writes what it learned back into an annotated recording that still contains the original, byte for byte.
//!
//! # How a byte becomes a calibration
//!
//! ```text
//! bytes ─► record ─► imu ─► engine (still ─► fit) ─► annotate ─► record (fold) ─► bytes
//!          framing   decode         rests   models   messages    original ⊕ annotations
//! ```
//!
//! # Layout
//!
//! * [`record`]: MCAP bytes. Scanning a recording for messages, folding annotations into it, stripping them off.
//! * [`imu`]: what a sample is, and how message bytes become one.
//! * [`still`]: whether a sensor rests, and what it read while it did.
//! * [`turns`]: how the sensor turned between its rests.
//! * [`fit`]: what rests say about a sensor: faces, measurement models, uncertainty.
//! * [`engine`]: samples in, [events](engine::Event) out.
//! * [`annotate`]: events to message bytes and annotation blocks.
//! * [`messages`]: the annotations as types, generated from `schemas/`.
//! * [`simulate`]: recordings with known truth.
//! * [`config`]: the configuration file.
//! * [`report`]: what was learned, for people and in the formats of other programs.
//! * [`run`]: the shell. Files, signals and threads live here and nowhere else.
//!
//! Every layer but `run` is pure: no file, clock, socket or async runtime. What comes out is a function of what went
//! in, so that batch, tail and resumed runs give the same bytes.
//!
//! # Direction of the numbers
//!
//! Everywhere, `measured = bias + S · true`: the sensitivity `S` maps true to measured. To correct a reading,
//! `true = S⁻¹ (measured − bias)`. Accelerometers in m/s², gyroscopes in rad/s.
#![forbid(unsafe_code)]

pub mod annotate;
pub mod config;
pub mod engine;
pub mod fit;
pub mod imu;
pub mod messages;
pub mod pipeline;
pub mod record;
pub mod report;
pub mod run;
pub mod simulate;
pub mod still;
pub mod topic;
pub mod turns;

mod error;
mod printable;
mod stamp;

pub use error::Error;
pub use printable::{printable, printable_json};
pub use stamp::Stamp;

/// The example of the README runs, too.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
