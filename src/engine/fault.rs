//! Faults of a stream that forbid a calibration or stand in its notes.

use serde::{Deserialize, Serialize};

use crate::imu::Sensor;

/// Fault of a triad that shows in its readings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    pub(super) sensor: Sensor,
    pub(super) kind: FaultKind,
    /// What was seen and what to do, for people.
    pub(super) text: String,
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum FaultKind {
    /// Axes are flipped, or exchanged, against the other sensor.
    Flipped,
    /// The gyroscope does not explain how gravity turned, and no flip does.
    Disagreeing,
    /// The turns say that it is in another unit.
    Unit,
    /// It reads more than any sensor measures.
    TooFast,
    /// Its mean relaxes to zero at rest.
    Relaxing,
    /// An axis never changes.
    Dead,
    /// Readings are published twice.
    Repeated,
    /// From face to face it spans far more than gravity.
    Stretched,
    /// It reads more than the sensor can measure.
    BeyondRange,
    /// The first rest reads −g on z.
    Inverted,
}

impl Fault {
    /// Whether a calibration must not be published in spite of it.
    pub(super) fn forbids(&self) -> bool {
        match self.kind {
            // A bias at rest is one, whatever the sign of the axis; an accelerometer's faces are not.
            FaultKind::Flipped => self.sensor == Sensor::Accelerometer,
            FaultKind::Unit
            | FaultKind::TooFast
            | FaultKind::Relaxing
            | FaultKind::Dead
            | FaultKind::Stretched
            | FaultKind::BeyondRange => true,
            FaultKind::Disagreeing | FaultKind::Repeated | FaultKind::Inverted => false,
        }
    }
}
