//! How to watch, and how a recording stands that is watched.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::run::tail::Following;

/// How to watch.
#[derive(Clone, Debug)]
pub struct Watching {
    /// Where recordings appear; in its folders, too.
    pub folder: PathBuf,
    /// Where results go, under the same names and folders; beside the recordings if `None`.
    pub out: Option<PathBuf>,
    /// Between two looks through the directory.
    pub interval: Duration,
    /// Growing recordings that are followed at a time.
    pub growing: usize,
    /// Finished ones that are worked on at a time.
    pub finished: usize,
    /// How to follow each.
    pub following: Following,
    /// How long work on a finished one may take; by its length if `None`.
    pub time_limit: Option<Duration>,
}

/// How a recording stands.
#[derive(Debug, PartialEq)]
pub(super) enum WatchState {
    Waiting,
    /// Followed; whether as a finished one.
    Running(bool),
    Again(Instant),
    Annotated,
    Quarantined,
}
