//! Faults of a stream that forbid a calibration or appear in its notes.

use serde::{Deserialize, Serialize};

use crate::imu::Sensor;

/// Fault of a triad that shows in its readings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) sensor: Sensor,
    pub(super) kind: FaultKind,
    /// Text for people on what was seen and what to do.
    pub(super) text: String,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum FaultKind {
    /// Axes flipped or exchanged, relative to the other sensor.
    Flipped,
    /// Rates that do not explain how gravity turned, in any order of axes.
    Disagreeing,
    /// Another unit, by the turns or by gravity.
    Unit,
    /// Rates beyond any sensor's range.
    TooFast,
    /// Mean that relaxes to zero at rest.
    Relaxing,
    /// Axis that never changes.
    Dead,
    /// Readings published twice.
    Repeated,
    /// Readings of several sensors in turn.
    Alternating,
    /// Readings at rest that may be of several sensors in turn.
    Uneven,
    /// Span from face to face far beyond gravity.
    Stretched,
    /// Readings beyond the range of the sensor.
    BeyondRange,
    /// First rest of −g on z.
    Inverted,
    /// Rates of exactly zero at rest.
    Silenced,
    /// Bias that changes steadily.
    Drifting,
    /// Stamps of a clock that runs fast or slow.
    Clock,
    /// Turns that reach the end of the range.
    Clipped,
    /// Rests that were recorded twice.
    Replayed,
}

impl Fault {
    /// Whether the fault casts doubt on every rest.
    pub(super) fn doubts(&self) -> bool {
        matches!(self.kind, FaultKind::Replayed | FaultKind::Uneven)
    }

    /// Whether the fault forbids publishing a calibration.
    pub(super) fn forbids(&self) -> bool {
        match self.kind {
            // A bias at rest does not depend on the sign of the axis; an accelerometer's faces do.
            FaultKind::Flipped => self.sensor == Sensor::Accelerometer,
            FaultKind::Unit
            | FaultKind::TooFast
            | FaultKind::Relaxing
            | FaultKind::Dead
            | FaultKind::Alternating
            | FaultKind::Stretched
            | FaultKind::BeyondRange
            | FaultKind::Silenced => true,
            FaultKind::Disagreeing
            | FaultKind::Repeated
            | FaultKind::Uneven
            | FaultKind::Inverted
            | FaultKind::Drifting
            | FaultKind::Clock
            | FaultKind::Clipped
            | FaultKind::Replayed => false,
        }
    }
}
