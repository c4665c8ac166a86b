//! From samples to a calibration: rests, models, bars, and what is recognised and never calibrated into.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/drives.rs"]
mod drives;
#[path = "../common/hand.rs"]
mod hand;
#[path = "../common/next_step.rs"]
mod next_step;
#[path = "../common/session.rs"]
mod session;

mod advice;
mod bars;
mod calibration;
mod gyroscope_faults;
mod heading_topics;
mod headings;
mod models;
mod movement;
mod partial;
mod position;
mod presets;
mod pushed;
mod recognised;
mod rests;
mod rotations;
mod status;
mod streams;
mod thesis;
mod turn_messages;
mod turns;
mod units;
