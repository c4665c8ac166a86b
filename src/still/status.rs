//! State of rest of an IMU, as reported.

use serde::{Deserialize, Serialize};

/// State of rest of an IMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// No credible noise floor yet.
    Unknown,
    /// Moving.
    Moving,
    /// At rest.
    Still,
}

/// State with the statistic and thresholds behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// State of rest.
    pub state: State,
    /// Largest deviation of the voting triads relative to their floors; NaN while there is none.
    pub statistic: f64,
    /// Statistic below which the IMU is still.
    pub enter: f64,
    /// Statistic above which the IMU moves.
    pub leave: f64,
    /// Noise floor of the accelerometer: √(Σ variance of the axes) at rest, m/s².
    pub accel_floor: Option<f64>,
    /// Noise floor of the gyroscope, likewise, rad/s.
    pub gyro_floor: Option<f64>,
}
