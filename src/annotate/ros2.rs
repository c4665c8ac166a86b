//! Annotations as ROS 2 messages: their types and bytes. The text of their definitions is
//! in [`ros2msg`](super::ros2msg), which walks the same fields in the same order.
//!
//! ROS 2 cannot omit a field. If nothing was estimated, every `float64` is NaN, also those of a message that is absent
//! as a whole; all other fields are zero or empty.

use prost_reflect::{DynamicMessage, Kind, MessageDescriptor, ReflectMessage, Value};
use prost_types::Timestamp;

use super::cdr::Writer;

/// ROS 2 type of a protobuf message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type<'a> {
    /// `builtin_interfaces/Time`, whose fields have other names.
    Time,
    /// `std_msgs/Header`, field by field.
    Header,
    /// A message of `stillpoint_msgs`, field by field.
    Own(&'a str),
}

impl<'a> Type<'a> {
    pub fn of(message: &'a MessageDescriptor) -> Self {
        match message.full_name() {
            "google.protobuf.Timestamp" => Self::Time,
            "stillpoint.Header" => Self::Header,
            _ => Self::Own(message.name()),
        }
    }

    /// Name in fields.
    pub fn name(self) -> String {
        match self {
            Self::Time => "builtin_interfaces/Time".to_owned(),
            Self::Header => "std_msgs/Header".to_owned(),
            Self::Own(name) => format!("stillpoint_msgs/{name}"),
        }
    }

    /// Name in schema records.
    pub fn schema_name(self) -> String {
        self.name().replacen('/', "/msg/", 1)
    }
}

/// Type of one element of a field.
///
/// # Panics
///
/// For kinds that `schemas/` does not use.
pub fn element_type(kind: &Kind) -> String {
    match kind {
        Kind::Message(message) => Type::of(message).name(),
        Kind::Enum(_) => "uint8".to_owned(),
        Kind::Bool => "bool".to_owned(),
        Kind::Uint32 => "uint32".to_owned(),
        Kind::Uint64 => "uint64".to_owned(),
        Kind::Double => "float64".to_owned(),
        Kind::String => "string".to_owned(),
        other => unreachable!("{other:?} has no ROS 2 type here yet"),
    }
}

/// Encodes a message.
pub fn encode(message: &DynamicMessage) -> Vec<u8> {
    let mut out = Writer::new();
    write_message(&mut out, message, true);
    out.finish()
}

/// Appends a message. `known` is false inside a message that is absent.
fn write_message(out: &mut Writer, message: &DynamicMessage, known: bool) {
    let descriptor = message.descriptor();
    if Type::of(&descriptor) == Type::Time {
        return write_timestamp(out, message);
    }
    for field in descriptor.fields() {
        let known = known && (!field.supports_presence() || message.has_field(&field));
        match message.get_field(&field).as_ref() {
            Value::List(elements) => {
                out.length(elements.len());
                elements.iter().for_each(|element| write_value(out, element, true));
            }
            value => write_value(out, value, known),
        }
    }
}

fn write_value(out: &mut Writer, value: &Value, known: bool) {
    match value {
        Value::Message(message) => write_message(out, message, known),
        Value::EnumNumber(number) => out.u8(u8::try_from(*number).unwrap_or(0)),
        Value::Bool(value) => out.bool(*value),
        Value::U32(value) => out.u32(*value),
        Value::U64(value) => out.u64(*value),
        Value::F64(value) => out.f64(if known { *value } else { f64::NAN }),
        Value::String(value) => out.string(value),
        other => unreachable!("{other:?} has no ROS 2 encoding here yet"),
    }
}

fn write_timestamp(out: &mut Writer, timestamp: &DynamicMessage) {
    let part = |name| timestamp.get_field_by_name(name);
    let seconds = part("seconds").and_then(|value| value.as_i64()).unwrap_or_default();
    let nanos = part("nanos").and_then(|value| value.as_i32()).unwrap_or_default();
    out.time(Timestamp { seconds, nanos });
}
