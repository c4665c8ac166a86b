//! Events: results on an IMU, each with the time at which it was known.

use crate::Stamp;
use crate::messages;
use crate::messages::foxglove::log::Level;

/// Result, with the time at which it was known.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Log time of the sample that caused it.
    pub log_time: u64,
    /// Result as a message.
    pub message: Message,
}

impl Event {
    /// Text for people, from the IMU of this name.
    pub(super) fn log(name: &str, (stamp, log_time): (Stamp, u64), level: Level, message: String) -> Self {
        let log = messages::foxglove::Log {
            timestamp: Some(stamp.into()),
            level: level.into(),
            message,
            name: name.to_owned(),
            ..Default::default()
        };
        Self { log_time, message: Message::Log(log) }
    }
}

/// Content of an [`Event`].
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// State of rest, when it changed or a second has passed.
    Stillness(messages::Stillness),
    /// Segment, when a rest ended or the verdict on an earlier one changed.
    Segment(messages::Segment),
    /// Turn, when a turn between two rests ended or the verdict on an earlier one changed.
    Turn(messages::Turn),
    /// Sums of the noise at rest, at the end.
    Noise(messages::Noise),
    /// Coverage: the faces seen, and the next step.
    Coverage(messages::Coverage),
    /// Calibration of a published refit.
    Calibration(Box<messages::Calibration>),
    /// Warning or decision for people.
    Log(messages::foxglove::Log),
}
