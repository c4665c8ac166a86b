//! Stillpoint learns the calibration of inertial sensors from the moments when they rest.
//!
//! It reads IMU messages out of MCAP recordings, finds the zero-velocity segments, fits bias and sensitivity, and
//! writes what it learned back into an annotated recording that still contains the original, byte for byte.
//!
//! # How a byte becomes a calibration
//!
//! ```text
//! bytes ─► record ─► imu ─► engine (still, turns ─► fit) ─► annotate ─► record (fold) ─► bytes
//!          framing   decode          rests, turns   models   messages    original ⊕ annotations
//!                    └────────────── pipeline: scan events in, blocks and findings out ──────┘
//! ```
//!
//! # The map
//!
//! From the bottom up; each may import those above it in this list, and a test holds it to that.
//!
//! * [`topic`]: what annotation topics are called. [`printable`]: text of others, as it may be printed.
//! * [`messages`]: the annotations as types, generated from `schemas/`.
//! * [`record`]: MCAP bytes. Scanning a recording for messages, folding annotations into it, stripping them off.
//! * [`imu`]: what a sample is, and how message bytes become one: schema text to layout, layout to numbers, channels to
//!   IMUs.
//! * [`still`]: whether a sensor rests, and what it read while it did. The noise floor is learned here.
//! * [`turns`]: how the sensor turned between its rests.
//! * [`fit`]: what rests say about a sensor: faces, measurement models, uncertainty.
//! * [`engine`]: samples in, [events](engine::Event) out.
//! * [`annotate`]: events to message bytes and annotation blocks.
//! * [`config`]: the configuration file.
//! * [`report`]: what was learned, for people and in the formats of other programs.
//! * [`merge`]: what recordings of one sensor say together.
//! * [`pipeline`]: the events of a scan through all of these, for whoever reads a recording.
//! * [`simulate`]: recordings with known truth.
//! * [`run`]: the shell. Its rooms: `input` (recordings on disk), `output` (results on disk), `batch`, `tail`, `watch`,
//!   `live` (viewers), `inspect` (topics, findings, strip).
//!
//! # The path of a message
//!
//! In batch: `run/input` reads the bytes, [`record::Scan`] makes events of them, the pipeline's table of channels and
//! [`imu::Intake`] make samples, [`engine::Engine`] makes events of those, [`annotate::Annotator`] makes blocks,
//! `run/batch` keeps them until all is read, and [`record::Fold`] makes the annotated recording, which `run/output`
//! writes.
//!
//! In a tail: the same scan, pipeline, engine and annotator, fed by a file that grows. Blocks go at once into the sidecar
//! by [`record::Sidecar`], and chunk indexes into a log beside the checkpoint. At the end [`record::SidecarBlocks`] hands
//! the blocks of the sidecar to the same fold; no annotation is decoded, and none is kept a second time.
//!
//! # What holds everywhere
//!
//! * A pure layer, which is every one but [`run`], never opens a file or socket, starts a thread, reads a clock or knows
//!   the command line, because what it says must be a function of the bytes: batch, tail, resumed and distributed runs
//!   then give the same bytes, and every law can be tested without a disk.
//! * A pure layer never iterates over a map without order, and takes its transcendental functions from `libm`, because
//!   another processor or another run must not round differently.
//! * [`record`] never knows what a message means, and no other layer parses MCAP, because whether a record counts is
//!   decided once, whoever reads it.
//! * Nothing of the original is decoded and encoded again, because then nothing of it can be lost.
//! * [`engine`] never sees a topic's bytes and [`annotate`] never sees a sample, because either may change alone.
//! * [`annotate`] closes a block by the recording's chunks and log times, never by the time of day, because a tail must
//!   write what batch writes.
//! * The shell never decides what is published, because the gate belongs to [`fit`] and [`engine`], where it is tested.
//! * Files import downward and in no circle, because a reader must be able to begin anywhere.
//!
//! # Where to begin
//!
//! [`engine::Engine`] for what is learned and when; [`fit`] for the models; [`imu::Intake`] for how messages are read;
//! [`run::annotate`](run::annotate()) and [`run::tail`](run::tail()) for what the program does. A preset is an entry in
//! the table of `imu/preset.rs`, a model a file in `fit/`, a format of others a file in `report/export/`, a message type a
//! line in `imu/mapping/known_types.rs`, an annotation a message in `schemas/` and a kind in [`topic`].
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
pub mod merge;
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
