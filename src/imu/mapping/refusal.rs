//! Refusals of messages and readings: why, and how often.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Reason why a message or a reading is refused.
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
    pub(in crate::imu) const ALL: [Self; 8] = [
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
            Self::NotMeasured => "marked as not measured (covariance[0] is -1); if its driver measures all the same, map the topic with covariance = \"ignore\"",
            Self::NoTime => "an increment over no time",
            Self::Zero => "exactly zero from the start, taken as absent",
            Self::ForeignFrame => "its frame_id differs from that of the topic's first message",
            Self::TooManyFrames => "too many different frame_ids on one topic",
        })
    }
}

/// Number of refusals of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusalCount {
    /// Where the messages came from.
    pub topic: String,
    /// Name of the triad, unless whole messages were refused.
    pub sensor: Option<String>,
    /// Why.
    pub cause: Cause,
    /// How often.
    pub count: u64,
}

impl fmt::Display for RefusalCount {
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
pub(in crate::imu) struct Counts([u64; Cause::ALL.len()]);

impl Counts {
    /// Count of the cause, this time included.
    pub(in crate::imu) fn count(&mut self, cause: Cause) -> u64 {
        let Some(count) = self.0.get_mut(cause as usize) else { return 0 };
        *count += 1;
        *count
    }

    pub(in crate::imu) fn is_empty(&self) -> bool {
        self.iter().next().is_none()
    }

    pub(in crate::imu) fn iter(&self) -> impl Iterator<Item = (Cause, u64)> {
        Cause::ALL.into_iter().zip(self.0).filter(|&(_, count)| count > 0)
    }
}
