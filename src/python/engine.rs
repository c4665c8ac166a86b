//! Calibration of arrays: all at once, or block by block.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::de::DeserializeOwned;
use serde_json::Value;
use stillpoint::imu::Preset;
use stillpoint::messages::foxglove::log::Level;
use stillpoint::still::State;

use crate::arrays::{Readings, Times};
use crate::calibration::Calibration;
use crate::settings::configuration;
use crate::stream::{Imu, Stream};

/// Rows that are worked on at a time, between which Python is asked whether to stop.
const BLOCK: usize = 1 << 16;

/// Calibrate an IMU from its readings.
///
/// Parameters
/// ----------
/// t : array_like, shape (n,)
///     Times of the readings: int64 nanoseconds, float64 seconds, or datetime64.
/// accel : array_like, shape (n, 3)
///     Readings of the accelerometer, m/s². Rows that are not finite are left out.
/// gyro : array_like, shape (n, 3), optional
///     Readings of the gyroscope at the same times, rad/s.
/// name : str
///     Name of the IMU in texts and results.
/// preset : str, optional
///     Type of the sensor, such as ``"mpu9250"``: what its datasheet promises.
/// accel_unit : {"m/s^2", "g"}, optional
///     Unit of `accel`. Without it, m/s², which the length of gravity has to confirm.
/// gyro_unit : {"rad/s", "deg/s"}, optional
///     Unit of `gyro`. Without it, rad/s, which the turns between rests have to confirm.
/// config : path, optional
///     Configuration file (TOML), as ``stillpoint config show`` prints it.
/// settings : dict, optional
///     Settings over the file, for example ``{"fit": {"gravity": 9.81}}`` or ``{"fit.gravity": 9.81}``.
///
/// Returns
/// -------
/// Calibration
///
/// Raises
/// ------
/// ValueError
///     If a shape, a time, a unit, a preset or the configuration is wrong.
/// TypeError
///     If an array has no real numbers.
///
/// Notes
/// -----
/// Warnings and decisions go to the logger ``stillpoint`` of `logging`.
#[pyfunction]
#[pyo3(signature = (
    t, accel, gyro=None, *, name="imu", preset=None, accel_unit=None, gyro_unit=None, config=None, settings=None
))]
#[allow(clippy::too_many_arguments)]
pub fn calibrate(
    t: &Bound<'_, PyAny>,
    accel: &Bound<'_, PyAny>,
    gyro: Option<&Bound<'_, PyAny>>,
    name: &str,
    preset: Option<&str>,
    accel_unit: Option<&str>,
    gyro_unit: Option<&str>,
    config: Option<PathBuf>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Calibration> {
    let mut engine = Engine::new(name, preset, accel_unit, gyro_unit, config, settings)?;
    engine.push(t, Some(accel), gyro)?;
    engine.finish(t.py())
}

/// Calibration of an IMU whose readings come in blocks.
///
/// The result is that of `calibrate` on all of them, however they are divided.
///
/// Parameters
/// ----------
/// name, preset, accel_unit, gyro_unit, config, settings
///     As for `calibrate`.
#[pyclass(module = "stillpoint")]
pub struct Engine {
    stream: Stream,
    is_finished: bool,
}

#[pymethods]
impl Engine {
    #[new]
    #[pyo3(signature = (*, name="imu", preset=None, accel_unit=None, gyro_unit=None, config=None, settings=None))]
    fn new(
        name: &str,
        preset: Option<&str>,
        accel_unit: Option<&str>,
        gyro_unit: Option<&str>,
        config: Option<PathBuf>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let imu = Imu {
            name: name.to_owned(),
            preset: preset.map(|name| one_of::<Preset>("preset", name)).transpose()?,
            accel_unit: accel_unit.map(|unit| one_of("accel_unit", unit)).transpose()?,
            gyro_unit: gyro_unit.map(|unit| one_of("gyro_unit", unit)).transpose()?,
        };
        let config = configuration(config.as_ref(), settings)?;
        Ok(Self { stream: Stream::new(&imu, &config), is_finished: false })
    }

    /// Take a block of readings.
    ///
    /// Parameters
    /// ----------
    /// t : array_like, shape (n,)
    ///     Times of the readings: int64 nanoseconds, float64 seconds, or datetime64. Blocks follow each other in time.
    /// accel, gyro : array_like, shape (n, 3), optional
    ///     Readings, m/s² and rad/s. Sensors that are read at different times are pushed one by one, in short blocks.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape or time is wrong, or after `finish`.
    /// TypeError
    ///     If an array has no real numbers.
    #[pyo3(signature = (t, accel=None, gyro=None))]
    fn push(
        &mut self,
        t: &Bound<'_, PyAny>,
        accel: Option<&Bound<'_, PyAny>>,
        gyro: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        if self.is_finished {
            return Err(PyValueError::new_err("the engine is finished; make a new one for other readings"));
        }
        let (py, times) = (t.py(), Times::new(t)?);
        let accel = accel.map(|accel| Readings::new("accel", accel, times.length)).transpose()?;
        let gyro = gyro.map(|gyro| Readings::new("gyro", gyro, times.length)).transpose()?;
        for begin in (0..times.length).step_by(BLOCK) {
            let end = times.length.min(begin + BLOCK);
            let stamps = times.block(begin, end)?;
            let accel = accel.as_ref().map(|accel| accel.block(begin, end)).transpose()?;
            let gyro = gyro.as_ref().map(|gyro| gyro.block(begin, end)).transpose()?;
            let stream = &mut self.stream;
            py.detach(|| {
                for (i, stamp) in stamps.iter().enumerate() {
                    let of =
                        |readings: &'_ Option<Vec<_>>| readings.as_ref().and_then(|readings| readings.get(i)).copied();
                    stream.push(*stamp, of(&accel).as_ref(), of(&gyro).as_ref());
                }
            });
            py.check_signals()?;
        }
        self.tell(py)
    }

    /// End the recording: what is open is closed and published.
    ///
    /// Returns
    /// -------
    /// Calibration
    fn finish(&mut self, py: Python<'_>) -> PyResult<Calibration> {
        if !self.is_finished {
            self.is_finished = true;
            let stream = &mut self.stream;
            py.detach(|| stream.finish());
            self.tell(py)?;
        }
        Ok(self.calibration())
    }

    /// Calibration : What was learned so far.
    #[getter]
    fn calibration(&self) -> Calibration {
        Calibration::of(self.stream.findings.clone())
    }

    /// str : Whether the IMU rests: "UNKNOWN", "MOVING" or "STILL".
    #[getter]
    fn state(&self) -> &'static str {
        match self.stream.state() {
            State::Unknown => "UNKNOWN",
            State::Moving => "MOVING",
            State::Still => "STILL",
        }
    }
}

impl Engine {
    /// Sends what was logged to the logger of Python.
    fn tell(&mut self, py: Python<'_>) -> PyResult<()> {
        for (level, text) in self.stream.log.drain(..) {
            log(py, level, &text)?;
        }
        Ok(())
    }
}

/// Logs a line.
pub fn log(py: Python<'_>, level: Level, text: &str) -> PyResult<()> {
    let number = match level {
        Level::Fatal => 50,
        Level::Error => 40,
        Level::Warning => 30,
        Level::Info => 20,
        Level::Debug | Level::Unknown => 10,
    };
    let logger = py.import("logging")?.call_method1("getLogger", ("stillpoint",))?;
    logger.call_method1("log", (number, "%s", text)).map(drop)
}

/// A choice by its name in the configuration.
fn one_of<T: DeserializeOwned>(what: &str, name: &str) -> PyResult<T> {
    let value = serde_json::from_value(Value::String(name.to_owned()));
    value.map_err(|error| PyValueError::new_err(format!("{what}: {error}")))
}
