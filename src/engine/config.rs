//! Configuration of one engine: its IMU, and the settings of rests and fits.

use serde::{Deserialize, Serialize};

use crate::imu::{AccelUnit, Preset, RateUnit, SecondaryModel};
use crate::{fit, still};

/// Settings of an engine and properties of its IMU.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Name of the IMU in log messages, such as its output name.
    pub name: String,
    /// Frame of the messages.
    pub frame_id: String,
    /// Topic of the accelerometer.
    pub accelerometer: String,
    /// Topic of the gyroscope.
    pub gyroscope: String,
    /// Secondary accelerometers.
    pub secondary: Vec<Secondary>,
    /// Type of the sensor, if known; [`Config::of`] sets it together with the values of its datasheet.
    pub preset: Option<Preset>,
    /// Unit that the accelerometer's readings were converted from, if one is set.
    pub accel_unit: Option<AccelUnit>,
    /// Unit that the gyroscope's readings were converted from, if one is set: then no confirmation of it is needed.
    pub gyro_unit: Option<RateUnit>,
    /// Whether a reference provides the true values.
    pub reference: bool,
    /// Settings of the detection of rests.
    pub still: still::Config,
    /// Settings of the fit.
    pub fit: fit::Config,
}

/// Secondary accelerometer, which moves with the IMU.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Secondary {
    /// Name in the annotations.
    pub name: String,
    /// Topic of the accelerometer.
    pub topic: String,
    /// Type of the sensor, if known.
    pub preset: Option<Preset>,
    /// Measurement model.
    pub model: SecondaryModel,
}
