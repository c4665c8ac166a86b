//! Calibrations in the formats of other programs. Each converts direction, axes and units, says so in its header with
//! the source of its convention, and refuses what it cannot hold.

pub(super) mod autopilot;
mod imu_calib;
mod kalibr;

use serde_json::json;

use super::{Findings, Parameters, calibration, imus, model, yaml};
use crate::fit::Calibration;
use crate::messages::{self, Triad};
use crate::printable;

/// A format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Everything, for programs
    Json,
    /// The same as YAML
    Yaml,
    /// Intrinsics in the layout of Kalibr's results
    Kalibr,
    /// Kalibr's imu.yaml: noise densities and rate
    KalibrInput,
    /// SM and bias of dpkoch/imu_calib
    ImuCalib,
    /// CAL_ACC*, CAL_GYRO* for QGroundControl
    Px4,
    /// INS_ACC*, INS_GYR* for ground stations
    Ardupilot,
}

impl Format {
    /// Every format, the name that it is chosen by, and what is said of it.
    pub const ALL: &[(Self, &str, &str)] = &[
        (Self::Json, "json", "Everything, for programs"),
        (Self::Yaml, "yaml", "The same as YAML"),
        (Self::Kalibr, "kalibr", "Intrinsics in the layout of Kalibr's results"),
        (Self::KalibrInput, "kalibr-input", "Kalibr's imu.yaml: noise densities and rate"),
        (Self::ImuCalib, "imu-calib", "SM and bias of dpkoch/imu_calib"),
        (Self::Px4, "px4", "CAL_ACC*, CAL_GYRO* for QGroundControl"),
        (Self::Ardupilot, "ardupilot", "INS_ACC*, INS_GYR* for ground stations"),
    ];
}

/// What an export has to be told.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Which IMU, by its name; needed where a format holds one and there are several.
    pub imu: Option<String>,
    /// Which accelerometer: the primary one, or a secondary by its name.
    pub sensor: Option<String>,
    /// What the calibrated readings were, for formats whose reader applies them to raw ones.
    pub readings: Readings,
    /// Axes of the calibrated readings, for formats that have their own.
    pub axes: Option<Axes>,
    /// Which of an autopilot's sensors.
    pub slot: u8,
    /// What to write for random walks that the rests do not show.
    pub random_walk: Option<RandomWalk>,
}

/// What is written for a random walk of a bias that the rests do not show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RandomWalk {
    /// The upper bound that they give.
    Bound,
    /// These of accelerometer and gyroscope, m/s³/√Hz and rad/s²/√Hz.
    Given([f64; 2]),
}

/// Whether readings were corrected before they were calibrated.
#[derive(Clone, Debug, Default)]
pub enum Readings {
    /// Nobody said.
    #[default]
    Unsaid,
    /// As the sensor gave them.
    Raw,
    /// Already corrected with these parameters.
    Corrected(Parameters),
}

/// Which way the axes of a sensor point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Forward, left, up: ROS
    Flu,
    /// Forward, right, down: autopilots
    Frd,
}

impl Axes {
    /// Both, the name that each is chosen by, and what is said of it.
    pub const ALL: &[(Self, &str, &str)] =
        &[(Self::Flu, "flu", "Forward, left, up: ROS"), (Self::Frd, "frd", "Forward, right, down: autopilots")];

    /// The signs that turn the axes of the one into those of the other, both ways.
    pub(super) fn signs_to(self, other: Self) -> [f64; 3] {
        if self == other { [1.0; 3] } else { [1.0, -1.0, -1.0] }
    }
}

/// A written calibration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// What the reader should know, one line each.
    pub warnings: Vec<String>,
}

/// Why there is no export.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// One is to be chosen.
    #[error("the format holds one IMU; choose with --imu: {0}")]
    Several(String),
    /// It does not exist.
    #[error("no {what} {name}; there are: {known}")]
    Unknown {
        /// IMU or accelerometer.
        what: &'static str,
        /// What was asked for.
        name: String,
        /// What could have been.
        known: String,
    },
    /// There is nothing to export.
    #[error("{what} is not determined: {why}")]
    Undetermined {
        /// Which triad.
        what: String,
        /// The reason, and the next step.
        why: String,
    },
    /// It would be lost.
    #[error("{format} cannot hold {what}; {next}")]
    Holds {
        /// The format.
        format: &'static str,
        /// What does not fit.
        what: String,
        /// What to do instead.
        next: &'static str,
    },
    /// It would be wrong.
    #[error("{0}")]
    Refused(String),
}

/// Where to go with a model that a format has no place for.
const LEANER: &str =
    "calibrate the recording with --set fit.model=bias-scale, or use --format json, kalibr or imu-calib";

/// Writes what was found in a format.
///
/// # Errors
///
/// If the format cannot hold it, or something has to be said before it would be right.
pub fn export(findings: &[Findings], format: Format, options: &Options) -> Result<Exported, ExportError> {
    let no_use = match options.random_walk {
        None => None,
        Some(RandomWalk::Given(_)) => (format != Format::KalibrInput).then_some("kalibr-input alone"),
        Some(RandomWalk::Bound) => {
            (!matches!(format, Format::Kalibr | Format::KalibrInput)).then_some("kalibr and kalibr-input alone")
        }
    };
    if let Some(formats) = no_use {
        return Err(ExportError::Refused(format!("this --random-walk is of use to --format {formats}")));
    }
    let findings = match options.imu {
        Some(_) => std::slice::from_ref(one(findings, options)?),
        None => findings,
    };
    match format {
        Format::Json => Ok(plain(format!("{:#}\n", json!({"imus": imus(findings)})))),
        Format::Yaml => Ok(plain(comments(&own()) + &yaml::document(&json!({"imus": imus(findings)})))),
        Format::Kalibr => kalibr::intrinsics(findings, options.random_walk),
        Format::KalibrInput => kalibr::input(one(findings, options)?, options.random_walk).map(plain),
        Format::ImuCalib => imu_calib::export(one(findings, options)?, options).map(plain),
        Format::Px4 => autopilot::export(&autopilot::PX4, one(findings, options)?, options),
        Format::Ardupilot => autopilot::export(&autopilot::ARDUPILOT, one(findings, options)?, options),
    }
}

fn plain(text: String) -> Exported {
    Exported { text, warnings: Vec::new() }
}

/// The IMU that is meant.
fn one<'a>(findings: &'a [Findings], options: &Options) -> Result<&'a Findings, ExportError> {
    let names = || findings.iter().map(|imu| imu.name.as_str()).collect::<Vec<_>>().join(", ");
    match (&options.imu, findings) {
        (None, [only]) => Ok(only),
        (None, _) => Err(ExportError::Several(names())),
        (Some(name), _) => findings
            .iter()
            .find(|imu| imu.name == *name || imu.topic == *name)
            .ok_or_else(|| ExportError::Unknown { what: "IMU", name: name.clone(), known: names() }),
    }
}

/// The accelerometer that is meant, and its numbers.
fn accelerometer<'a>(imu: &'a Findings, sensor: Option<&str>) -> Result<(&'a Triad, Calibration), ExportError> {
    let found = imu.calibration.as_ref();
    let secondary = found.map_or(&[][..], |found| &found.secondary);
    let primary = found.and_then(|found| found.accelerometer.as_ref());
    let triad = match sensor {
        None | Some("accelerometer") => primary,
        Some(name) => Some(secondary.iter().find(|triad| triad.sensor == name).ok_or_else(|| {
            let known: Vec<_> = ["accelerometer"].into_iter().chain(secondary.iter().map(|t| &*t.sensor)).collect();
            ExportError::Unknown { what: "accelerometer", name: name.to_owned(), known: known.join(", ") }
        })?),
    };
    triad.and_then(|triad| Some((triad, calibration(triad)?))).ok_or_else(|| ExportError::Undetermined {
        what: format!("{} of {}", sensor.unwrap_or("the accelerometer"), imu.name),
        why: match sensor {
            Some(_) => triad.and_then(|triad| triad.notes.first().cloned()).unwrap_or_default(),
            None => imu.reason().unwrap_or_default().to_owned(),
        },
    })
}

/// The gyroscope, if it is determined.
fn gyroscope(imu: &Findings) -> Option<(&Triad, Calibration)> {
    let triad = imu.calibration.as_ref()?.gyroscope.as_ref()?;
    Some((triad, calibration(triad)?))
}

/// The sensitivities beyond bias and S of a triad, each by its name.
fn beyond(triad: &Triad) -> impl Iterator<Item = &'static str> {
    let said = |values: &[f64]| values.iter().any(|&value| value != 0.0);
    let named = [
        ("g-sensitivity", said(&triad.g_sensitivity)),
        ("g²-sensitivity", said(&triad.g2_sensitivity)),
        ("sensitivity to rotation", said(&triad.rate_sensitivity)),
    ];
    named.into_iter().filter_map(|(name, is_said)| is_said.then_some(name))
}

/// Comment lines that every foreign format begins with.
fn heading(imu: &Findings, triads: &[&Triad]) -> Vec<String> {
    let mut lines = vec![format!("Calibration of {} by Stillpoint {}", imu.name, env!("CARGO_PKG_VERSION"))];
    for triad in triads {
        let model = model(triad.model()).unwrap_or("no model");
        lines.push(format!("{}: {}, {model}", triad.sensor, triad.status().as_str_name()));
    }
    if let Some(messages::Calibration { gravity, gravity_source, .. }) = &imu.calibration {
        lines.push(format!("gravity {gravity} m/s² ({gravity_source})"));
    }
    lines
}

/// What stands above our own layout.
fn own() -> [String; 3] {
    [
        format!("Calibrations by Stillpoint {}", env!("CARGO_PKG_VERSION")),
        "measured = bias + sensitivity * true, rows of sensitivity one by one, so true = sensitivity^-1 * (measured - bias)"
            .to_owned(),
        "accelerometers in m/s², gyroscopes in rad/s, axes as in the recording; convention: Stillpoint's own".to_owned(),
    ]
}

/// Text as comments; what a recording names cannot end a comment early.
fn comments(lines: &[String]) -> String {
    let line = |line: &String| format!("# {}\n", printable(line));
    lines.iter().map(line).collect()
}
