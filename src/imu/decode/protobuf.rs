//! Walk over protobuf messages in wire format, without building values and without allocation.
//!
//! As the specification demands (<https://protobuf.dev/programming-guides/encoding/>): of a repeated number, the last
//! value counts; repeated messages are merged; lists may be packed or not, whatever the schema says; unknown fields are
//! skipped.

mod grow;
mod plan;
mod walk;
mod wire;

pub(super) use grow::Missing;
pub(super) use plan::ProtobufPlan;
pub(super) use wire::alone;
