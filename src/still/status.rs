//! What is said of an IMU's state of rest.

use serde::{Deserialize, Serialize};

/// Whether an IMU rests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// There is no credible noise floor yet.
    Unknown,
    /// It moves.
    Moving,
    /// It rests.
    Still,
}

/// The state and what it was judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// The state.
    pub state: State,
    /// Largest of the voting triads' deviations over their floors; NaN while there is none.
    pub statistic: f64,
    /// The statistic under which the IMU is still.
    pub enter: f64,
    /// The statistic above which it moves.
    pub leave: f64,
    /// √(Σ variance of the axes) believed of the accelerometer at rest, m/s².
    pub accel_floor: Option<f64>,
    /// The same of the gyroscope, rad/s.
    pub gyro_floor: Option<f64>,
}
