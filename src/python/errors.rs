//! Errors as exceptions with the texts of the command, and work that Ctrl-C stops.

use std::cell::RefCell;
use std::io;
use std::time::{Duration, Instant};

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use stillpoint::{Error, printable};

pyo3::create_exception!(
    stillpoint,
    RecordingError,
    PyValueError,
    "A file that is no recording, or in which nothing can be calibrated; the text says why, and what to do."
);

/// Interval at which running work asks whether Ctrl-C was pressed.
const EVERY: Duration = Duration::from_millis(100);

/// Does work on recordings while other threads of Python run. The callback that it is given ends it with
/// `KeyboardInterrupt` after Ctrl-C.
pub fn work<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&dyn Fn(u64) -> Result<(), Error>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    py.detach(|| {
        let asked = RefCell::new((Instant::now(), None));
        let watch = |_| {
            let mut asked = asked.borrow_mut();
            if asked.0.elapsed() < EVERY {
                return Ok(());
            }
            asked.0 = Instant::now();
            Python::attach(|py| py.check_signals()).map_err(|interrupt| {
                asked.1 = Some(interrupt);
                Error::Stopped
            })
        };
        work(&watch).map_err(|error| asked.into_inner().1.unwrap_or_else(|| exception(&error)))
    })
}

/// The exception of an error, with the text that the command prints.
pub fn exception(error: &Error) -> PyErr {
    let text = printable(&error.to_string()).into_owned();
    let system = |kind: io::ErrorKind| PyErr::from(io::Error::new(kind, text.clone()));
    match error {
        Error::Io { source, .. } => system(source.kind()),
        Error::Exists(_) | Error::Itself(_) | Error::ItselfAnnotated(_) => system(io::ErrorKind::AlreadyExists),
        Error::Busy(_) => system(io::ErrorKind::WouldBlock),
        Error::Input { .. } | Error::Unfit { .. } => RecordingError::new_err(text),
        Error::Usage(_) | Error::Config(_) => PyValueError::new_err(text),
        _ => PyRuntimeError::new_err(text),
    }
}
