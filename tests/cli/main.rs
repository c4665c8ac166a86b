//! The program as people and scripts run it: verbs, files, refusals, exit codes.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/hand.rs"]
mod hand;
#[path = "../common/session.rs"]
mod session;

mod batches;
mod compared;
mod containers;
mod contributing;
mod filtered;
mod fleet;
mod in_place;
mod met_cases;
mod mistakes;
mod mixed;
mod offers;
mod order;
mod readme;
mod real_recordings;
mod recordings;
mod refused;
mod results;
mod rooms;
mod rosbag2;
mod said;
mod shell;
mod splits;
mod terminal;
mod topics;
mod units;
mod unread;
