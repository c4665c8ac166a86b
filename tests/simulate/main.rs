//! Simulated recordings: samples that say what the truth says, in whole files.
#![allow(clippy::unwrap_used)]

mod recording;
mod samples;
mod testdata;
