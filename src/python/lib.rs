//! The module `stillpoint` for Python: arrays and recordings in, calibrations out.
//!
//! Its documentation is written for `help()`, in numpy style; `stillpoint.pyi` has the types.

mod arrays;
mod calibration;
mod engine;
mod errors;
mod recordings;
mod settings;
mod stream;
mod tables;
mod triad;

/// Learns the calibration of an IMU from the moments when it rests.
///
/// Everywhere, ``measured = bias + S @ true``: the sensitivity ``S`` maps true to measured values. Accelerometers are in
/// m/s², gyroscopes in rad/s, times are int64 nanoseconds. Every function gives the numbers of the command
/// ``stillpoint``, to the last bit, and lets other threads run while it works.
#[pyo3::pymodule(name = "stillpoint")]
mod module {
    use std::ffi::OsString;

    use pyo3::prelude::*;

    #[pymodule_export]
    use super::calibration::Calibration;
    #[pymodule_export]
    use super::engine::{Engine, calibrate};
    #[pymodule_export]
    use super::errors::RecordingError;
    #[pymodule_export]
    use super::recordings::{Annotated, annotate, merge, read};
    #[pymodule_export]
    use super::triad::Triad;

    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    /// The command ``stillpoint`` with the arguments of this process; returns its exit code.
    #[pyfunction]
    fn _command(py: Python<'_>) -> PyResult<u8> {
        let args: Vec<OsString> = py.import("sys")?.getattr("argv")?.extract()?;
        Ok(py.detach(|| stillpoint::program::run(args)))
    }
}
