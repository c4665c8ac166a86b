//! Decoding of annotations.

use prost::{Message as _, Name};
use prost_reflect::{DynamicMessage, FieldDescriptor, Kind, MessageDescriptor, Value};
use prost_types::Timestamp;
use thiserror::Error;

use super::cdr::Reader;
use super::encoding::descriptor;
use super::log;
use super::ros2::Type;
use crate::engine::Message;
use crate::messages::{Calibration, Coverage, Noise, Segment, Stillness, Turn, foxglove};

/// Reason why a message is not an annotation.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReadError {
    /// The type or encoding is not one that Stillpoint writes.
    #[error("{schema:?} as {encoding:?} is no annotation of Stillpoint: check which topic it is on")]
    Unknown {
        /// Name of the type.
        schema: String,
        /// Encoding of the message.
        encoding: String,
    },
    /// The type is one that Stillpoint writes, but the bytes do not match it.
    #[error("{schema} of {length} bytes {problem}: annotate the recording anew")]
    Broken {
        /// Name of the type.
        schema: String,
        /// Length of the message, in bytes.
        length: usize,
        /// Problem and its place.
        problem: String,
    },
}

/// Decodes one annotation. Fields that an encoding can only write as NaN or zero become absent again.
///
/// # Errors
///
/// If Stillpoint does not write this type in this encoding, or if the bytes do not match the type.
pub fn read(schema: &str, encoding: &str, data: &[u8]) -> Result<Message, ReadError> {
    let read = match (encoding, schema) {
        ("protobuf", "stillpoint.Stillness") => protobuf(data).map(Message::Stillness),
        ("protobuf", "stillpoint.Segment") => protobuf(data).map(Message::Segment),
        ("protobuf", "stillpoint.Turn") => protobuf(data).map(Message::Turn),
        ("protobuf", "stillpoint.Noise") => protobuf(data).map(Message::Noise),
        ("protobuf", "stillpoint.Coverage") => protobuf(data).map(Message::Coverage),
        ("protobuf", "stillpoint.Calibration") => protobuf(data).map(|read| Message::Calibration(Box::new(read))),
        ("protobuf", "foxglove.Log") => protobuf(data).map(Message::Log),
        ("cdr", "stillpoint_msgs/msg/Stillness") => cdr::<Stillness>(data).map(Message::Stillness),
        ("cdr", "stillpoint_msgs/msg/Segment") => cdr::<Segment>(data).map(Message::Segment),
        ("cdr", "stillpoint_msgs/msg/Turn") => cdr::<Turn>(data).map(Message::Turn),
        ("cdr", "stillpoint_msgs/msg/Noise") => cdr::<Noise>(data).map(Message::Noise),
        ("cdr", "stillpoint_msgs/msg/Coverage") => cdr::<Coverage>(data).map(Message::Coverage),
        ("cdr", "stillpoint_msgs/msg/Calibration") => {
            cdr::<Calibration>(data).map(|read| Message::Calibration(Box::new(read)))
        }
        ("cdr", log::SCHEMA_NAME) => cdr_log(data).map(Message::Log),
        _ => return Err(ReadError::Unknown { schema: schema.to_owned(), encoding: encoding.to_owned() }),
    };
    read.map_err(|problem| ReadError::Broken { schema: schema.to_owned(), length: data.len(), problem })
}

fn protobuf<M: prost::Message + Default>(data: &[u8]) -> Result<M, String> {
    M::decode(data).map_err(|error| format!("cannot be decoded ({error})"))
}

fn cdr<M: prost::Message + Name + Default>(data: &[u8]) -> Result<M, String> {
    let mut input = Reader::new(data)?;
    let (message, _) = message(&mut input, &descriptor::<M>())?;
    protobuf(&message.encode_to_vec())
}

fn cdr_log(data: &[u8]) -> Result<foxglove::Log, String> {
    let mut input = Reader::new(data)?;
    log::read(&mut input)
}

/// A message, and whether it holds any value.
fn message(input: &mut Reader, descriptor: &MessageDescriptor) -> Result<(DynamicMessage, bool), String> {
    let mut message = DynamicMessage::new(descriptor.clone());
    if Type::of(descriptor) == Type::Time {
        let Timestamp { seconds, nanos } = input.time()?;
        message.set_field_by_name("seconds", Value::I64(seconds));
        message.set_field_by_name("nanos", Value::I32(nanos));
        return Ok((message, seconds != 0 || nanos != 0));
    }
    let mut says_anything = false;
    for field in descriptor.fields() {
        let (value, says) = field_value(input, &field)?;
        says_anything |= says;
        if says || !field.supports_presence() {
            message.set_field(&field, value);
        }
    }
    Ok((message, says_anything))
}

/// A value, and whether it counts as present: NaN, zero and empty do not.
fn field_value(input: &mut Reader, field: &FieldDescriptor) -> Result<(Value, bool), String> {
    if !field.is_list() {
        return element(input, &field.kind());
    }
    let mut elements = Vec::new();
    for _ in 0..input.u32()? {
        elements.push(element(input, &field.kind())?.0);
    }
    let says = !elements.is_empty();
    Ok((Value::List(elements), says))
}

fn element(input: &mut Reader, kind: &Kind) -> Result<(Value, bool), String> {
    Ok(match kind {
        Kind::Message(descriptor) => {
            let (message, says) = message(input, descriptor)?;
            (Value::Message(message), says)
        }
        Kind::Enum(_) => input.u8().map(|number| (Value::EnumNumber(number.into()), number != 0))?,
        Kind::Bool => input.u8().map(|number| (Value::Bool(number != 0), number != 0))?,
        Kind::Uint32 => input.u32().map(|number| (Value::U32(number), number != 0))?,
        Kind::Uint64 => input.u64().map(|number| (Value::U64(number), number != 0))?,
        Kind::Double => input.f64().map(|number| (Value::F64(number), !number.is_nan()))?,
        Kind::String => input.string().map(|text| (Value::String(text.to_owned()), !text.is_empty()))?,
        other => unreachable!("{other:?} has no ROS 2 type here yet"),
    })
}
