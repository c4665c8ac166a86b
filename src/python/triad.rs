//! The calibration of one triad.

use pyo3::prelude::*;
use serde_json::Value;

use crate::arrays::{json, of_json};

/// Calibration of one accelerometer or gyroscope: ``measured = bias + sensitivity @ true``.
///
/// What was not estimated is None.
#[pyclass(frozen, module = "stillpoint")]
pub struct Triad {
    document: Value,
}

impl Triad {
    /// Triad of its JSON.
    pub fn of(document: &Value) -> Self {
        Self { document: document.clone() }
    }

    fn text(&self, key: &str) -> Option<&str> {
        self.document.get(key)?.as_str()
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.document.get(key)?.as_f64()
    }

    fn array<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let value = self.document.get(key).filter(|value| !value.is_null());
        value.map(|value| of_json(py, value)).transpose()
    }
}

#[pymethods]
impl Triad {
    /// str : "accelerometer", "gyroscope", or the name of a secondary accelerometer.
    #[getter]
    fn sensor(&self) -> Option<&str> {
        self.text("sensor")
    }

    /// str : Topic of its readings.
    #[getter]
    fn topic(&self) -> Option<&str> {
        self.text("topic")
    }

    /// str : "bias", "bias-scale", "triangular", "cross-axis", "full" or "turns".
    #[getter]
    fn model(&self) -> Option<&str> {
        self.text("model")
    }

    /// str : "UNDETERMINED", "PROVISIONAL" while nothing could contradict it, or "CONFIRMED".
    #[getter]
    fn status(&self) -> Option<&str> {
        self.text("status")
    }

    /// ndarray, shape (3,) : Reading at a true value of zero, m/s² or rad/s.
    #[getter]
    fn bias<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array(py, "bias")
    }

    /// ndarray, shape (3,) : Standard deviation of the bias; 1.96 times it is half of a 95 % interval.
    #[getter]
    fn bias_std<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array(py, "bias_std")
    }

    /// ndarray, shape (3, 3) : Matrix S that maps true to measured, dimensionless; None stands for the identity.
    #[getter]
    fn sensitivity<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array(py, "sensitivity")
    }

    /// ndarray, shape (3, 3) : Standard deviation of the sensitivity; NaN where the model holds an entry fixed.
    #[getter]
    fn sensitivity_std<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array(py, "sensitivity_std")
    }

    /// ndarray, shape (3, 3) : What acceleration adds to a gyroscope's reading, rad/s per m/s².
    #[getter]
    fn g_sensitivity<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.array(py, "g_sensitivity")
    }

    /// float : Root mean square of what remains at the rests, m/s² or rad/s.
    #[getter]
    fn residual_rms(&self) -> Option<f64> {
        self.number("residual_rms")
    }

    /// float : What the error of a corrected reading at rest keeps to in every direction, with 95 %, m/s².
    #[getter]
    fn worst_case_error(&self) -> Option<f64> {
        self.number("worst_case_error")
    }

    /// list of str : Warnings, and reasons why a richer model was refused.
    #[getter]
    fn notes(&self) -> Vec<&str> {
        let notes = self.document.get("notes").and_then(Value::as_array);
        notes.into_iter().flatten().filter_map(Value::as_str).collect()
    }

    /// Everything of it, as ``stillpoint export --format json`` writes it.
    ///
    /// Returns
    /// -------
    /// dict
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &self.document)
    }

    fn __repr__(&self) -> String {
        let [sensor, status, model] = ["sensor", "status", "model"].map(|key| self.text(key).unwrap_or("none"));
        format!("<Triad {sensor}: {status} ({model})>")
    }
}
