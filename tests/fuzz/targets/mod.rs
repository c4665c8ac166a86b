//! Laws that hold whatever the bytes, one file each. A law reads its case off the bytes and panics where it is broken.
//!
//! `tests/fuzz/main.rs` tries them on a few random bytes and on what once broke them, `.ci/fuzz` on what reaches new code.
#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs)]

pub mod bag;
pub mod checkpoints;
pub mod configuration;
pub mod decoders;
pub mod fold;
pub mod imports;
pub mod pipeline;
pub mod scan;
pub mod schemas;
pub mod tail;

mod language;
mod made;
mod session;

/// A law: it panics where some bytes break it.
pub type Law = fn(&[u8]);

/// All laws by name.
pub const ALL: [(&str, Law); 10] = [
    ("bag", bag::check),
    ("checkpoints", checkpoints::check),
    ("configuration", configuration::check),
    ("decoders", decoders::check),
    ("fold", fold::check),
    ("imports", imports::check),
    ("pipeline", pipeline::check),
    ("scan", scan::check),
    ("schemas", schemas::check),
    ("tail", tail::check),
];
