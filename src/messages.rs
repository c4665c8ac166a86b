//! Annotations that Stillpoint writes, as types generated from `schemas/` (see `tests/schemas.rs`).
//!
//! `schemas/stillpoint.proto` defines the meaning of the fields, with units and directions.
#![allow(missing_docs, clippy::all, clippy::pedantic)]

include!("messages/stillpoint.rs");

/// Foxglove's own messages, as far as Stillpoint writes them.
pub mod foxglove {
    include!("messages/foxglove.rs");
}

/// Descriptor set of every message, dependencies included, with the comments that state units and directions.
pub const DESCRIPTORS: &[u8] = include_bytes!("../schemas/descriptors.binpb");
