//! Configuration of one engine: its IMU, and how rests are found and fitted.

use serde::{Deserialize, Serialize};

use crate::imu::{AccelUnit, Preset, RateUnit, SecondaryModel};
use crate::{fit, still};

/// What an engine is to know of its IMU.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// What the IMU is called in log messages, its output name for instance.
    pub name: String,
    /// Frame of the messages.
    pub frame_id: String,
    /// Topic of the accelerometer.
    pub accelerometer: String,
    /// Topic of the gyroscope.
    pub gyroscope: String,
    /// The secondary accelerometers.
    pub secondary: Vec<Secondary>,
    /// Which sensor it is, if that is known; [`Config::of`] sets it with what its datasheet says.
    pub preset: Option<Preset>,
    /// Unit that the accelerometer's readings were converted from, if one is set.
    pub accel_unit: Option<AccelUnit>,
    /// Unit that the gyroscope's readings were converted from, if one is set: it is not asked for again.
    pub gyro_unit: Option<RateUnit>,
    /// Whether a reference tells what there was to read.
    pub reference: bool,
    /// How rests are found.
    pub still: still::Config,
    /// How a calibration is fitted.
    pub fit: fit::Config,
}

/// A further accelerometer that moves with the IMU.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Secondary {
    /// What it is called in the annotations.
    pub name: String,
    /// Its topic.
    pub topic: String,
    /// Which sensor it is, if that is known.
    pub preset: Option<Preset>,
    /// Which measurement model.
    pub model: SecondaryModel,
}
