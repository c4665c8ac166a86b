//! Options of watching, and the state of a watched recording.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::run::tail::Following;

/// Options of watching.
#[derive(Clone, Debug)]
pub struct Watching {
    /// Folder in which recordings appear, also in its subfolders.
    pub folder: PathBuf,
    /// Folder of the results, under the same names and subfolders; beside the recordings if `None`.
    pub out: Option<PathBuf>,
    /// Interval between two looks through the directory.
    pub interval: Duration,
    /// Most growing recordings that are followed at a time.
    pub growing: usize,
    /// Most finished recordings that are worked on at a time.
    pub finished: usize,
    /// Options of following each recording.
    pub following: Following,
    /// Longest time that work on a finished recording may take; by its length if `None`.
    pub time_limit: Option<Duration>,
}

/// State of a recording.
#[derive(Debug, PartialEq)]
pub(super) enum WatchState {
    Waiting,
    /// Work on it goes on; whether as on a finished recording.
    Running(bool),
    Again(Instant),
    Annotated,
    Quarantined,
}
