//! Calibrations in the formats of other programs. Each converts direction, axes and units, states so in its header with
//! the source of its convention, and refuses what it cannot represent.

pub(super) mod autopilot;
mod comments;
mod error;
mod format;
mod imu_calib;
mod kalibr;
mod options;
mod selection;
mod stillpoint;
pub(super) mod thermal;
mod unsupported;

pub use self::error::ExportError;
pub use self::format::{Exported, Format};
pub use self::options::{Axes, Options, RandomWalk, Readings};
use self::selection::one;
use super::Findings;

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
}

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
