//! Calibration of one IMU, for Python.

use nalgebra::Vector3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use serde_json::Value;
use stillpoint::annotate::Corrections;
use stillpoint::imu::Sensor;
use stillpoint::merge::{self, Merged};
use stillpoint::printable;
use stillpoint::report::{Findings, imus};

use crate::arrays::{self, json};
use crate::tables;
use crate::triad::Triad;

/// Findings of one IMU: its triads, its rests, and the turns between them.
#[pyclass(frozen, module = "stillpoint")]
pub struct Calibration {
    findings: Findings,
    document: Value,
}

impl Calibration {
    /// Calibration by the findings of a recording.
    pub fn of(findings: Findings) -> Self {
        let document = first(imus([&findings]));
        Self { findings, document }
    }

    /// Calibration by many recordings.
    pub fn merged(merged: &Merged) -> Self {
        let mut document = merge::document(std::slice::from_ref(merged));
        let document = document.get_mut("imus").map(Value::take).map(first).unwrap_or_default();
        Self { findings: merged.findings.clone(), document }
    }

    fn triad(&self, key: &str) -> Triad {
        Triad::of(self.document.get(key).unwrap_or(&Value::Null))
    }
}

#[pymethods]
impl Calibration {
    /// str : Name of the IMU, which the topics of its annotations begin with.
    #[getter]
    fn name(&self) -> &str {
        &self.findings.name
    }

    /// str : Topic of its accelerometer.
    #[getter]
    fn topic(&self) -> &str {
        &self.findings.topic
    }

    /// Triad : The accelerometer.
    #[getter]
    fn accelerometer(&self) -> Triad {
        self.triad("accelerometer")
    }

    /// Triad : The gyroscope; "UNDETERMINED" if there is none.
    #[getter]
    fn gyroscope(&self) -> Triad {
        self.triad("gyroscope")
    }

    /// list of Triad : Further accelerometers.
    #[getter]
    fn secondary(&self) -> Vec<Triad> {
        let triads = self.document.get("secondary").and_then(Value::as_array);
        triads.into_iter().flatten().map(Triad::of).collect()
    }

    /// float : Length of gravity, m/s²; None before anything was published.
    #[getter]
    fn gravity(&self) -> Option<f64> {
        self.document.get("gravity")?.as_f64()
    }

    /// bool : Whether the accelerometer was calibrated.
    #[getter]
    fn is_calibrated(&self) -> bool {
        self.findings.is_calibrated()
    }

    /// str : Why the accelerometer was not calibrated; None if it was.
    #[getter]
    fn reason(&self) -> Option<&str> {
        self.findings.reason()
    }

    /// str : What to do next, in words.
    #[getter]
    fn next_step(&self) -> String {
        self.findings.next_step()
    }

    /// ndarray : The rests in time order, a structured array with one element each.
    ///
    /// Its fields: ``start``, ``end`` (int64 ns), ``accepted``, ``face`` (str), ``tilt_deg``, ``reason``,
    /// ``explanation`` (str), ``placement``, ``temperature`` (°C), ``accel``, ``accel_std``, ``gyro``, ``gyro_std`` (mean
    /// and standard deviation of one sample, m/s² and rad/s, three each). NaN where there is no number.
    #[getter]
    fn rests<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        tables::rests(py, &self.findings)
    }

    /// ndarray : The turns between rests in time order, a structured array with one element each.
    ///
    /// Its fields: ``start``, ``end`` (int64 ns), ``used``, ``reason``, ``explanation`` (str), ``angle``, ``path`` (rad),
    /// ``axis`` (unit length, three), ``vertical``, ``residual`` (rad), ``before``, ``after`` (placements). NaN where there
    /// is no number.
    #[getter]
    fn turns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        tables::turns(py, &self.findings)
    }

    /// str : What tells the sensor from others, of `merge`; else None.
    #[getter]
    fn key(&self) -> Option<&str> {
        self.document.get("key")?.as_str()
    }

    /// dict : How the sensor changed from recording to recording, of `merge`; else None.
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.document.get("history").map(|history| json(py, history)).transpose()
    }

    /// Correct readings: ``true = inv(S) @ (measured - bias)``.
    ///
    /// Parameters
    /// ----------
    /// accel : array_like, shape (3,) or (..., 3), optional
    ///     Readings of the accelerometer, m/s².
    /// gyro : array_like of the same shape, optional
    ///     Readings of the gyroscope, rad/s. If acceleration acts on it, `accel` of the same instants is needed.
    ///
    /// Returns
    /// -------
    /// ndarray or tuple of ndarray
    ///     The true values, in the shape of the readings: of one sensor, or of both in the order of the parameters.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a sensor is not determined, or a shape is wrong.
    #[pyo3(signature = (accel=None, gyro=None))]
    fn correct<'py>(
        &self,
        py: Python<'py>,
        accel: Option<&Bound<'py, PyAny>>,
        gyro: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let corrections = self.findings.calibration.as_ref().map(Corrections::of).unwrap_or_default();
        let accel = accel.map(|accel| arrays::rows("accel", accel)).transpose()?;
        let gyro = gyro.map(|gyro| arrays::rows("gyro", gyro)).transpose()?;
        if let (Some((_, one)), Some((_, other))) = (&accel, &gyro)
            && one != other
        {
            return Err(PyValueError::new_err(format!(
                "accel has shape {one:?}, gyro {other:?}: they must be the same"
            )));
        }
        let correct = |sensor, rows: &[Vector3<f64>], forces: Option<&[Vector3<f64>]>| {
            let force = |i| forces.and_then(|forces| forces.get(i)).copied();
            rows.iter()
                .enumerate()
                .map(|(i, row)| corrections.correct(sensor, *row, force(i)))
                .collect::<Option<Vec<_>>>()
        };
        let (force, rate) = py.detach(|| {
            let force = accel.as_ref().map(|(rows, _)| correct(Sensor::Accelerometer, rows, None));
            let known = force.as_ref().and_then(Option::as_deref);
            let rate = gyro.as_ref().map(|(rows, _)| correct(Sensor::Gyroscope, rows, known));
            (force, rate)
        });
        let alone = accel.is_none() && corrections.need_acceleration();
        let triads = [("accelerometer", force, accel), ("gyroscope", rate, gyro)];
        let given = triads.into_iter().filter_map(|(sensor, truth, read)| Some((sensor, truth?, read?.1)));
        let corrected = given.map(|(sensor, truth, shape)| {
            let truth = truth.ok_or_else(|| self.uncorrected(sensor, alone))?;
            arrays::array(py, &truth, &shape)
        });
        match corrected.collect::<PyResult<Vec<_>>>()?.as_slice() {
            [] => Err(PyValueError::new_err("nothing to correct: give accel, gyro, or both")),
            [one] => Ok(one.clone()),
            both => Ok(PyTuple::new(py, both)?.into_any()),
        }
    }

    /// Everything of it but the rests and turns, as ``stillpoint export --format json`` writes it.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.document)
    }

    fn __repr__(&self) -> String {
        let status =
            |key: &str| self.document.get(key).and_then(|triad| triad.get("status")?.as_str()).unwrap_or("none");
        let Findings { name, rests, .. } = &self.findings;
        let (accelerometer, gyroscope) = (status("accelerometer"), status("gyroscope"));
        format!("<Calibration {name}: accelerometer {accelerometer}, gyroscope {gyroscope}, {} rests>", rests.len())
    }
}

impl Calibration {
    /// Reason why readings of a sensor cannot be corrected.
    fn uncorrected(&self, sensor: &str, alone: bool) -> PyErr {
        let triad = self.document.get(sensor);
        let note = triad.and_then(|triad| triad.get("notes")?.get(0)?.as_str());
        let why = match sensor {
            "gyroscope" if alone => "acceleration acts on it: give the readings of the accelerometer, too",
            "accelerometer" => self.findings.reason().or(note).unwrap_or("its model needs more than its readings"),
            _ => note.unwrap_or("it was not determined"),
        };
        PyValueError::new_err(format!("the {sensor} cannot be corrected: {}", printable(why)))
    }
}

fn first(list: Value) -> Value {
    match list {
        Value::Array(list) => list.into_iter().next().unwrap_or_default(),
        _ => Value::Null,
    }
}
