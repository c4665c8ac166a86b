//! What the datasheets of common sensors promise. How the promises are used is left to the [`engine`](crate::engine).
//!
//! Offsets and sensitivities are the initial tolerance and the change over the whole range of temperatures together, of
//! the worst axis: a sensor in use is neither new nor at 25 °C.

use serde::{Deserialize, Serialize};

/// A known sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Analog Devices ADXL375, accelerometer.
    Adxl375,
    /// TDK InvenSense ICM-20948.
    Icm20948,
    /// STMicroelectronics LSM6DSO.
    Lsm6dso,
    /// InvenSense MPU-6000 and MPU-6050.
    Mpu6050,
    /// InvenSense MPU-9250.
    Mpu9250,
}

/// What a datasheet says, where it says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Datasheet {
    /// Document, revision and tables.
    pub source: &'static str,
    /// Of the accelerometer.
    pub accelerometer: Promise,
    /// Of the gyroscope; `None` where there is none, or no figure at hand.
    pub gyroscope: Option<Promise>,
}

/// Of one triad, in m/s² or rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Promise {
    /// Largest reading of its widest range.
    pub range: f64,
    /// Standard deviation of an axis at the bandwidth that the datasheet states it for, or its widest.
    pub noise: f64,
    /// Largest bias of an axis.
    pub bias: f64,
    /// Smallest and largest scale of an axis.
    pub scale: [f64; 2],
}

/// Standard gravity, m/s² (CGPM 1901): datasheets count in it.
const G: f64 = 9.80665;
const MG: f64 = 1e-3 * G;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

impl Preset {
    /// What its datasheet says.
    pub fn datasheet(self) -> &'static Datasheet {
        match self {
            Self::Adxl375 => &ADXL375,
            Self::Icm20948 => &ICM20948,
            Self::Lsm6dso => &LSM6DSO,
            Self::Mpu6050 => &MPU6050,
            Self::Mpu9250 => &MPU9250,
        }
    }
}

/// 0 g offset ±6 g; 18.4 to 22.6 LSB/g about 20.5; 5 mg/√Hz over the 50 Hz of its 100 Hz output, times √(π/2).
const ADXL375: Datasheet = Datasheet {
    source: "ADXL375 data sheet rev. B, table 1",
    accelerometer: Promise { range: 200.0 * G, noise: 44.3 * MG, bias: 6.0 * G, scale: [18.4 / 20.5, 22.6 / 20.5] },
    gyroscope: None,
};

/// 0 g ±50 mg on the board and ±0.8 mg/°C over 60 °C; ±0.5 % and ±0.026 %/°C over 65 °C; 230 µg/√Hz over 246 Hz.
const ICM20948: Datasheet = Datasheet {
    source: "ICM-20948 data sheet DS-000189 rev. 1.3, table 2",
    accelerometer: Promise { range: 16.0 * G, noise: 4.5 * MG, bias: 98.0 * MG, scale: [0.978, 1.022] },
    gyroscope: None,
};

/// 0 g ±20 mg and ±0.1 mg/°C over 65 °C, 0 °/s ±1 and ±0.01 °/s/°C; ±1 % and ±0.01 %/°C; ±16 g: 3.0 mg rms in low power;
/// 3.8 m°/s/√Hz over 500 Hz.
const LSM6DSO: Datasheet = Datasheet {
    source: "LSM6DSO data sheet DS12140 rev. 3, table 2",
    accelerometer: Promise { range: 16.0 * G, noise: 3.0 * MG, bias: 26.5 * MG, scale: [0.983, 1.017] },
    gyroscope: Some(Promise {
        range: 2000.0 * DEGREE,
        noise: 0.107 * DEGREE,
        bias: 1.65 * DEGREE,
        scale: [0.983, 1.017],
    }),
};

/// 0 g ±80 mg (z) and ±60 mg over temperature; ±3 % and ±0.02 %/°C over 65 °C; 400 µg/√Hz over 260 Hz. 0 °/s ±20 and ±20
/// over temperature, ±3 % and ±2 %, 0.05 °/s rms.
const MPU6050: Datasheet = Datasheet {
    source: "MPU-6000/MPU-6050 product specification PS-MPU-6000A-00 rev. 3.4, sections 6.1 and 6.2",
    accelerometer: Promise { range: 16.0 * G, noise: 8.1 * MG, bias: 140.0 * MG, scale: [0.957, 1.043] },
    gyroscope: Some(Promise { range: 2000.0 * DEGREE, noise: 0.05 * DEGREE, bias: 40.0 * DEGREE, scale: [0.95, 1.05] }),
};

/// 0 g ±80 mg (z) and ±1.5 mg/°C over 65 °C; ±3 % and ±0.026 %/°C; 8 mg rms. 0 °/s ±5 and ±30 over temperature, ±3 % and
/// ±4 %, 0.1 °/s rms.
const MPU9250: Datasheet = Datasheet {
    source: "MPU-9250 product specification PS-MPU-9250A-01 rev. 1.0, tables 1 and 2",
    accelerometer: Promise { range: 16.0 * G, noise: 8.0 * MG, bias: 177.5 * MG, scale: [0.953, 1.047] },
    gyroscope: Some(Promise { range: 2000.0 * DEGREE, noise: 0.1 * DEGREE, bias: 35.0 * DEGREE, scale: [0.93, 1.07] }),
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn promises_make_sense_and_name_their_source() {
        for preset in [Preset::Adxl375, Preset::Icm20948, Preset::Lsm6dso, Preset::Mpu6050, Preset::Mpu9250] {
            let Datasheet { source, accelerometer, gyroscope } = preset.datasheet();
            assert!(source.contains("rev."), "{source}");
            for promise in std::iter::once(accelerometer).chain(gyroscope) {
                assert!(0.0 < promise.noise && promise.noise < promise.bias && promise.bias < promise.range);
                assert!(promise.scale[0] < 1.0 && 1.0 < promise.scale[1]);
            }
        }
    }
}
