//! Stillpoint calibrates inertial sensors from the moments when they rest.
//!
//! It reads IMU messages from MCAP recordings, finds the zero-velocity segments, fits bias and sensitivity, and writes
//! the results into an annotated recording that still contains the original, byte for byte.
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
//! From the bottom up; each layer may import only those above it in this list, and a test enforces that.
//!
//! * `error`, `stamp`: errors of commands, and times.
//! * [`topic`]: names of annotation topics. [`printable`]: escaping of outside text for printing. `plural`:
//!   numbers of things in sentences.
//! * [`messages`]: the annotations as types, generated from `schemas/`.
//! * [`record`]: MCAP bytes. Scanning a recording for messages, folding annotations into it, stripping them off.
//! * [`imu`]: samples, and how message bytes become samples: schema text to layout, layout to numbers, channels to
//!   IMUs.
//! * [`still`]: rests of a sensor, and its readings during them. The noise floor is learned here.
//! * [`turns`]: rotations of the sensor between its rests.
//! * [`fit`]: calibration of a sensor from its rests: faces, measurement models, uncertainty.
//! * [`engine`]: samples in, [events](engine::Event) out.
//! * [`annotate`]: events to message bytes and annotation blocks.
//! * [`config`]: the configuration file.
//! * [`report`]: findings, for people and in the formats of other programs.
//! * [`merge`]: combination of recordings of one sensor.
//! * [`pipeline`]: the events of a scan through all of these layers, for every reader of recordings.
//! * [`simulate`]: recordings with known truth.
//! * [`run`]: the shell. Its rooms: `input` (recordings, on disk or in a store), `output` (results, likewise), `store`
//!   (object stores), `batch`, `tail`, `watch`, `live` (viewers), `inspect` (topics, findings, strip).
//! * [`program`]: the command line, with `cli` (what was typed), `commands` (one file a verb) and `console`.
//!
//! `src/python/` is a crate of its own on top of all: the module that `pip install stillpoint` gives.
//!
//! # The path of a message
//!
//! In batch: `run/input` reads the bytes, [`record::Scan`] makes events of them, and `pipeline::learner::Learner` takes these
//! through all layers (`learner/use_message` is one message): its `Sources`, which are a table of channels and
//! [`imu::Intake`], make readings, [`imu::Timing`] corrects their times, [`engine::Engine`] makes events of those,
//! [`annotate::Annotator`] makes blocks. `run/batch` keeps the blocks of a file until it is read (of all files where one
//! result needs them), and [`record::Fold`] makes the annotated recording, as pieces that `run/output` writes; the
//! original's bytes are copied meanwhile.
//!
//! A recording is read a second time where accelerometer and gyroscope stand one behind the other in it
//! (`pipeline/time_order` finds them, `pipeline/time_merge` merges them), and for messages that are corrected by the last
//! calibration (`pipeline/correction_pass`).
//!
//! Batch does not decompress a chunk without useful channels: `pipeline/sources` says which channels are useful, the
//! listener of `run/batch/split_learner` passes that on unless `--verify` is set, `run/input/prefetch` answers
//! `Supply::Unread`, `record/scan/read_data` skips the chunk. A tail reads every chunk.
//!
//! In a tail: the same scan, pipeline, engine and annotator, fed by a growing file. [`record::Sidecar`] puts blocks
//! into the sidecar at once, and chunk indexes go into a log beside the checkpoint. At the end
//! [`record::SidecarBlocks`] passes the blocks of the sidecar to the same fold; no annotation is decoded, and none is
//! kept a second time.
//!
//! # What holds everywhere
//!
//! * A pure layer, which is every one but [`run`] and [`program`], never opens a file or socket, starts a thread, reads a clock or
//!   knows the command line, because its output must be a function of the bytes: batch, tail, resumed and distributed
//!   runs then give the same bytes, and every property can be tested without a disk.
//! * A pure layer never iterates over an unordered map, and takes its transcendental functions from `libm`, because
//!   another processor or another run must not round differently.
//! * [`record`] never knows the meaning of a message, and no other layer parses MCAP, because whether a record counts
//!   is decided once for every reader.
//! * Nothing of the original is decoded and encoded again, because then nothing of it can be lost.
//! * [`engine`] never sees a topic's bytes and [`annotate`] never sees a sample, because either may change alone.
//! * [`annotate`] closes a block by the recording's chunks and log times, never by the time of day, because a tail must
//!   write the same as batch.
//! * The shell never decides what is published, because the gate belongs to [`fit`] and [`engine`], where it is tested.
//! * Files import downward and without cycles, because a reader must be able to begin anywhere.
//!
//! # Where to begin
//!
//! [`engine::Engine`] for the order of learning; [`fit`] for the models; [`imu::Intake`] for reading messages;
//! [`run::annotate`](run::annotate()) and [`run::tail`](run::tail()) for the program's work. A preset is an entry in
//! the table of `imu/preset.rs`, the noise floor is learned in
//! `still/noise_floor.rs`, a model is a file in `fit/`, a foreign format a file in `report/export/`, a message type
//! a line in `imu/mapping/known_types.rs`, an annotation a message in `schemas/` and a kind in [`topic`].
//!
//! # Direction of the numbers
//!
//! Everywhere, `measured = bias + S · true`: the sensitivity `S` maps true to measured values. A reading is corrected
//! by `true = S⁻¹ (measured − bias)`. Accelerometers in m/s², gyroscopes in rad/s.
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

pub mod program;

mod cli;
mod commands;
mod console;
mod error;
mod plural;
mod printable;
mod stamp;

// The files of the program call the library by its name, as every other program would.
extern crate self as stillpoint;

pub use error::Error;
pub use printable::{printable, printable_json, shell_word};
pub use stamp::Stamp;

/// Runs the examples of the README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
