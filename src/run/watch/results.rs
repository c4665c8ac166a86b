//! Paths of a watch's results, and the state of a recording by them: annotated, or left alone. A restart needs nothing
//! else.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::discovery::{self, Stamp};
use super::watching::{WatchState, Watching};
use crate::Error;
use crate::record::FileKind;
use crate::run::input::recording::{Recording, Watch};
use crate::run::input::splits::Input;
use crate::run::input::{regular, rosbag2};
use crate::run::output::names::with_ending;
use crate::run::output::partial::Partial;
use crate::run::output::reads::Reads;
use crate::run::tail::{checkpoint, checkpoint_of, set_aside, sidecar_of};

/// Time limit of every recording, plus one second for each MiB.
const LEAST_TIME: Duration = Duration::from_secs(600);

/// Longest note, in bytes (1 MiB).
const LONGEST: u64 = 1 << 20;

/// A file that says why a recording is left alone.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Quarantine {
    pub(super) recording: PathBuf,
    #[serde(flatten)]
    pub(super) stamp: Stamp,
    pub(super) reason: String,
    /// Time of the next attempt, for people.
    pub(super) next: String,
    /// Fingerprint of the configuration that refused it.
    #[serde(default)]
    pub(super) configuration: u32,
}

impl Quarantine {
    pub(super) fn new(recording: &Path, stamp: Stamp, reason: String, configuration: u32) -> Self {
        let next = "it is tried again when it or the configuration changes, or this file is removed".to_owned();
        Self { recording: recording.to_owned(), stamp, reason, next, configuration }
    }

    /// Reads the note at a path; `None` if it is none.
    pub(super) fn read(path: &Path) -> Option<Self> {
        note(path)
    }
}

/// A note beside a recording's result while work on it goes on: a note that is found means that a run died.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Attempt {
    stamp: Option<Stamp>,
    deaths: u32,
    #[serde(skip)]
    path: PathBuf,
}

impl Attempt {
    /// Writes the note that work on a recording begins. Where it cannot be written, a death goes unnoticed.
    pub(super) fn begin(path: PathBuf, recording: &Path) -> Self {
        let stamp = Stamp::of(recording);
        let deaths = stamp.as_ref().map_or(0, |stamp| Self::deaths(&path, stamp));
        let attempt = Self { stamp, deaths: deaths + 1, path };
        let is_free = attempt.path.symlink_metadata().is_err() || Self::read(&attempt.path).is_some();
        if is_free && let Ok(partial) = Partial::create(&attempt.path, &Reads::of([recording])) {
            let written = serde_json::to_writer(partial.file(), &attempt).is_ok();
            _ = written.then(|| partial.finish(false));
        }
        attempt
    }

    /// Removes the note, since the work has ended.
    pub(super) fn end(self) {
        Self::forget(&self.path);
    }

    /// Removes the note at a path. Beside a finished result nobody would look for it again, so that what refuses it once is
    /// asked twice.
    pub(super) fn forget(path: &Path) {
        if Self::read(path).is_some() {
            let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_file(path));
        }
    }

    /// Number of runs that died on a recording that has not changed since.
    pub(super) fn deaths(path: &Path, stamp: &Stamp) -> u32 {
        Self::read(path).filter(|attempt| attempt.stamp.as_ref() == Some(stamp)).map_or(0, |attempt| attempt.deaths)
    }

    fn read(path: &Path) -> Option<Self> {
        note(path)
    }
}

/// Reads a note; `None` if it is none.
fn note<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let read = || regular::open_own(path).and_then(|file| regular::read(file, LONGEST));
    // A note that cannot be read would neither count nor ever be removed: trouble that passes shall not do that.
    let bytes = read().or_else(|error| if error.kind() == ErrorKind::NotFound { Err(error) } else { read() }).ok()?;
    serde_json::from_slice(&bytes).ok()
}

impl Watching {
    /// Path of a recording's result.
    pub(super) fn output(&self, recording: &Path) -> PathBuf {
        let ending = if is_folder(recording) { "annotated" } else { "annotated.mcap" };
        self.place(recording, ending)
    }

    pub(super) fn quarantine(&self, recording: &Path) -> PathBuf {
        self.place(recording, "quarantine.json")
    }

    /// Path of the note that work on a recording goes on: hidden, beside its result.
    pub(super) fn attempt(&self, recording: &Path) -> PathBuf {
        let place = self.place(recording, "stillpoint-attempt");
        let mut name = std::ffi::OsString::from(".");
        name.push(place.file_name().unwrap_or_default());
        place.with_file_name(name)
    }

    /// Longest time that work on a finished recording may take.
    pub(super) fn time_limit(&self, recording: &Path) -> Duration {
        let length = Stamp::of(recording).map_or(0, |stamp| stamp.length);
        self.time_limit.unwrap_or(LEAST_TIME + Duration::from_secs(length >> 20))
    }

    fn place(&self, recording: &Path, ending: &str) -> PathBuf {
        let within = recording.strip_prefix(&self.folder).unwrap_or(recording);
        let place = self.out.as_ref().map_or_else(|| recording.to_owned(), |out| out.join(within));
        let stem = if is_folder(recording) { recording.file_name() } else { recording.file_stem() };
        place.with_file_name(with_ending(stem.unwrap_or_default(), &format!(".{ending}")))
    }

    /// State of a recording, by its outputs.
    pub(super) fn state(&self, recording: &Path, stamp: &Stamp, configuration: u32) -> WatchState {
        let output = self.output(recording);
        let checkpoint = checkpoint_of(&sidecar_of(&output));
        // What cannot be read now is asked for again by the work on the recording.
        if checkpoint.exists() && !checkpoint::is_foreign(&checkpoint).unwrap_or_default() {
            return WatchState::Waiting;
        }
        // A recording that is newer than the result may be another one of the same length.
        let younger = Stamp::of(&output).is_some_and(|output| stamp.modified_ns > output.modified_ns);
        if !younger && original_length(&output) == Some(length(recording, stamp)) {
            return WatchState::Annotated;
        }
        let quarantine = Quarantine::read(&self.quarantine(recording));
        let holds = |quarantine: &Quarantine| quarantine.stamp == *stamp && quarantine.configuration == configuration;
        match quarantine.as_ref().is_some_and(holds) {
            true => WatchState::Quarantined,
            false => WatchState::Waiting,
        }
    }

    /// Whether nothing more is to be expected of a recording.
    pub(super) fn is_finished(&self, recording: &Path, stamp: &Stamp) -> bool {
        stamp.is_idle(self.following.idle) || discovery::is_finished(recording)
    }

    /// Removes the note that a recording is left alone.
    pub(super) fn forgive(&self, recording: &Path) {
        let path = self.quarantine(recording);
        if Quarantine::read(&path).is_some() {
            let _ = std::fs::remove_file(path);
        }
    }

    pub(super) fn write(&self, quarantine: &Quarantine) -> Result<(), Error> {
        let path = self.quarantine(&quarantine.recording);
        let partial = match path.symlink_metadata() {
            Ok(_) if Quarantine::read(&path).is_none() => return Err(Error::Exists(path)),
            Ok(_) => Partial::create(&path, &Reads::of([&quarantine.recording]))?,
            Err(_) => Partial::create_new(&path)?,
        };
        let written = serde_json::to_writer_pretty(partial.file(), quarantine);
        written.map_err(|error| Error::io("write", &path)(error.into()))?;
        partial.finish(false)
    }
}

/// Renames the results of an earlier recording of the same name: one that continued after it had been given up, or one
/// that was replaced. The tail handles unfinished results.
pub(super) fn make_way(recording: &Path, output: &Path, watch: Watch<'_>) -> Result<(), Error> {
    let stamp =
        Stamp::of(recording).ok_or_else(|| Error::io("read", recording)(std::io::ErrorKind::NotFound.into()))?;
    let same = || Input::as_it_is(recording)?.is_same(&Input::as_it_is(output)?, watch);
    match original_length(output) {
        Some(original) if original != length(recording, &stamp) || !same()? => _ = set_aside(output)?,
        Some(_) => return Ok(()),
        None if output.exists() => return Ok(()),
        None => {}
    }
    let sidecar = sidecar_of(output);
    let is_ours = || {
        let kind = regular::open_own(&sidecar).is_ok().then(|| Recording::open(&sidecar).ok()?.kind().ok());
        matches!(kind.flatten(), Some(FileKind::Sidecar { .. }))
    };
    if !checkpoint_of(&sidecar).exists() && is_ours() {
        set_aside(&sidecar)?;
    }
    Ok(())
}

/// Length of a recording in bytes, without annotations that it may already have.
pub(super) fn length(recording: &Path, stamp: &Stamp) -> u64 {
    original_length(recording).unwrap_or(stamp.length)
}

/// Length in bytes of the recording that a result belongs to.
fn original_length(output: &Path) -> Option<u64> {
    let of_file = |file: &Path| match Recording::open(file).ok()?.kind().ok()? {
        FileKind::Annotated { original, .. } => Some(original.length()),
        _ => None,
    };
    match output.is_dir() {
        true => {
            let files = rosbag2::files(output).into_iter().map(|name| output.join(name));
            // Files without any recording were copied as they were.
            let blank = |file: &Path| rosbag2::is_blank(file).then(|| std::fs::metadata(file).ok()).flatten();
            files.map(|file| of_file(&file).or_else(|| Some(blank(&file)?.len()))).sum()
        }
        false => of_file(output),
    }
}

/// Whether a recording is a folder. One that is gone is judged by its name.
fn is_folder(recording: &Path) -> bool {
    recording.is_dir() || recording.extension().is_none_or(|ending| ending != "mcap")
}
