//! Datasheets of common sensors, one entry each in [`DATASHEETS`]. [`engine`](crate::engine) applies their
//! figures.
//!
//! Biases and scales include the initial tolerance and the change over the whole temperature range, for the worst axis:
//! a sensor in use is neither new nor at 25 °C. A figure that was not available is left out, and the assumption for any
//! sensor stays.
//!
//! The repeatability of placements is mostly not a property of the sensor. How it is put down, and the effect of its
//! board, are [known from real sessions](REPEATS). Its own part is that it warms between placements, by a kelvin say.

mod datasheet;

use serde::de::{self, Deserialize, Deserializer};
use serde::{Serialize, Serializer};

use self::datasheet::G;
pub use self::datasheet::{Datasheet, TriadDatasheet};

/// A known sensor, by its index in [`DATASHEETS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset(usize);

impl Preset {
    /// Sensor with this name in the configuration.
    pub fn named(name: &str) -> Option<Self> {
        NAMES.iter().position(|known| *known == name).map(Self)
    }

    /// Datasheet of the sensor.
    pub fn datasheet(self) -> &'static Datasheet {
        &DATASHEETS[self.0]
    }
}

impl Serialize for Preset {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.datasheet().name)
    }
}

impl<'de> Deserialize<'de> for Preset {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::named(&name).ok_or_else(|| de::Error::unknown_variant(&name, &NAMES))
    }
}

/// Smallest standard deviation between placements that is assumed for any sensor, m/s²: the best of real six-face
/// sessions with an MPU-9250 (5 to 14 mm/s²).
const REPEATS: f64 = 0.005;

/// Thousandth of standard gravity, m/s².
const MG: f64 = 1e-3 * G;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Repeatability of an accelerometer whose bias changes by `per_kelvin`, in m/s² per kelvin.
const fn repeats(per_kelvin: f64) -> Option<f64> {
    Some(if per_kelvin > REPEATS { per_kelvin } else { REPEATS })
}

/// All known sensors, in alphabetical order.
pub static DATASHEETS: [Datasheet; 9] = [
    // Analog Devices ADIS16470: ±40 g in 800 LSB/g; ±2000 °/s in 10 LSB/(°/s), 0.008 °/s/√Hz over half of its 2000 Hz.
    // Its biases, their repeatability, and the noise of the accelerometer were not available.
    Datasheet {
        name: "adis16470",
        source: "ADIS16470 data sheet rev. C, features; steps and output rate as Linux has them, drivers/iio/imu/adis16475.c",
        accelerometer: TriadDatasheet {
            range: 40.0 * G,
            step: G / 800.0,
            noise: None,
            bias: None,
            scale: None,
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: 0.1 * DEGREE,
            noise: Some(0.25 * DEGREE),
            bias: None,
            scale: None,
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // Analog Devices ADXL375, accelerometer: 0 g offset ±6 g; 18.4 to 22.6 LSB/g about 20.5, 49 mg a step; 5 mg/√Hz
    // over the 50 Hz of its 100 Hz output, times √(π/2). The temperature dependence of the offset was not available.
    Datasheet {
        name: "adxl375",
        source: "ADXL375 data sheet rev. B, table 1",
        accelerometer: TriadDatasheet {
            range: 200.0 * G,
            step: 49.0 * MG,
            noise: Some(44.3 * MG),
            bias: Some(6.0 * G),
            scale: Some([18.4 / 20.5, 22.6 / 20.5]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: None,
    },
    // Bosch BMI088: 0 g ±20 mg and ±0.2 mg/K over 60 K; 1365 LSB/g at ±24 g; 190 µg/√Hz (z) over half of its 1600 Hz. 0
    // °/s ±1 and ±0.015 °/s/K; 16.384 LSB/(°/s); 0.014 °/s/√Hz over half of its 2000 Hz.
    Datasheet {
        name: "bmi088",
        source: "BMI088 data sheet BST-BMI088-DS000-19 rev. 1.9, electrical specification (pages 7 and 8)",
        accelerometer: TriadDatasheet {
            range: 24.0 * G,
            step: G / 1365.0,
            noise: Some(5.4 * MG),
            bias: Some(32.0 * MG),
            scale: None,
            placement: repeats(0.2 * MG),
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: DEGREE / 16.384,
            noise: Some(0.44 * DEGREE),
            bias: Some(1.9 * DEGREE),
            scale: None,
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // Bosch BMI160: 0 g ±40 mg; 1966 to 2130 LSB/g about 2048 at ±16 g; 180 µg/√Hz over half of its 1600 Hz. 0 °/s ±10;
    // 15.9 to 16.9 LSB/(°/s) about 16.4; 0.007 °/s/√Hz over half of its 3200 Hz. The temperature dependence of the
    // offsets was not available.
    Datasheet {
        name: "bmi160",
        source: "BMI160 data sheet BST-BMI160-DS000 rev. 1.0, electrical specification (output signals)",
        accelerometer: TriadDatasheet {
            range: 16.0 * G,
            step: G / 2048.0,
            noise: Some(5.1 * MG),
            bias: Some(40.0 * MG),
            scale: Some([1966.0 / 2048.0, 2130.0 / 2048.0]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: DEGREE / 16.4,
            noise: Some(0.28 * DEGREE),
            bias: Some(10.0 * DEGREE),
            scale: Some([15.9 / 16.4, 16.9 / 16.4]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // TDK InvenSense ICM-20948: 0 g ±50 mg on the board and ±0.8 mg/°C over 60 °C; ±0.5 % and ±0.026 %/°C over 65 °C;
    // 2048 LSB/g; 230 µg/√Hz over 246 Hz; cross-axis ±2 %, nonlinearity ±0.5 %. 0 °/s ±5 and ±0.05 °/s/°C over 65 °C;
    // 0.015 °/s/√Hz over half of the 1125 Hz of its filter.
    Datasheet {
        name: "icm20948",
        source: "ICM-20948 data sheet DS-000189 rev. 1.3, tables 1 and 2",
        accelerometer: TriadDatasheet {
            range: 16.0 * G,
            step: G / 2048.0,
            noise: Some(4.5 * MG),
            bias: Some(98.0 * MG),
            scale: Some([0.978, 1.022]),
            placement: repeats(0.8 * MG),
            cross_axis: Some(0.02),
            nonlinearity: Some(0.005),
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: DEGREE / 16.4,
            noise: Some(0.36 * DEGREE),
            bias: Some(8.25 * DEGREE),
            scale: None,
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // TDK InvenSense ICM-42688-P: 0 g ±20 mg on the board and ±0.15 mg/°C over 65 °C; ±0.5 % and ±0.005 %/°C; 2048
    // LSB/g; 70 µg/√Hz (z) over 500 Hz. 0 °/s ±0.5 on the board and ±0.005 °/s/°C over 45 °C, ±0.5 % and ±0.005 %/°C;
    // 16.4 LSB/(°/s); 0.0028 °/s/√Hz over 500 Hz.
    Datasheet {
        name: "icm42688p",
        source: "ICM-42688-P data sheet DS-000347 (rev. not told by the copy that was read), tables 1 and 2",
        accelerometer: TriadDatasheet {
            range: 16.0 * G,
            step: G / 2048.0,
            noise: Some(1.57 * MG),
            bias: Some(29.75 * MG),
            scale: Some([0.99175, 1.00825]),
            placement: repeats(0.15 * MG),
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: DEGREE / 16.4,
            noise: Some(0.063 * DEGREE),
            bias: Some(0.725 * DEGREE),
            scale: Some([0.99275, 1.00725]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // STMicroelectronics LSM6DSO: 0 g ±20 mg and ±0.1 mg/°C over 65 °C, 0 °/s ±1 and ±0.01 °/s/°C; ±1 % and ±0.01 %/°C;
    // ±16 g: 3.0 mg rms in low power; 3.8 m°/s/√Hz over 500 Hz.
    Datasheet {
        name: "lsm6dso",
        source: "LSM6DSO data sheet DS12140 rev. 3, table 2",
        accelerometer: TriadDatasheet {
            range: 16.0 * G,
            step: 0.488 * MG,
            noise: Some(3.0 * MG),
            bias: Some(26.5 * MG),
            scale: Some([0.983, 1.017]),
            placement: repeats(0.1 * MG),
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: 0.07 * DEGREE,
            noise: Some(0.107 * DEGREE),
            bias: Some(1.65 * DEGREE),
            scale: Some([0.983, 1.017]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // InvenSense MPU-6000 and MPU-6050: 0 g ±80 mg (z) and ±60 mg over 70 °C; ±3 % and ±0.02 %/°C over 65 °C; 2048
    // LSB/g; 400 µg/√Hz over 260 Hz. 0 °/s ±20 and ±20 over temperature, ±3 % and ±2 %, 16.4 LSB/(°/s), 0.05 °/s rms.
    Datasheet {
        name: "mpu6050",
        source: "MPU-6000/MPU-6050 product specification PS-MPU-6000A-00 rev. 3.4, sections 6.1 and 6.2",
        accelerometer: TriadDatasheet {
            range: 16.0 * G,
            step: G / 2048.0,
            noise: Some(8.1 * MG),
            bias: Some(140.0 * MG),
            scale: Some([0.957, 1.043]),
            placement: repeats(60.0 / 70.0 * MG),
            cross_axis: None,
            nonlinearity: None,
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: DEGREE / 16.4,
            noise: Some(0.05 * DEGREE),
            bias: Some(40.0 * DEGREE),
            scale: Some([0.95, 1.05]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
    // InvenSense MPU-9250: 0 g ±80 mg (z) and ±1.5 mg/°C over 65 °C; ±3 % and ±0.026 %/°C; 2048 LSB/g; 8 mg rms;
    // cross-axis ±2 %, nonlinearity ±0.5 %. 0 °/s ±5 and ±30 over temperature, ±3 % and ±4 %, 16.4 LSB/(°/s), 0.1 °/s
    // rms.
    Datasheet {
        name: "mpu9250",
        source: "MPU-9250 product specification PS-MPU-9250A-01 rev. 1.0, tables 1 and 2",
        accelerometer: TriadDatasheet {
            range: 16.0 * G,
            step: G / 2048.0,
            noise: Some(8.0 * MG),
            bias: Some(177.5 * MG),
            scale: Some([0.953, 1.047]),
            placement: repeats(1.5 * MG),
            cross_axis: Some(0.02),
            nonlinearity: Some(0.005),
        },
        gyroscope: Some(TriadDatasheet {
            range: 2000.0 * DEGREE,
            step: DEGREE / 16.4,
            noise: Some(0.1 * DEGREE),
            bias: Some(35.0 * DEGREE),
            scale: Some([0.93, 1.07]),
            placement: None,
            cross_axis: None,
            nonlinearity: None,
        }),
    },
];

/// Names of the sensors, in the order of their datasheets.
static NAMES: [&str; DATASHEETS.len()] = {
    let mut names = [""; DATASHEETS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = DATASHEETS[i].name;
        i += 1;
    }
    names
};

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn promises_make_sense_and_name_their_source() {
        for Datasheet { name, source, accelerometer, gyroscope } in &DATASHEETS {
            assert_eq!(Preset::named(name).unwrap().datasheet().name, *name);
            assert!(source.contains("rev."), "{source}");
            for promise in std::iter::once(accelerometer).chain(gyroscope) {
                let bias = promise.bias.unwrap_or(promise.range / 2.0);
                assert!(promise.noise.is_none_or(|noise| 0.0 < noise && noise < bias) && bias < promise.range);
                assert!(promise.scale.is_none_or(|[least, most]| least < 1.0 && 1.0 < most));
                // About sixteen bits, and noise that is not far below a step.
                assert!((1e3..1e5).contains(&(2.0 * promise.range / promise.step)));
                assert!(promise.placement.is_none_or(|std| (REPEATS..0.02).contains(&std)));
            }
        }
    }
}
