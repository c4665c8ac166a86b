//! Outcome of a command, and the exit code that says it.

use stillpoint::Error;

/// Outcome of a command, from the mildest to the gravest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Code {
    #[default]
    Done,
    Damaged,
    Uncalibrated,
    Passing,
    /// Of a list: no retry helps.
    Hopeless,
    Refused,
    Usage,
}

impl Code {
    /// The code of an error, which is logged here and nowhere else.
    pub fn of(error: &Error) -> Self {
        match error {
            // Requested, and no fault.
            Error::Stopped | Error::Paused => tracing::info!("{error}"),
            error => tracing::error!("{error}"),
        }
        match error {
            Error::Usage(_) | Error::Config(_) => Self::Usage,
            error if error.is_passing() => Self::Passing,
            _ => Self::Refused,
        }
    }

    /// Exit code of the program.
    pub fn number(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Refused => 1,
            Self::Usage => 2,
            Self::Damaged => 3,
            Self::Uncalibrated => 4,
            Self::Passing => 5,
            Self::Hopeless => 6,
        }
    }
}

/// The code of a command whose input has this number of damaged places.
pub fn damaged(damages: u64, accepted: bool) -> Code {
    if damages > 0 && !accepted { Code::Damaged } else { Code::Done }
}
