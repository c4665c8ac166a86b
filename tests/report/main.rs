//! What people and other programs are shown: reports, exports, layouts, numbers.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/fleet.rs"]
mod fleet;
#[path = "../common/hand.rs"]
mod hand;

#[path = "../common/warm.rs"]
mod warm;

mod account;
mod exports;
mod hostile_names;
mod layout;
mod merge;
mod merged_turns;
mod numbers;
mod page;
mod readable;
mod residuals;
mod temperature;
