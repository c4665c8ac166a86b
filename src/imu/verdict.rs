//! What the channels of a recording are used for, and what was refused at the door.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::path::FieldPath;
use super::{Sensor, Suggestion};

/// What a channel is used for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    /// Samples are taken from it.
    Used(Vec<Use>),
    /// It says where the recording is made, and so how long gravity is.
    Position,
    /// It would be used, or might be, but cannot be read: why, in one line.
    Skipped(String),
    /// It is not an IMU as far as its type tells.
    Other {
        /// Paths of the vectors in its messages.
        vectors: Vec<FieldPath>,
        /// What it might be, where the names tell.
        suggestion: Option<Box<Suggestion>>,
    },
    /// JSON without a schema, of which no message has been seen.
    Untold,
    /// Stillpoint wrote it.
    Annotation,
}

/// One vector that is read from the messages of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Use {
    /// Output name of the IMU it belongs to; further IMUs on the same topic have their `frame_id` appended.
    pub imu: String,
    /// Which triad it is.
    pub sensor: Sensor,
    /// Name of the triad: `accelerometer`, `gyroscope`, or that of the secondary.
    pub name: String,
    /// Where it stands in the message.
    pub path: String,
    /// Where its x, y and z stand.
    pub axes: [String; 3],
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Used(uses) => {
                for (i, Use { imu, name, path, .. }) in uses.iter().enumerate() {
                    write!(f, "{}{name} of {imu} (", if i == 0 { "" } else { ", " })?;
                    f.write_str(if path.is_empty() { "the message itself)" } else { path })?;
                    f.write_str(if path.is_empty() { "" } else { ")" })?;
                }
                Ok(())
            }
            Self::Position => f.write_str("position, for the length of gravity"),
            Self::Skipped(reason) => write!(f, "skipped: {reason}"),
            Self::Other { vectors, .. } if vectors.is_empty() => f.write_str("not an IMU"),
            Self::Other { vectors, .. } => {
                let vectors: Vec<_> = vectors.iter().map(|path| format!("`{path}`")).collect();
                write!(f, "not an IMU as far as its type tells; it has the vectors {}", vectors.join(", "))
            }
            Self::Untold => f.write_str("JSON without a schema, and no message that tells its fields"),
            Self::Annotation => f.write_str("written by Stillpoint"),
        }
    }
}

/// Why a message or a reading is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Cause {
    /// The payload is not what the schema says; it was cut off, for instance.
    Malformed,
    /// The log time lies beyond the year 2262.
    LogTime,
    /// NaN, infinity, or left out of the message.
    NotFinite,
    /// The message says so itself: `covariance[0]` is −1.
    NotMeasured,
    /// An increment over no time at all.
    NoTime,
    /// All three axes have been exactly zero since the start: there is no such sensor.
    Zero,
    /// A topic that serves one IMU changed its `frame_id`.
    ForeignFrame,
    /// More `frame_id`s than any recording has.
    TooManyFrames,
}

impl Cause {
    pub(super) const ALL: [Self; 8] = [
        Self::Malformed,
        Self::LogTime,
        Self::NotFinite,
        Self::NotMeasured,
        Self::NoTime,
        Self::Zero,
        Self::ForeignFrame,
        Self::TooManyFrames,
    ];
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Malformed => "the payload is not what the schema says",
            Self::LogTime => "the log time lies beyond the year 2262",
            Self::NotFinite => "NaN, infinity, or not in the message",
            Self::NotMeasured => "marked as not measured (covariance[0] is -1)",
            Self::NoTime => "an increment over no time",
            Self::Zero => "exactly zero from the start, taken as absent",
            Self::ForeignFrame => "its frame_id differs from that of the topic's first message",
            Self::TooManyFrames => "too many different frame_ids on one topic",
        })
    }
}

/// How often something was refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Where the messages came from.
    pub topic: String,
    /// Name of the triad, unless whole messages were refused.
    pub sensor: Option<String>,
    /// Why.
    pub cause: Cause,
    /// How often.
    pub count: u64,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, sensor, cause, count } = self;
        match sensor {
            Some(sensor) => write!(f, "{topic}, {sensor}: {count} readings refused: {cause}"),
            None => write!(f, "{topic}: {count} messages refused: {cause}"),
        }
    }
}

/// Something that people should know, said when it is first seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Notice {
    /// Log time of the message that showed it.
    pub log_time: u64,
    /// The topic of that message.
    pub topic: String,
    /// One line, topic included.
    pub text: String,
}

/// Refusals by cause.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Counts([u64; Cause::ALL.len()]);

impl Counts {
    /// How often the cause has been counted, this time included.
    pub(super) fn count(&mut self, cause: Cause) -> u64 {
        let Some(count) = self.0.get_mut(cause as usize) else { return 0 };
        *count += 1;
        *count
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (Cause, u64)> {
        Cause::ALL.into_iter().zip(self.0).filter(|&(_, count)| count > 0)
    }
}
