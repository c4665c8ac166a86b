//! Annotations read back: the bytes of a message to what the engine said. The inverse of [`ros2`](super::ros2) where the
//! recording is ROS 2; bytes that are not ours are refused.

use prost::Message as _;
use prost_reflect::{DynamicMessage, Kind, MessageDescriptor, ReflectMessage, Value};

use super::encoding::descriptor;
use super::ros2::Type;
use crate::engine::Message;
use crate::messages::{Calibration, Coverage, Segment};

/// The annotation in a message on a topic, with the name of its IMU; `None` for stillness, logs, and what is not ours.
///
/// `encoding` is that of the message: `cdr` or `protobuf`.
pub fn read<'a>(topic: &'a str, encoding: &str, data: &[u8]) -> Option<(&'a str, Message)> {
    let (imu, kind) = topic.split_once("/stillpoint/")?;
    let message = match kind {
        "segment" => Message::Segment(decode::<Segment>(encoding, data)?),
        "coverage" => Message::Coverage(decode::<Coverage>(encoding, data)?),
        "calibration" => Message::Calibration(Box::new(decode::<Calibration>(encoding, data)?)),
        _ => return None,
    };
    Some((imu, message))
}

fn decode<M: prost::Message + prost::Name + Default>(encoding: &str, data: &[u8]) -> Option<M> {
    match encoding {
        "protobuf" => M::decode(data).ok(),
        "cdr" => {
            let body = data.strip_prefix(&[0, 1, 0, 0])?;
            let message = Reader { body, at: 0 }.message(&descriptor::<M>())?;
            M::decode(message.encode_to_vec().as_slice()).ok()
        }
        _ => None,
    }
}

/// Reads CDR, little-endian, version 1.
struct Reader<'a> {
    body: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn message(&mut self, descriptor: &MessageDescriptor) -> Option<DynamicMessage> {
        let mut message = DynamicMessage::new(descriptor.clone());
        if Type::of(descriptor) == Type::Time {
            let (seconds, nanos) = (i32::from_le_bytes(self.aligned()?), u32::from_le_bytes(self.aligned()?));
            message.try_set_field_by_name("seconds", Value::I64(seconds.into())).ok()?;
            message.try_set_field_by_name("nanos", Value::I32(i32::try_from(nanos).ok()?)).ok()?;
            return Some(message);
        }
        for field in descriptor.fields() {
            if field.is_list() {
                let length = self.length()?;
                let elements = (0..length).map(|_| self.value(&field.kind())).collect::<Option<Vec<_>>>()?;
                message.try_set_field(&field, Value::List(elements)).ok()?;
            } else {
                let value = self.value(&field.kind())?;
                if !(field.supports_presence() && is_absent(&value)) {
                    message.try_set_field(&field, value).ok()?;
                }
            }
        }
        Some(message)
    }

    fn value(&mut self, kind: &Kind) -> Option<Value> {
        Some(match kind {
            Kind::Message(descriptor) => Value::Message(self.message(descriptor)?),
            Kind::Enum(_) => Value::EnumNumber(self.bytes(1)?.first().copied()?.into()),
            Kind::Bool => Value::Bool(self.bytes(1)? != [0]),
            Kind::Uint32 => Value::U32(u32::from_le_bytes(self.aligned()?)),
            Kind::Uint64 => Value::U64(u64::from_le_bytes(self.aligned()?)),
            Kind::Double => Value::F64(f64::from_le_bytes(self.aligned()?)),
            Kind::String => {
                let length = self.length()?;
                let text = self.bytes(length)?.split_last()?.1;
                Value::String(std::str::from_utf8(text).ok()?.to_owned())
            }
            _ => return None,
        })
    }

    /// Elements or bytes that follow; none takes less than a byte.
    fn length(&mut self) -> Option<usize> {
        let length = u32::from_le_bytes(self.aligned()?) as usize;
        (length <= self.body.len() - self.at).then_some(length)
    }

    fn aligned<const SIZE: usize>(&mut self) -> Option<[u8; SIZE]> {
        self.at = self.at.next_multiple_of(SIZE);
        self.bytes(SIZE)?.try_into().ok()
    }

    fn bytes(&mut self, length: usize) -> Option<&[u8]> {
        let bytes = self.body.get(self.at..self.at.checked_add(length)?)?;
        self.at += length;
        Some(bytes)
    }
}

/// ROS 2 cannot leave a field out: a number that was not estimated reads NaN, and so does all of a vector.
fn is_absent(value: &Value) -> bool {
    match value {
        Value::F64(value) => value.is_nan(),
        Value::Message(message) => {
            let is_nan = |value: &Value| value.as_f64().is_some_and(f64::is_nan);
            message.descriptor().fields().all(|field| is_nan(&message.get_field(&field)))
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Encoding;
    use super::*;
    use crate::messages::{Face, Header, Triad, Vector3};

    fn calibration() -> Calibration {
        let vector = Vector3 { x: 0.1, y: -0.2, z: 1e-300 };
        Calibration {
            header: Some(Header {
                stamp: Some(prost_types::Timestamp { seconds: 5, nanos: 7 }),
                frame_id: "imu".into(),
            }),
            revision: 3,
            accelerometer: Some(Triad {
                sensor: "accelerometer".into(),
                model: 2,
                status: 1,
                bias: Some(vector),
                sensitivity: vec![1.0, 0.0, 0.5],
                chi2_per_dof: None,
                residual_rms: Some(0.25),
                notes: vec!["two".into(), String::new()],
                ..Triad::default()
            }),
            gyroscope: Some(Triad::default()),
            from: Some(prost_types::Timestamp { seconds: 1, nanos: 0 }),
            until: Some(prost_types::Timestamp { seconds: 2, nanos: 0 }),
            ..Calibration::default()
        }
    }

    #[test]
    fn what_was_written_reads_back_in_both_encodings() {
        let coverage = Coverage {
            header: calibration().header,
            faces: vec![Face { name: "+X".into(), normal: None, placements: 2, seconds: 1.5 }; 2],
            complete: true,
            next_step: "turn".into(),
        };
        for said in [Message::Calibration(Box::new(calibration())), Message::Coverage(coverage)] {
            let topic = match &said {
                Message::Coverage(_) => "/imu/stillpoint/coverage",
                _ => "/imu/stillpoint/calibration",
            };
            for (encoding, name) in [(Encoding::Ros2, "cdr"), (Encoding::Protobuf, "protobuf")] {
                let data = encoding.encode(&said);
                assert_eq!(read(topic, name, &data), Some(("/imu", said.clone())), "{name}");
            }
        }
    }

    #[test]
    fn bytes_that_are_not_ours_are_refused() {
        let data = Encoding::Ros2.encode(&Message::Calibration(Box::new(calibration())));
        for length in 0..data.len() {
            let cut = data.get(..length).unwrap();
            assert_eq!(read("/imu/stillpoint/calibration", "cdr", cut), None, "{length}");
        }
        assert_eq!(read("/imu/stillpoint/corrected", "cdr", &data), None);
        assert_eq!(read("/imu/data", "cdr", &data), None);
    }
}
