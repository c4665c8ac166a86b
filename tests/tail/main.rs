//! Following recordings while they are recorded, by writers that are not ours, through everything that can happen.
//!
//! `STILLPOINT_SPEED=1` records in real time, `STILLPOINT_KILLS=300` kills more often; the defaults are short.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/drives.rs"]
mod drives;
#[path = "../common/many_channels.rs"]
mod many_channels;
#[path = "../common/session.rs"]
mod session;
#[path = "../common/warm.rs"]
mod warm;

mod checkpoints;
mod equality;
mod events;
mod folders;
mod following;
mod headings;
mod killed;
mod recorder;
mod rotations;
mod splits;
mod temperature;
mod times;
mod troubles;
mod watched;
