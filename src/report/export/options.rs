//! Options of an export.

use std::str::FromStr;

use crate::report::Parameters;

/// Options of an export.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the IMU; needed if the format holds one and there are several.
    pub imu: Option<String>,
    /// Accelerometer: the primary one, or a secondary one by its name.
    pub sensor: Option<String>,
    /// State of the calibrated readings, for formats whose reader applies them to raw ones.
    pub readings: Readings,
    /// Axes of the calibrated readings, for formats that prescribe axes.
    pub axes: Option<Axes>,
    /// Slot of the sensor in an autopilot.
    pub slot: u8,
    /// Values to write for random walks that the rests do not show.
    pub random_walk: Option<RandomWalk>,
}

/// Value to write for a random walk of a bias that the rests do not show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RandomWalk {
    /// The upper bound that the rests give.
    Bound,
    /// Given values of accelerometer and gyroscope, m/s³/√Hz and rad/s²/√Hz.
    Given([f64; 2]),
}

impl FromStr for RandomWalk {
    type Err = &'static str;

    /// Parses `bound`, or two positive numbers, `ACCEL,GYRO`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "bound" {
            return Ok(Self::Bound);
        }
        let number = |text: &str| text.trim().parse().ok().filter(|walk: &f64| *walk > 0.0 && walk.is_finite());
        match text.split(',').map(number).collect::<Option<Vec<_>>>().as_deref() {
            Some(&[accel, gyro]) => Ok(Self::Given([accel, gyro])),
            _ => Err("expected two positive numbers, ACCEL,GYRO, or the word bound"),
        }
    }
}

/// State of readings before calibration: raw or corrected.
#[derive(Clone, Debug, Default)]
pub enum Readings {
    /// Unspecified.
    #[default]
    Unsaid,
    /// Raw readings of the sensor.
    Raw,
    /// Already corrected with these parameters.
    Corrected(Parameters),
}

/// Directions of a sensor's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Forward, left, up: ROS
    Flu,
    /// Forward, right, down: autopilots
    Frd,
}

impl Axes {
    /// Both, each with its name and help text.
    pub const ALL: &[(Self, &str, &str)] =
        &[(Self::Flu, "flu", "Forward, left, up: ROS"), (Self::Frd, "frd", "Forward, right, down: autopilots")];

    /// Signs that convert the axes of one into those of the other, in both directions.
    pub(in crate::report) fn signs_to(self, other: Self) -> [f64; 3] {
        if self == other { [1.0; 3] } else { [1.0, -1.0, -1.0] }
    }
}
