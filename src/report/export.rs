//! Calibrations in the formats of other programs. Each converts direction, axes and units, states so in its header with
//! the source of its convention, and refuses what it cannot represent.

pub(super) mod autopilot;
mod imu_calib;
mod kalibr;
mod stillpoint;
pub(super) mod thermal;

use std::str::FromStr;

use super::{Findings, Parameters, calibration, model};
use crate::fit::Calibration;
use crate::messages::{self, Triad};
use crate::printable;

/// A format: name, help text and writer. Each has a file of its own.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Name by which it is chosen.
    pub name: &'static str,
    /// Help text.
    pub help: &'static str,
    /// Random-walk options that apply to it.
    random_walks: RandomWalks,
    write: fn(&[Findings], &Options) -> Result<Exported, ExportError>,
}

impl Format {
    /// Every format.
    pub const ALL: &[Self] = &[
        stillpoint::JSON,
        stillpoint::YAML,
        kalibr::RESULTS,
        kalibr::INPUT,
        imu_calib::YAML,
        autopilot::PX4,
        autopilot::ARDUPILOT,
    ];

    /// The format of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|format| format.name == name)
    }

    fn takes(self, walk: RandomWalk) -> bool {
        match walk {
            RandomWalk::Bound => self.random_walks != RandomWalks::None,
            RandomWalk::Given(_) => self.random_walks == RandomWalks::Any,
        }
    }
}

/// Random-walk options that apply to a format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RandomWalks {
    /// The format has no random walk, or only one that the rests show.
    None,
    /// The upper bound.
    Bound,
    /// The upper bound, and given numbers.
    Any,
}

/// Options of an export.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the IMU; needed if the format holds one and there are several.
    pub imu: Option<String>,
    /// Accelerometer: the primary one, or a secondary one by its name.
    pub sensor: Option<String>,
    /// State of the calibrated readings, for formats whose reader applies them to raw ones.
    pub readings: Readings,
    /// Axes of the calibrated readings, for formats that prescribe axes.
    pub axes: Option<Axes>,
    /// Slot of the sensor in an autopilot.
    pub slot: u8,
    /// Values to write for random walks that the rests do not show.
    pub random_walk: Option<RandomWalk>,
}

/// Value to write for a random walk of a bias that the rests do not show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RandomWalk {
    /// The upper bound that the rests give.
    Bound,
    /// Given values of accelerometer and gyroscope, m/s³/√Hz and rad/s²/√Hz.
    Given([f64; 2]),
}

impl FromStr for RandomWalk {
    type Err = &'static str;

    /// Parses `bound`, or two positive numbers, `ACCEL,GYRO`.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "bound" {
            return Ok(Self::Bound);
        }
        let number = |text: &str| text.trim().parse().ok().filter(|walk: &f64| *walk > 0.0 && walk.is_finite());
        match text.split(',').map(number).collect::<Option<Vec<_>>>().as_deref() {
            Some(&[accel, gyro]) => Ok(Self::Given([accel, gyro])),
            _ => Err("expected two positive numbers, ACCEL,GYRO, or the word bound"),
        }
    }
}

/// State of readings before calibration: raw or corrected.
#[derive(Clone, Debug, Default)]
pub enum Readings {
    /// Unspecified.
    #[default]
    Unsaid,
    /// Raw readings of the sensor.
    Raw,
    /// Already corrected with these parameters.
    Corrected(Parameters),
}

/// Directions of a sensor's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Forward, left, up: ROS
    Flu,
    /// Forward, right, down: autopilots
    Frd,
}

impl Axes {
    /// Both, each with its name and help text.
    pub const ALL: &[(Self, &str, &str)] =
        &[(Self::Flu, "flu", "Forward, left, up: ROS"), (Self::Frd, "frd", "Forward, right, down: autopilots")];

    /// Signs that convert the axes of one into those of the other, in both directions.
    pub(super) fn signs_to(self, other: Self) -> [f64; 3] {
        if self == other { [1.0; 3] } else { [1.0, -1.0, -1.0] }
    }
}

/// A written calibration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The file.
    pub text: String,
    /// Warnings for the user, one line each.
    pub warnings: Vec<String>,
}

impl Exported {
    /// A file without warnings.
    fn plain(text: String) -> Self {
        Self { text, warnings: Vec::new() }
    }
}

/// Reason why an export fails.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// One IMU must be chosen.
    #[error("the format holds one IMU; choose with --imu: {0}")]
    Several(String),
    /// The IMU or accelerometer does not exist.
    #[error("no {what} {name}; there are: {known}")]
    Unknown {
        /// IMU or accelerometer.
        what: &'static str,
        /// The requested name.
        name: String,
        /// The existing names.
        known: String,
    },
    /// The triad is not determined.
    #[error("{what} is not determined: {why}")]
    Undetermined {
        /// The triad.
        what: String,
        /// The reason, and the next step.
        why: String,
    },
    /// The format cannot hold part of the calibration.
    #[error("{format} cannot hold {what}; {next}")]
    Holds {
        /// The format.
        format: &'static str,
        /// The part that does not fit.
        what: String,
        /// The next step.
        next: &'static str,
    },
    /// An option is missing, or of no use here.
    #[error("{0}")]
    Option(String),
    /// The result would be wrong.
    #[error("{0}")]
    Refused(String),
}

impl ExportError {
    /// Whether the command line is at fault, whatever the calibration.
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Several(_) | Self::Option(_))
    }
}

/// Advice for a model that the format cannot hold.
const LEANER: &str =
    "calibrate the recording with --set fit.model=bias-scale, or use --format json, kalibr or imu-calib";

/// Writes findings in a format.
///
/// # Errors
///
/// If the format cannot hold them, or an option is missing without which the result could be wrong.
pub fn export(findings: &[Findings], format: Format, options: &Options) -> Result<Exported, ExportError> {
    if let Some(walk) = options.random_walk.filter(|&walk| !format.takes(walk)) {
        let formats: Vec<_> = Format::ALL.iter().filter(|other| other.takes(walk)).map(|other| other.name).collect();
        let formats = formats.join(" and ");
        return Err(ExportError::Option(format!("this --random-walk is of use to --format {formats} alone")));
    }
    match options.imu {
        Some(_) => (format.write)(std::slice::from_ref(one(findings, options)?), options),
        None => (format.write)(findings, options),
    }
}

/// The chosen IMU.
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

/// The chosen accelerometer and its calibration.
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

/// What the change of a bias with temperature is called.
const BY_TEMPERATURE: &str = "change of bias with temperature";

/// Next step where a format cannot hold what a triad has beyond bias and S.
fn instead(what: &str) -> &'static str {
    match what {
        BY_TEMPERATURE => {
            "calibrate the recording with --set fit.temperature=off for one bias of all temperatures, or use --format json, \
             yaml, px4 or ardupilot"
        }
        _ => "use --format json or yaml",
    }
}

/// Names of what a triad has beyond bias and S: formats that cannot hold it refuse it.
fn beyond(triad: &Triad) -> impl Iterator<Item = &'static str> {
    let said = |values: &[f64]| values.iter().any(|&value| value != 0.0);
    let named = [
        ("g-sensitivity", said(&triad.g_sensitivity)),
        ("g²-sensitivity", said(&triad.g2_sensitivity)),
        ("sensitivity to rotation", said(&triad.rate_sensitivity)),
        (BY_TEMPERATURE, triad.temperature.as_ref().is_some_and(|model| said(&model.coefficients))),
    ];
    named.into_iter().filter_map(|(name, is_said)| is_said.then_some(name))
}

/// First comment lines of every foreign format.
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

/// Text as comment lines; a name from a recording cannot end a comment early.
fn comments(lines: &[String]) -> String {
    let line = |line: &String| format!("# {}\n", printable(line));
    lines.iter().map(line).collect()
}
