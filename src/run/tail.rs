//! Following a recording while it is recorded: annotations at once in a growing sidecar, and at the end the annotated
//! recording that the batch path makes of the same bytes.
//!
//! Everything is a function of the recording's bytes; when they arrive, and how often the tail is killed meanwhile,
//! only affects when the annotations are there.

pub(super) mod checkpoint;
mod finish;
mod follow;
mod index_log;
mod location;
mod names;
mod shell;
mod state;

use std::path::Path;
use std::time::Instant;

use self::index_log::IndexLog;
use self::location::Location;
pub use self::names::sidecar_of;
pub(super) use self::names::{checkpoint_of, set_aside};
use self::names::{index_log_of, stays_as};
use self::shell::Shell;
pub use self::shell::{Following, Tailed};
use self::state::Progression;
use super::batch::{self, Options};
use super::stop::Stop;
use crate::Error;
use crate::config::Config;
use crate::pipeline::events::{Ending, Notice, Notify};
use crate::run::input::growing_file::GrowingFile;
use crate::run::input::splits::Input;
use crate::run::output::in_place::{self, Access};
use crate::run::output::reads::Reads;
use crate::run::output::sidecar_file::SidecarFile;
use crate::run::tail::checkpoint::{Checkpoint, Owner};

/// Follows a recording to its end: a file, or a rosbag2 folder into which its recorder writes one file after the other. If
/// it is cut off or written anew meanwhile, what was learned until then is set aside, and what stands there now is followed.
///
/// # Errors
///
/// If it is not MCAP or has no usable IMU topic (nothing is left behind then); or if it is unreachable, the system
/// refuses, or `stop` asks (the same call later continues from there).
pub fn tail(
    input: &Path,
    output: &Path,
    config: &Config,
    following: &Following,
    stop: &Stop,
    notify: Notify<'_>,
) -> Result<Tailed, Error> {
    loop {
        let tailed = tail_one(input, output, config, following, stop, notify)?;
        if tailed.ending != Ending::Truncated {
            return Ok(tailed);
        }
        if tailed.output.exists() {
            notify(Notice::Trouble(&stays_as(&set_aside(&tailed.output)?)));
        }
    }
}

/// Follows a recording until it ends or is written anew.
///
/// # Errors
///
/// As [`tail`].
pub(super) fn tail_one(
    input: &Path,
    output: &Path,
    config: &Config,
    following: &Following,
    stop: &Stop,
    notify: Notify<'_>,
) -> Result<Tailed, Error> {
    let sidecar = sidecar_of(output);
    let reads = Reads::of([input]);
    reads.refuse(&sidecar)?;
    // An existing output that is not replaced is only compared.
    if following.options.force || !input.exists() {
        reads.refuse(output)?;
    }
    // Looked at before the sidecar, which is made at once.
    let checkpoint = Checkpoint::new(checkpoint_of(&sidecar))?;
    let indexes = IndexLog::new(index_log_of(&sidecar))?;
    let mut shell = Shell {
        output: output.to_owned(),
        config,
        following,
        stop,
        owner: Owner { version: env!("CARGO_PKG_VERSION").to_owned(), configuration: config.canonical() },
        sidecar_file: SidecarFile::open(&sidecar)?,
        checkpoint,
        indexes,
    };
    let done = shell.run(input, notify).map_err(|error| match error {
        Error::Exists(path) if reads.contains(&path) => Error::Itself(path),
        error => error,
    });
    // An empty sidecar is only a lock.
    let nothing = shell.sidecar_file.length() == 0 && !shell.checkpoint.exists();
    match done {
        Ok(done) => Ok(done),
        Err(error) if nothing => shell.tidy().and(Err(error)),
        Err(error @ (Error::Unfit { .. } | Error::Overdue(_))) if shell.checkpoint.exists() => {
            shell.tidy().and(Err(error))
        }
        Err(Error::Stopped) => Err(Error::Paused),
        Err(error) => Err(error),
    }
}

impl Shell<'_> {
    fn run(&mut self, input: &Path, notify: Notify<'_>) -> Result<Tailed, Error> {
        if input.is_file() {
            // Reports a file that a killed run left half changed, and a file that only looks like its backup.
            drop(in_place::open(input, Access::Read)?);
        }
        if !self.following.options.force {
            if self.output.exists() {
                return self.already(input, notify);
            }
            if self.sidecar_file.length() > 0 && !self.checkpoint.exists() {
                return Err(Error::Exists(self.sidecar_file.path().to_owned()));
            }
        }
        if let Some(obstacle) = self.checkpoint.obstacle() {
            notify(Notice::Trouble(&obstacle));
        }
        let (location, first) = self.await_beginning(input, notify)?;
        self.follow(location, first, notify)
    }

    /// Handles an existing output: it must be the result of the recording as it is now.
    fn already(&mut self, input: &Path, notify: Notify<'_>) -> Result<Tailed, Error> {
        if Location::of(input).next(&[])?.is_none() {
            // Whatever is recorded later, this is not its result.
            return Err(Error::Exists(self.output.clone()));
        }
        let recording = Input::as_it_is(input)?;
        let (report, written) = batch::annotate(
            &recording,
            std::slice::from_ref(&self.output),
            self.config,
            Options { force: false, ..self.following.options },
            &|_| self.stop.check(),
        )?;
        // A tail may have ended just before it removed them, or completed the sidecar that stays.
        if self.checkpoint.exists() {
            self.leave_sidecar(&recording, notify)?;
        } else if self.sidecar_file.length() == 0 {
            self.remove_sidecar()?;
        }
        self.indexes.remove()?;
        let (length, output) = (recording.length(), self.output.clone());
        Ok(Tailed { report, length, output, written, ending: Ending::Finished })
    }

    fn await_beginning(&mut self, input: &Path, notify: Notify<'_>) -> Result<(Location, GrowingFile), Error> {
        let began = Instant::now();
        let mut told = false;
        loop {
            // Only an existing path shows whether it is a file.
            let location = Location::of(input);
            if let Some(first) = location.next(&[])? {
                return Ok((location, first));
            }
            if !std::mem::replace(&mut told, true) {
                notify(Notice::Awaited);
            }
            if self.following.patience.is_some_and(|patience| began.elapsed() >= patience) {
                let why = "nothing was recorded: it is still missing or empty; was its recorder ever started?";
                return Err(Error::input(input, why));
            }
            self.pause(self.following.poll)?;
        }
    }

    fn follow(&mut self, location: Location, first: GrowingFile, notify: Notify<'_>) -> Result<Tailed, Error> {
        let mut progression = Progression::begin(self, location, first, notify)?;
        let ending = match self.record(&mut progression, notify) {
            Err(error) => {
                // Finished work need not be repeated; stopping matters more than a full disk.
                let _ = self.save(&mut progression, notify).and_then(|()| self.checkpoint.settle());
                return Err(error);
            }
            Ok(ending) => ending,
        };
        notify(Notice::Ended(ending));
        self.end(progression, ending, notify)
    }
}
