//! Refusals of messages and readings: causes and counts.

use crate::plural::counted;

use std::fmt;

use serde::{Deserialize, Serialize};

/// Reason why a message or a reading is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Cause {
    /// The payload does not match the schema; it was cut off, for instance.
    Malformed,
    /// The log time is beyond the year 2262.
    LogTime,
    /// NaN, infinity, beyond any reading, or missing in the message.
    NotFinite,
    /// Marked as not measured: `covariance[0]` is −1.
    NotMeasured,
    /// An increment over a time of zero.
    NoTime,
    /// All three axes have been exactly zero since the start: there is no such sensor.
    Zero,
    /// The `frame_id` changed on a topic that serves one IMU.
    ForeignFrame,
    /// More `frame_id`s than any real recording has.
    TooManyFrames,
    /// A `frame_id` that is longer than any real one.
    LongFrame,
}

impl Cause {
    pub(in crate::imu) const ALL: [Self; 9] = [
        Self::Malformed,
        Self::LogTime,
        Self::NotFinite,
        Self::NotMeasured,
        Self::NoTime,
        Self::Zero,
        Self::ForeignFrame,
        Self::TooManyFrames,
        Self::LongFrame,
    ];
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Malformed => "the payload is not what the schema says",
            Self::LogTime => "the log time lies beyond the year 2262",
            Self::NotFinite => "NaN, infinity, beyond what any sensor reads, or not in the message",
            Self::NotMeasured => "marked as not measured (covariance[0] is -1); if its driver measures all the same, map the topic with covariance = \"ignore\"",
            Self::NoTime => "an increment over no time",
            Self::Zero => "exactly zero from the start, taken as absent",
            Self::ForeignFrame => "its frame_id differs from that of the topic's first message",
            Self::TooManyFrames => "too many different frame_ids on one topic",
            Self::LongFrame => "its frame_id has more than 256 bytes",
        })
    }
}

/// Number of zeros from the start after which a triad is reported as absent.
pub(in crate::imu) const ZEROS: u64 = 100;

/// Number of refusals of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusalCount {
    /// Topic of the messages.
    pub topic: String,
    /// Name of the triad, unless whole messages were refused.
    pub sensor: Option<String>,
    /// Cause of the refusals.
    pub cause: Cause,
    /// Number of refusals.
    pub count: u64,
    /// Description of the first one, if the cause does not say everything.
    pub detail: Option<String>,
}

impl RefusalCount {
    /// Cause in words, with the first case if it says more.
    pub fn why(&self) -> String {
        match &self.detail {
            Some(detail) => format!("{}; the first: {detail}", self.cause),
            None => self.cause.to_string(),
        }
    }
}

impl fmt::Display for RefusalCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, sensor, count, .. } = self;
        let why = self.why();
        match sensor {
            Some(sensor) => write!(f, "{topic}, {sensor}: {} refused: {why}", counted(*count, "reading")),
            None => write!(f, "{topic}: {} refused: {why}", counted(*count, "message")),
        }
    }
}

/// A notice to users, given at the first occurrence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Notice {
    /// Log time of the message that caused it, in nanoseconds.
    pub log_time: u64,
    /// Topic of that message.
    pub topic: String,
    /// One line, topic included.
    pub text: String,
}

/// Number of refusals by cause.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Counts([u64; Cause::ALL.len()]);

impl Counts {
    /// Counts a refusal. Returns the number for this cause so far.
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
