//! Protobuf messages walked on the wire, without building values and without allocation.
//!
//! As parsers must (<https://protobuf.dev/programming-guides/encoding/>): of a field that comes twice, the last number
//! counts and messages are merged; lists may be packed or not, whatever the schema says; what is unknown is skipped.

mod plan;
mod walk;
mod wire;

pub(super) use plan::ProtobufPlan;
pub(super) use wire::alone;
