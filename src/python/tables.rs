//! Rests and turns as structured arrays of numpy.

use pyo3::prelude::*;
use pyo3::types::PyList;
use stillpoint::messages::{Segment, TriadMean, Vector3};
use stillpoint::report::{Findings, nanos};

use crate::arrays::numpy;

/// The rests, in time order.
pub fn rests<'py>(py: Python<'py>, findings: &Findings) -> PyResult<Bound<'py, PyAny>> {
    let rests = || findings.rests.values();
    let mean = |rest: &Segment, sensor| axes(mean_of(rest, sensor).and_then(|mean| mean.mean.as_ref()));
    let std = |rest: &Segment, sensor| axes(mean_of(rest, sensor).and_then(|mean| mean.std.as_ref()));
    let mut table = Table::new(py, findings.rests.len());
    table.column("start", "i8", rests().map(|rest| nanos(&rest.start)))?;
    table.column("end", "i8", rests().map(|rest| nanos(&rest.end)))?;
    table.column("accepted", "?", rests().map(|rest| rest.accepted))?;
    table.column("face", "O", rests().map(|rest| &rest.face))?;
    table.column("tilt_deg", "f8", rests().map(|rest| number(rest.tilt_deg)))?;
    table.column("reason", "O", rests().map(|rest| rest.reason().as_str_name()))?;
    table.column("explanation", "O", rests().map(|rest| &rest.explanation))?;
    table.column("placement", "u4", rests().map(|rest| rest.placement))?;
    table.column("temperature", "f8", rests().map(|rest| number(rest.temperature)))?;
    table.column("accel", "3f8", rests().map(|rest| mean(rest, "accelerometer")))?;
    table.column("accel_std", "3f8", rests().map(|rest| std(rest, "accelerometer")))?;
    table.column("gyro", "3f8", rests().map(|rest| mean(rest, "gyroscope")))?;
    table.column("gyro_std", "3f8", rests().map(|rest| std(rest, "gyroscope")))?;
    table.finish()
}

/// The turns between the rests, in time order.
pub fn turns<'py>(py: Python<'py>, findings: &Findings) -> PyResult<Bound<'py, PyAny>> {
    let turns = || findings.turns.values();
    let mut table = Table::new(py, findings.turns.len());
    table.column("start", "i8", turns().map(|turn| nanos(&turn.start)))?;
    table.column("end", "i8", turns().map(|turn| nanos(&turn.end)))?;
    table.column("used", "?", turns().map(|turn| turn.used))?;
    table.column("reason", "O", turns().map(|turn| turn.reason().as_str_name()))?;
    table.column("explanation", "O", turns().map(|turn| &turn.explanation))?;
    table.column("angle", "f8", turns().map(|turn| turn.angle))?;
    table.column("path", "f8", turns().map(|turn| turn.path))?;
    table.column("axis", "3f8", turns().map(|turn| axes(turn.axis.as_ref())))?;
    table.column("vertical", "f8", turns().map(|turn| number(turn.vertical)))?;
    table.column("residual", "f8", turns().map(|turn| number(turn.residual)))?;
    table.column("before", "u4", turns().map(|turn| turn.before))?;
    table.column("after", "u4", turns().map(|turn| turn.after))?;
    table.finish()
}

/// A structured array, column by column.
struct Table<'py> {
    py: Python<'py>,
    length: usize,
    columns: Vec<(&'static str, &'static str, Bound<'py, PyList>)>,
}

impl<'py> Table<'py> {
    fn new(py: Python<'py>, length: usize) -> Self {
        Self { py, length, columns: Vec::new() }
    }

    /// Adds a column of values in a format of numpy's.
    fn column<T: IntoPyObject<'py>>(
        &mut self,
        name: &'static str,
        format: &'static str,
        values: impl Iterator<Item = T>,
    ) -> PyResult<()> {
        let values = PyList::new(self.py, values.collect::<Vec<_>>())?;
        self.columns.push((name, format, values));
        Ok(())
    }

    fn finish(self) -> PyResult<Bound<'py, PyAny>> {
        let formats: Vec<_> = self.columns.iter().map(|&(name, format, _)| (name, format)).collect();
        let array = numpy(self.py)?.call_method1("empty", (self.length, formats))?;
        for (name, _, values) in self.columns.iter().filter(|_| self.length > 0) {
            array.set_item(*name, values)?;
        }
        Ok(array)
    }
}

fn mean_of<'a>(rest: &'a Segment, sensor: &str) -> Option<&'a TriadMean> {
    rest.means.iter().find(|mean| mean.sensor == sensor)
}

fn axes(vector: Option<&Vector3>) -> [f64; 3] {
    vector.map_or([f64::NAN; 3], |v| [v.x, v.y, v.z])
}

fn number(value: Option<f64>) -> f64 {
    value.unwrap_or(f64::NAN)
}
