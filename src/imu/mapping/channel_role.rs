//! Role of a channel, and the vectors that are read from it.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::imu::mapping::suggestion::Suggestion;
use crate::imu::sample::Sensor;
use crate::imu::schema::path::FieldPath;

/// Role of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ChannelRole {
    /// Samples are read from it.
    Used(Vec<VectorUse>),
    /// It provides the temperature of an IMU.
    Temperature {
        /// Output name of the IMU.
        imu: String,
        /// Path in the message.
        path: String,
    },
    /// It provides the heading that turns are compared with.
    Heading {
        /// Path in the message.
        path: String,
    },
    /// It provides the position of the recording, and so the magnitude of gravity.
    Position,
    /// It should or might be used, but cannot be read; the reason in one line.
    Skipped(String),
    /// It is not an IMU, judging by its type.
    Other {
        /// Paths of the vectors in its messages.
        vectors: Vec<FieldPath>,
        /// Paths of the first numbers, if there are no vectors but numbers enough for one.
        numbers: Vec<FieldPath>,
        /// Possible IMU or accelerometer, judging by the names.
        suggestion: Option<Box<Suggestion>>,
    },
    /// JSON without a schema, of which no message has been seen.
    Untold,
    /// Written by Stillpoint.
    Annotation,
}

/// A vector that is read from the messages of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VectorUse {
    /// Output name of the IMU it belongs to; further IMUs on the same topic have their `frame_id` appended.
    pub imu: String,
    /// Triad that it is.
    pub sensor: Sensor,
    /// Name of the triad: `accelerometer`, `gyroscope`, or that of the secondary.
    pub name: String,
    /// Path in the message.
    pub path: String,
    /// Paths of its x, y and z.
    pub axes: [String; 3],
}

impl fmt::Display for ChannelRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Used(uses) => {
                for (i, VectorUse { imu, name, path, .. }) in uses.iter().enumerate() {
                    write!(f, "{}{name} of {imu} (", if i == 0 { "" } else { ", " })?;
                    f.write_str(if path.is_empty() { "the message itself)" } else { path })?;
                    f.write_str(if path.is_empty() { "" } else { ")" })?;
                }
                Ok(())
            }
            Self::Temperature { imu, path } => write!(f, "temperature of {imu} ({path})"),
            Self::Heading { path } => write!(f, "heading, for turns about the vertical ({path})"),
            Self::Position => f.write_str("position, for the length of gravity"),
            Self::Skipped(reason) => write!(f, "skipped: {reason}"),
            Self::Other { vectors, numbers, .. } if vectors.is_empty() && numbers.is_empty() => {
                f.write_str("not an IMU")
            }
            Self::Other { vectors, numbers, .. } if vectors.is_empty() => {
                let numbers: Vec<_> = numbers.iter().map(FieldPath::called).collect();
                write!(
                    f,
                    "not an IMU as far as its type tells; it has the numbers {}, of which three make a vector: \
                     accel = [\"…\", \"…\", \"…\"]",
                    numbers.join(", ")
                )
            }
            Self::Other { vectors, .. } => {
                let vectors: Vec<_> = vectors.iter().map(FieldPath::called).collect();
                write!(f, "not an IMU as far as its type tells; it has the vectors {}", vectors.join(", "))
            }
            Self::Untold => f.write_str("JSON without a schema, and no message that tells its fields"),
            Self::Annotation => f.write_str("written by Stillpoint"),
        }
    }
}
