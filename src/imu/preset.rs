//! What the datasheets of common sensors promise. How the limits are used is left to [`fit`](crate::fit).

use serde::{Deserialize, Serialize};

/// A known accelerometer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Analog Devices ADXL375, ±200 g (data sheet rev. B, table 1).
    Adxl375,
}

/// Standard gravity, m/s² (CGPM 1901): datasheets count in it.
const G: f64 = 9.80665;

impl Preset {
    /// Lower and upper limit of the bias of an axis, m/s².
    pub fn bias(self) -> [f64; 2] {
        match self {
            // 0 g offset of any axis, ±6 g.
            Self::Adxl375 => [-6.0 * G, 6.0 * G],
        }
    }

    /// Lower and upper limit of the scale of an axis, read with the typical sensitivity.
    pub fn scale(self) -> [f64; 2] {
        match self {
            // 18.4 to 22.6 LSB/g about 20.5 LSB/g.
            Self::Adxl375 => [18.4 / 20.5, 22.6 / 20.5],
        }
    }
}
