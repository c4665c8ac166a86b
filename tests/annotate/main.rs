//! What is written into a recording: annotations that read back as what they say, and corrected messages.
#![allow(clippy::unwrap_used)]

#[path = "../common/mod.rs"]
mod common;

mod arbitrary;
mod corrected;
mod expected;
mod messages;
mod pasted;
mod reader;
mod ros2_package;
mod schemas;
mod session;
