//! Numbers of numpy's arrays as bytes, and back. A copy of a block costs far less than what is done with it, and
//! nobody can change it meanwhile.

use nalgebra::Vector3;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PySlice};
use serde_json::Value;
use stillpoint::Stamp;

/// Array of times, shape (n,).
pub struct Times<'py> {
    array: Bound<'py, PyAny>,
    pub length: usize,
    /// Whether it counts in seconds.
    seconds: bool,
}

/// Array of readings, shape (n, 3).
pub struct Readings<'py> {
    name: &'static str,
    array: Bound<'py, PyAny>,
}

impl<'py> Times<'py> {
    /// Takes int64 nanoseconds, float64 seconds, or datetime64.
    pub fn new(t: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = as_array(t)?;
        let (kind, shape) = (kind(&array)?, shape(&array)?);
        let [length] = shape[..] else { return Err(wrong_shape("t", "(n,)", &array)) };
        if !matches!(kind, 'i' | 'u' | 'f' | 'M') {
            let text = "t: expected int64 nanoseconds, float64 seconds, or datetime64";
            return Err(PyTypeError::new_err(format!("{text}, has dtype {}", array.getattr("dtype")?)));
        }
        // Days and minutes are counted in nanoseconds, too.
        let array = if kind == 'M' { array.call_method1("astype", ("datetime64[ns]",))? } else { array };
        Ok(Self { array, length, seconds: kind == 'f' })
    }

    /// Times of the rows from `begin` to `end`.
    pub fn block(&self, begin: usize, end: usize) -> PyResult<Vec<Stamp>> {
        let number = if self.seconds { "<f8" } else { "<i8" };
        let bytes = bytes(&self.array, begin, end, number)?;
        let (stamps, _) = bytes.as_bytes().as_chunks::<8>();
        if !self.seconds {
            return Ok(stamps.iter().map(|bytes| Stamp::from_nanos(i64::from_le_bytes(*bytes))).collect());
        }
        let stamp = |(i, bytes): (usize, &[u8; 8])| {
            let nanos = f64::from_le_bytes(*bytes) * 1e9;
            let not_finite = || PyValueError::new_err(format!("t: the time of row {} is not finite", begin + i));
            nanos.is_finite().then(|| Stamp::from_nanos(nanos.round() as i64)).ok_or_else(not_finite)
        };
        stamps.iter().enumerate().map(stamp).collect()
    }
}

impl<'py> Readings<'py> {
    /// Takes an array of `length` rows.
    pub fn new(name: &'static str, readings: &Bound<'py, PyAny>, length: usize) -> PyResult<Self> {
        let array = as_array(readings)?;
        match shape(&array)?[..] {
            [rows, 3] if rows == length => Ok(Self { name, array }),
            _ => Err(wrong_shape(name, &format!("({length}, 3)"), &array)),
        }
    }

    /// Readings of the rows from `begin` to `end`.
    pub fn block(&self, begin: usize, end: usize) -> PyResult<Vec<Vector3<f64>>> {
        is_real(self.name, &self.array)?;
        Ok(vectors(&bytes(&self.array, begin, end, "<f8")?))
    }
}

/// Readings of an array, shape (3,) or (…, 3), and its shape.
pub fn rows(name: &str, readings: &Bound<'_, PyAny>) -> PyResult<(Vec<Vector3<f64>>, Vec<usize>)> {
    let array = as_array(readings)?;
    let shape = shape(&array)?;
    if shape.last() != Some(&3) {
        return Err(wrong_shape(name, "(…, 3)", &array));
    }
    is_real(name, &array)?;
    let rows = array.call_method1("reshape", ((-1, 3),))?;
    Ok((vectors(&bytes(&rows, 0, rows.len()?, "<f8")?), shape))
}

/// Array of this shape.
pub fn array<'py>(py: Python<'py>, rows: &[Vector3<f64>], shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = py.detach(|| rows.iter().flat_map(|row| row.iter()).flat_map(|x| x.to_le_bytes()).collect());
    let numbers = numpy(py)?.call_method1("frombuffer", (PyByteArray::new(py, &bytes), "<f8"))?;
    numbers.call_method1("reshape", (shape.to_vec(),))
}

/// Array of numbers of JSON, nested as they are; `null` becomes NaN.
pub fn of_json<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    numpy(py)?.call_method1("array", (json(py, value)?, "f8"))
}

/// JSON as lists, dicts and numbers.
pub fn json<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}

pub fn numpy(py: Python<'_>) -> PyResult<Bound<'_, PyModule>> {
    py.import(intern!(py, "numpy"))
}

fn as_array<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    numpy(value.py())?.call_method1("asarray", (value,))
}

/// numpy's letter for the kind of number.
fn kind(array: &Bound<'_, PyAny>) -> PyResult<char> {
    array.getattr("dtype")?.getattr("kind")?.extract()
}

fn shape(array: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    array.getattr("shape")?.extract()
}

fn is_real(name: &str, array: &Bound<'_, PyAny>) -> PyResult<()> {
    match kind(array)? {
        'i' | 'u' | 'f' => Ok(()),
        _ => {
            let dtype = array.getattr("dtype")?;
            Err(PyTypeError::new_err(format!("{name}: expected real numbers, has dtype {dtype}")))
        }
    }
}

fn wrong_shape(name: &str, expected: &str, array: &Bound<'_, PyAny>) -> PyErr {
    let found = array.getattr("shape").map(|shape| shape.to_string());
    found.map_or_else(
        |error| error,
        |found| PyValueError::new_err(format!("{name}: expected an array of shape {expected}, has {found}")),
    )
}

/// The numbers of some rows, in the format that numpy calls so.
fn bytes<'py>(array: &Bound<'py, PyAny>, begin: usize, end: usize, number: &str) -> PyResult<Bound<'py, PyBytes>> {
    let py = array.py();
    let rows = array.get_item(PySlice::new(py, begin as isize, end as isize, 1))?;
    let rows = numpy(py)?.call_method1(intern!(py, "ascontiguousarray"), (rows, number))?;
    Ok(rows.call_method0(intern!(py, "tobytes"))?.cast_into()?)
}

fn vectors(bytes: &Bound<'_, PyBytes>) -> Vec<Vector3<f64>> {
    let (rows, _) = bytes.as_bytes().as_chunks::<8>().0.as_chunks::<3>();
    rows.iter().map(|row| row.map(f64::from_le_bytes).into()).collect()
}
