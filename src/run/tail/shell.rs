//! Constant parts of following a recording: options, files and limits.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::checkpoint::{Checkpoint, Owner};
use super::index_log::IndexLog;
use crate::Error;
use crate::config::Config;
use crate::pipeline::events::{Ending, Notice, Notify};
use crate::run::batch::{Options, Report};
use crate::run::output::sidecar_file::SidecarFile;
use crate::run::output::written::Written;
use crate::run::stop::Stop;

/// Wait between two attempts after a passing error.
const RETRY: Duration = Duration::from_millis(500);

/// Longest sleep without checking for a stop request.
const NAP: Duration = Duration::from_millis(50);

/// Options of following.
#[derive(Clone, Debug)]
pub struct Following {
    /// Interval between two looks at the recording.
    pub poll: Duration,
    /// Time without growth after which the recorder counts as gone.
    pub idle: Duration,
    /// Longest wait for the recording to begin; unlimited if `None`.
    pub patience: Option<Duration>,
    /// Whether the sidecar stays beside the annotated recording.
    pub keep_sidecar: bool,
    /// Options of the annotated recording.
    pub options: Options,
}

/// Outcome of a followed recording.
#[derive(Debug)]
pub struct Tailed {
    /// Findings of the recording.
    pub report: Report,
    /// Length of the recording in bytes.
    pub length: u64,
    /// Path of the annotated recording, or of the sidecar if the recording's bytes are lost.
    pub output: PathBuf,
    /// Whether the output existed before.
    pub written: Written,
    /// Reason why nothing more was recorded.
    pub ending: Ending,
}

/// Constant parts of following a recording, and the files that belong to it.
pub(super) struct Shell<'a> {
    pub(super) output: PathBuf,
    pub(super) config: &'a Config,
    pub(super) following: &'a Following,
    pub(super) stop: &'a Stop,
    pub(super) owner: Owner,
    pub(super) sidecar_file: SidecarFile,
    pub(super) checkpoint: Checkpoint,
    pub(super) indexes: IndexLog,
}

impl Shell<'_> {
    /// Retries an action that passing trouble may hinder (a full disk, an unreachable server), for as long as it would
    /// wait for an idle recorder.
    pub(super) fn patiently<T>(
        &mut self,
        notify: Notify<'_>,
        mut act: impl FnMut(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let began = Instant::now();
        let mut told = false;
        loop {
            match act(self) {
                Err(error) if error.is_passing() && began.elapsed() < self.following.idle => {
                    if !std::mem::replace(&mut told, true) {
                        let what = if error.is_full() { "waiting for room" } else { "trying again" };
                        notify(Notice::Trouble(&format!("{error}; {what}")));
                    }
                    self.pause(RETRY)?;
                }
                done => return done,
            }
        }
    }

    pub(super) fn pause(&self, time: Duration) -> Result<(), Error> {
        let until = Instant::now() + time;
        loop {
            self.stop.check()?;
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            std::thread::sleep(left.min(NAP));
        }
    }

    pub(super) fn tidy(&mut self) -> Result<(), Error> {
        self.remove_sidecar()?;
        self.forget()
    }

    /// Removes the checkpoint and the index log.
    pub(super) fn forget(&mut self) -> Result<(), Error> {
        self.checkpoint.remove()?;
        self.indexes.remove()
    }

    pub(super) fn remove_sidecar(&mut self) -> Result<(), Error> {
        self.sidecar_file.remove()
    }
}
