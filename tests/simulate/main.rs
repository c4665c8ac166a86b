//! Simulated recordings: samples that say what the truth says, in whole files.
#![allow(clippy::unwrap_used)]

#[path = "../common/needs.rs"]
mod needs;

mod hand;
mod recording;
mod samples;
mod testdata;
