//! What stays the same while a recording is followed: how, into which files, and until when.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::checkpoint::{Checkpoint, Owner};
use super::index_log::IndexLog;
use crate::Error;
use crate::config::Config;
use crate::pipeline::events::{Ending, News, Tell};
use crate::run::batch::{Options, Report};
use crate::run::output::file::Written;
use crate::run::output::sidecar_file::SidecarFile;
use crate::run::stop::Stop;

/// Between two attempts at what is in the way.
const RETRY: Duration = Duration::from_millis(500);

/// Who asks to stop waits no longer than this.
const NAP: Duration = Duration::from_millis(50);

/// How to follow.
#[derive(Clone, Debug)]
pub struct Following {
    /// Between two looks at the recording.
    pub poll: Duration,
    /// A recording that does not grow for so long was given up by its recorder.
    pub idle: Duration,
    /// How long to wait for the recording to begin; for ever if `None`.
    pub patience: Option<Duration>,
    /// Whether the sidecar stays when the annotated recording is there.
    pub keep_sidecar: bool,
    /// How to write the annotated recording.
    pub options: Options,
}

/// What a recording came to.
#[derive(Debug)]
pub struct Tailed {
    /// What was found in it.
    pub report: Report,
    /// Its length in bytes.
    pub length: u64,
    /// Where it is: the annotated recording, or the sidecar of one whose bytes are lost.
    pub output: PathBuf,
    /// Whether that was there before.
    pub written: Written,
    /// Why nothing more was recorded.
    pub ending: Ending,
}

/// What stays the same while a recording is followed, and the files that belong to it.
pub(super) struct Shell<'a> {
    pub(super) output: PathBuf,
    pub(super) config: &'a Config,
    pub(super) following: &'a Following,
    pub(super) stop: &'a Stop,
    pub(super) owner: Owner,
    pub(super) appending: SidecarFile,
    pub(super) checkpoint: Checkpoint,
    pub(super) indexes: IndexLog,
}

impl Shell<'_> {
    /// Does what passing trouble may hinder (a full disk, a server out of reach), again and again for as long as an idle
    /// recorder would be waited for.
    pub(super) fn patiently<T>(
        &mut self,
        tell: Tell<'_>,
        mut act: impl FnMut(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let began = Instant::now();
        let mut told = false;
        loop {
            match act(self) {
                Err(error) if error.is_passing() && began.elapsed() < self.following.idle => {
                    if !std::mem::replace(&mut told, true) {
                        let what = if error.is_full() { "waiting for room" } else { "trying again" };
                        tell(News::Trouble(&format!("{error}; {what}")));
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

    /// Removes what it would go on with.
    pub(super) fn forget(&mut self) -> Result<(), Error> {
        self.checkpoint.remove()?;
        self.indexes.remove()
    }

    pub(super) fn remove_sidecar(&mut self) -> Result<(), Error> {
        self.appending.remove()
    }
}
