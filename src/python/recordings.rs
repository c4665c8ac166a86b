//! Recordings on disk: annotated, read, merged.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use stillpoint::messages::foxglove::log::Level;
use stillpoint::run::{self, Access, Form, Input, Options, Reads, Report, SensorKey, Written};
use stillpoint::{Error, printable};

use crate::calibration::Calibration;
use crate::engine::log;
use crate::errors::{exception, work};
use crate::settings::configuration;

/// Result of `annotate`.
#[pyclass(frozen, module = "stillpoint")]
pub struct Annotated {
    output: PathBuf,
    report: Report,
    written: Written,
}

#[pymethods]
impl Annotated {
    /// Path : The annotated recording, or the sidecar.
    #[getter]
    fn output(&self) -> &Path {
        &self.output
    }

    /// bool : Whether it was written now; False if it was the result of this input and configuration before.
    #[getter]
    fn is_new(&self) -> bool {
        self.written == Written::Now
    }

    /// list of Calibration : What was learned, one for each IMU.
    #[getter]
    fn calibrations(&self) -> Vec<Calibration> {
        self.report.imus.iter().cloned().map(Calibration::of).collect()
    }

    /// int : Number of messages in the recording.
    #[getter]
    fn messages(&self) -> u64 {
        self.report.messages
    }

    /// int : Number of damaged places in the recording; what is whole was used.
    #[getter]
    fn damages(&self) -> u64 {
        self.report.damages
    }

    /// list of str : What is missing or was refused.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.report.notes.iter().chain(&self.report.missing).map(|note| printable(note).into_owned()).collect()
    }

    fn __repr__(&self) -> String {
        let (output, imus) = (self.output.display(), self.report.imus.len());
        format!("<Annotated {}: {imus} IMUs, {} messages>", printable(&output.to_string()), self.report.messages)
    }
}

/// Find the rests of a recording, learn the calibration, and write both into a copy of it.
///
/// Parameters
/// ----------
/// path : path
///     The recording, a file or a rosbag2 folder.
/// output : path, optional
///     Where to write. Without it, beside the recording, with ``.annotated.mcap`` or, for a sidecar,
///     ``.stillpoint.mcap``.
/// in_place : bool
///     Write the annotations into the recording itself.
/// sidecar : bool
///     Write the annotations alone.
/// force : bool
///     Replace an output that exists.
/// allow_no_imu : bool
///     Also write a result when no topic is an IMU.
/// verify : bool
///     Also read, and check, the chunks in which no IMU has messages.
/// sync : bool
///     Wait until the output is on the device.
/// config : path, optional
///     Configuration file (TOML).
/// settings : dict, optional
///     Settings over the file, for example ``{"output.corrected": "final"}``.
///
/// Returns
/// -------
/// Annotated
///
/// Raises
/// ------
/// RecordingError
///     If it is no recording, or has no usable IMU topic. Nothing is left behind.
/// OSError
///     If the system refuses; FileExistsError if the output is something else.
/// ValueError
///     If the configuration is wrong.
#[pyfunction]
#[pyo3(signature = (
    path, output=None, *, in_place=false, sidecar=false, force=false, allow_no_imu=false, verify=false, sync=false,
    config=None, settings=None
))]
#[allow(clippy::too_many_arguments)]
pub fn annotate(
    py: Python<'_>,
    path: PathBuf,
    output: Option<PathBuf>,
    in_place: bool,
    sidecar: bool,
    force: bool,
    allow_no_imu: bool,
    verify: bool,
    sync: bool,
    config: Option<PathBuf>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Annotated> {
    let (access, form) = match (in_place, sidecar) {
        (false, false) => (Access::Read, Form::Annotated),
        (false, true) => (Access::Read, Form::Sidecar),
        (true, false) if output.is_none() => (Access::Change, Form::InPlace),
        (true, _) => {
            let text = "in_place writes into the recording itself, and goes with neither output nor sidecar";
            return Err(exception(&Error::Usage(text.to_owned())));
        }
    };
    let settings = configuration(config.as_ref(), settings)?;
    let output = match in_place {
        true => path.clone(),
        false => output.unwrap_or_else(|| run::default_output(&path, path.is_dir(), None, sidecar)),
    };
    let outputs = [output];
    let (report, written) = work(py, |watch| {
        let input = Input::open_original(&path, access)?;
        let reads = [input.reads(), Reads::of(&config)];
        if force || sidecar {
            let refused = outputs.iter().try_for_each(|output| reads.iter().try_for_each(|reads| reads.refuse(output)));
            refused.map_err(Error::of_annotating)?;
        }
        let options = Options { form, force, allow_no_imu, verify, sync };
        run::annotate(&input, &outputs, &settings, options, watch).map_err(|error| match error {
            Error::Exists(path) if input.reads().contains(&path) => Error::ItselfAnnotated(path),
            error => error.of_annotating(),
        })
    })?;
    let damage = report.damage.iter().map(|damage| format!("damaged {damage}"));
    for note in report.notes.iter().cloned().chain(damage).chain(report.missing.iter().cloned()) {
        log(py, Level::Warning, &printable(&note))?;
    }
    let [output] = outputs;
    Ok(Annotated { output, report, written })
}

/// Read what was learned from a recording.
///
/// Parameters
/// ----------
/// path : path
///     An annotated recording or sidecar, whose annotations are read; or a raw recording, which is calibrated first,
///     without writing anything.
/// config : path, optional
///     Configuration file (TOML), for a raw recording.
/// settings : dict, optional
///     Settings over the file.
///
/// Returns
/// -------
/// list of Calibration
///     One for each IMU.
///
/// Raises
/// ------
/// RecordingError
///     If it is no recording, or has neither annotations nor a usable IMU topic.
/// OSError
///     If the system refuses.
/// ValueError
///     If the configuration is wrong.
#[pyfunction]
#[pyo3(signature = (path, *, config=None, settings=None))]
pub fn read(
    py: Python<'_>,
    path: PathBuf,
    config: Option<PathBuf>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Calibration>> {
    let config = configuration(config.as_ref(), settings)?;
    let found = work(py, |watch| run::findings(&Input::open(&path)?, &config, watch))?;
    if let Some(damage) = &found.damage {
        log(py, Level::Warning, &printable(&format!("damaged {damage}")))?;
    }
    Ok(found.imus.into_iter().map(Calibration::of).collect())
}

/// One calibration per sensor out of many recordings, though no single one determines it.
///
/// The order and the repetition of the recordings change nothing.
///
/// Parameters
/// ----------
/// paths : iterable of path
///     Annotated recordings and sidecars, whose rests are read; or raw recordings, which are looked through first.
/// by : str
///     What tells sensors apart: topic, name, frame-id, folder, serial, or metadata:KEY; several, separated by commas,
///     together.
/// config : path, optional
///     Configuration file (TOML).
/// settings : dict, optional
///     Settings over the file.
///
/// Returns
/// -------
/// list of Calibration
///     One for each sensor, with its `key` and its `history`. Their rests are in the recordings.
///
/// Raises
/// ------
/// RecordingError
///     If one of them is no recording, or has neither annotations nor a usable IMU topic.
/// OSError
///     If the system refuses.
/// ValueError
///     If `by` or the configuration is wrong.
#[pyfunction]
#[pyo3(signature = (paths, *, by="topic", config=None, settings=None))]
pub fn merge(
    py: Python<'_>,
    paths: &Bound<'_, PyAny>,
    by: &str,
    config: Option<PathBuf>,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Calibration>> {
    let paths = paths.try_iter()?.map(|path| path?.extract()).collect::<PyResult<Vec<PathBuf>>>()?;
    let config = configuration(config.as_ref(), settings)?;
    let by = SensorKey::parse(by).map_err(|error| exception(&error))?;
    let merged = work(py, |watch| {
        let mut all = stillpoint::merge::Merge::default();
        for path in &paths {
            all.join(run::gather(&Input::open(path)?, &config, &by, watch)?.evidence);
        }
        Ok(stillpoint::merge::outcome(&all, &config))
    })?;
    Ok(merged.iter().map(Calibration::merged).collect())
}
