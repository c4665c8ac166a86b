//! Reasons why an export fails.

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
