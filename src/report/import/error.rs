//! Refusals of a calibration file.

/// Reason why a text is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It has none of the formats.
    #[error(
        "is no calibration that Stillpoint knows: JSON or YAML of stillpoint export, Kalibr, imu_calib, PX4 or ArduPilot"
    )]
    Unknown,
    /// It has one of the formats, but is invalid.
    #[error("{format}: {what}")]
    Wrong {
        /// The format.
        format: &'static str,
        /// The fault.
        what: String,
    },
    /// The axes of the recording are unspecified.
    #[error(
        "{0} counts along forward, right, down: say which way the axes of the recording point, --axes frd or flu (ROS)"
    )]
    Axes(&'static str),
}

pub(super) fn wrong(format: &'static str, what: impl Into<String>) -> ImportError {
    ImportError::Wrong { format, what: what.into() }
}
