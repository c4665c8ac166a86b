//! Temperature of an IMU in the messages of a channel.

use serde::{Deserialize, Serialize};

use crate::imu::schema::layout::{Layout, Place};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::FieldPath;

/// Request to read the temperature of an IMU from the messages of one topic.
#[derive(Clone, Copy, Debug)]
pub(in crate::imu) struct TemperatureRequest<'a> {
    /// Configured path.
    pub(in crate::imu) path: Option<&'a FieldPath>,
    /// Place in a message of a known type.
    pub(in crate::imu) known: Option<&'a FieldPath>,
    /// Offset to add to a value so that it is in °C.
    pub(in crate::imu) offset: f64,
    /// Whether it was configured; if not, a message without the field has no temperature.
    pub(in crate::imu) configured: bool,
}

/// Temperature among the numbers of a message.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Thermometer {
    /// Index into the numbers.
    at: usize,
    offset: f64,
}

/// Reason why a channel has no temperature.
#[derive(Debug, thiserror::Error)]
pub(in crate::imu) enum TemperatureError {
    #[error(transparent)]
    Path(#[from] PathError),
    #[error("which field is the temperature? Set `temperature` to its path, or to {{ topic = \"…\", path = \"…\" }}")]
    NoPath,
}

impl TemperatureRequest<'_> {
    /// Path and place in messages of this layout; `None` if a known type lacks it in this recording.
    pub(in crate::imu) fn find(&self, layout: &Layout) -> Result<Option<(FieldPath, Place)>, TemperatureError> {
        match (self.path.or(self.known), self.configured) {
            (Some(path), true) => Ok(Some((path.clone(), layout.number(path)?))),
            (Some(path), false) => Ok(layout.find_number(path).map(|place| (path.clone(), place))),
            (None, true) => Err(TemperatureError::NoPath),
            (None, false) => Ok(None),
        }
    }
}

impl Thermometer {
    pub(in crate::imu) fn new(at: usize, offset: f64) -> Self {
        Self { at, offset }
    }

    /// Temperature in the numbers of a message, °C; `None` where it is marked as absent by NaN, or is that of no sensor.
    pub(in crate::imu) fn read(&self, numbers: &[f64]) -> Option<f64> {
        /// Coldest and hottest that a sensor works at, with room, °C.
        const CREDIBLE: std::ops::RangeInclusive<f64> = -120.0..=400.0;
        numbers.get(self.at).map(|value| value + self.offset).filter(|celsius| CREDIBLE.contains(celsius))
    }
}
