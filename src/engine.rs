//! Samples in, events out: the rests found and the calibration they determine.

use crate::messages;

/// Something that was learned, and when it was known.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Log time of the sample that caused it.
    pub log_time: u64,
    /// What was learned.
    pub message: Message,
}

/// What an [`Event`] says.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// The state of rest changed, or a second has passed.
    Stillness(messages::Stillness),
    /// A rest ended, or the verdict on an earlier one changed.
    Segment(messages::Segment),
    /// The faces seen, and the next step.
    Coverage(messages::Coverage),
    /// A refit was published.
    Calibration(Box<messages::Calibration>),
    /// A warning or decision for people.
    Log(messages::foxglove::Log),
}
