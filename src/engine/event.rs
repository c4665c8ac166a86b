//! Things learned of an IMU, each with the time at which it was known.

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
    /// A turn between two rests ended, or the verdict on an earlier one changed.
    Turn(messages::Turn),
    /// Sums of the noise at rest.
    Noise(messages::Noise),
    /// The faces seen, and the next step.
    Coverage(messages::Coverage),
    /// A refit was published.
    Calibration(Box<messages::Calibration>),
    /// A warning or decision for people.
    Log(messages::foxglove::Log),
}
