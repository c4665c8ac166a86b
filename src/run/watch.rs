//! A directory as a service: every recording in it is followed while it grows, annotated once, or put aside with the
//! reason. What has been done is told from the outputs alone, so that a restart needs nothing else.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant, SystemTime};

use serde::{Deserialize, Serialize};

use super::growing::Growing;
use super::metrics::Metrics;
use super::news::Ending;
use super::partial::Partial;
use super::recording::Recording;
use super::stop::Stop;
use super::tail::{Following, Tailed, sidecar_of, tail};
use crate::Error;
use crate::config::Config;
use crate::record::Kind;

/// Between two attempts at a recording: the first, doubled each time, …
const FIRST_RETRY: Duration = Duration::from_secs(1);
/// … up to the last.
const LAST_RETRY: Duration = Duration::from_secs(60);
/// After so many attempts, what the system refuses is taken to be for good; a full disk never is.
const ATTEMPTS: u32 = 6;

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
}

/// What became of a recording.
#[derive(Debug)]
pub enum Verdict<'a> {
    /// It was annotated.
    Annotated(&'a Tailed),
    /// It cannot be annotated, and is left alone until it changes.
    Quarantined(&'a str),
    /// It will be tried again after that time.
    Again(&'a Error, Duration),
}

/// A recording, as far as it can be told from another one of its name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Stamp {
    length: u64,
    modified_ns: u64,
}

/// The file that says why a recording is left alone.
#[derive(Debug, Serialize, Deserialize)]
struct Quarantine {
    recording: PathBuf,
    #[serde(flatten)]
    stamp: Stamp,
    reason: String,
}

#[derive(Debug)]
struct Entry {
    stamp: Stamp,
    state: State,
    attempts: u32,
}

#[derive(Debug, PartialEq)]
enum State {
    Waiting,
    /// Followed; whether as a finished one.
    Running(bool),
    Again(Instant),
    Annotated,
    Quarantined,
}

struct Finished {
    path: PathBuf,
    result: Result<Tailed, Error>,
}

/// Watches until `stop` asks to stop; what is being followed then goes on with the next watch.
///
/// # Errors
///
/// If the folder cannot be read at the start.
pub fn watch(
    watching: &Watching,
    config: &(dyn Fn() -> Config + Sync),
    stop: &Stop,
    metrics: &Metrics,
    tell: &dyn Fn(&Path, Verdict<'_>),
) -> Result<(), Error> {
    recordings(&watching.folder)?;
    let mut watcher = Watcher { watching, entries: BTreeMap::new(), metrics, tell };
    let (sender, receiver) = channel();
    std::thread::scope(|scope| {
        while stop.check().is_ok() {
            watcher.look();
            while let Some((path, finished)) = watcher.next() {
                let sender: Sender<Finished> = sender.clone();
                scope.spawn(move || {
                    let result = one(watching, &path, finished, &config(), stop, metrics);
                    // Nobody listens any more once the watch ends.
                    let _ = sender.send(Finished { path, result });
                });
            }
            watcher.count();
            watcher.wait(&receiver, stop);
        }
    });
    while let Ok(finished) = receiver.try_recv() {
        watcher.finish(finished);
    }
    Ok(())
}

/// Follows one recording, or works through a finished one.
fn one(
    watching: &Watching,
    path: &Path,
    finished: bool,
    config: &Config,
    stop: &Stop,
    metrics: &Metrics,
) -> Result<Tailed, Error> {
    let output = watching.output(path);
    if let Some(folder) = output.parent() {
        std::fs::create_dir_all(folder).map_err(Error::io("write", folder))?;
    }
    make_way(path, &output)?;
    let idle = if finished { Duration::ZERO } else { watching.following.idle };
    let following = Following { idle, ..watching.following.clone() };
    let tailed = tail(path, &output, config, &following, stop, &mut |news| metrics.note(path, &news))?;
    metrics.done(path, &tailed.report, std::fs::metadata(path).map_or(0, |metadata| metadata.len()));
    match tailed.ending {
        // The name is free for the next recording.
        Ending::Replaced | Ending::Truncated => Ok(Tailed { output: set_aside(&tailed.output)?, ..tailed }),
        Ending::Finished | Ending::Idle | Ending::Deleted => Ok(tailed),
    }
}

/// Sets aside what belongs to an earlier recording of the same name, one that went on after it had been given up, or one
/// that was replaced.
fn make_way(recording: &Path, output: &Path) -> Result<(), Error> {
    let sidecar = sidecar_of(output);
    if sidecar.with_extension("checkpoint").exists() {
        return Ok(());
    }
    if std::fs::metadata(&sidecar).is_ok_and(|metadata| metadata.len() > 0) {
        set_aside(&sidecar)?;
    }
    let length = std::fs::metadata(recording).map_err(Error::io("read", recording))?.len();
    if original_length(output).is_some_and(|original| original != length) {
        set_aside(output)?;
    }
    Ok(())
}

/// Gives a result another name, since its recording has lost its own.
fn set_aside(result: &Path) -> Result<PathBuf, Error> {
    let name = result.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (stem, ending) = name.split_once('.').unwrap_or((&name, "mcap"));
    let mut names = (1_u32..).map(|n| result.with_file_name(format!("{stem}.before-{n}.{ending}")));
    let aside = names.find(|path| !path.exists()).unwrap_or_default();
    std::fs::rename(result, &aside).map_err(Error::io("rename", result))?;
    Ok(aside)
}

struct Watcher<'a> {
    watching: &'a Watching,
    entries: BTreeMap<PathBuf, Entry>,
    metrics: &'a Metrics,
    tell: &'a dyn Fn(&Path, Verdict<'_>),
}

impl Watcher<'_> {
    /// Looks through the directory.
    fn look(&mut self) {
        let Ok(found) = recordings(&self.watching.folder) else {
            self.metrics.error();
            return;
        };
        self.entries.retain(|path, entry| found.contains_key(path) || matches!(entry.state, State::Running(_)));
        for (path, stamp) in found {
            match self.entries.get_mut(&path) {
                Some(entry) if entry.stamp == stamp || matches!(entry.state, State::Running(_) | State::Again(_)) => {}
                _ => {
                    let state = self.watching.state(&path, &stamp);
                    self.entries.insert(path, Entry { stamp, state, attempts: 0 });
                }
            }
        }
    }

    /// The next recording to be worked on, and whether it is a finished one.
    fn next(&mut self) -> Option<(PathBuf, bool)> {
        let running =
            |as_finished| self.entries.values().filter(|entry| entry.state == State::Running(as_finished)).count();
        let room = [(false, running(false) < self.watching.growing), (true, running(true) < self.watching.finished)];
        let now = Instant::now();
        for (path, entry) in &mut self.entries {
            let due = match entry.state {
                State::Waiting => entry.stamp.length > 0,
                State::Again(at) => at <= now,
                _ => false,
            };
            if !due {
                continue;
            }
            let finished = self.watching.is_finished(path, &entry.stamp);
            if room.contains(&(finished, true)) {
                entry.state = State::Running(finished);
                return Some((path.clone(), finished));
            }
        }
        None
    }

    /// Takes in results until it is time to look again.
    fn wait(&mut self, receiver: &Receiver<Finished>, stop: &Stop) {
        let until = Instant::now() + self.watching.interval;
        while stop.check().is_ok() && Instant::now() < until {
            match receiver.recv_timeout(Duration::from_millis(50).min(self.watching.interval)) {
                Ok(finished) => {
                    self.finish(finished);
                    return;
                }
                Err(_) => continue,
            }
        }
    }

    fn finish(&mut self, Finished { path, result }: Finished) {
        let Some(entry) = self.entries.get_mut(&path) else { return };
        let now = stamp(&path).unwrap_or_else(|| entry.stamp.clone());
        match result {
            Ok(tailed) => {
                (self.tell)(&path, Verdict::Annotated(&tailed));
                let _ = std::fs::remove_file(self.watching.quarantine(&path));
                // Another recording may have taken the name since.
                entry.state = match tailed.ending {
                    Ending::Replaced | Ending::Truncated => State::Waiting,
                    Ending::Finished | Ending::Idle | Ending::Deleted => self.watching.state(&path, &now),
                };
                entry.stamp = now;
            }
            Err(Error::Stopped | Error::Paused) => entry.state = State::Waiting,
            Err(error) => {
                self.metrics.error();
                entry.attempts += 1;
                let for_good = matches!(error, Error::Input { .. } | Error::Exists(_));
                if for_good || entry.attempts >= ATTEMPTS && !error.is_full() {
                    let reason = error.to_string();
                    (self.tell)(&path, Verdict::Quarantined(&reason));
                    self.metrics.forget(&path);
                    entry.state = State::Quarantined;
                    entry.stamp = now.clone();
                    let quarantine = Quarantine { recording: path.clone(), stamp: now, reason };
                    if self.watching.write(&quarantine).is_err() {
                        // It will be found out again after a restart.
                        self.metrics.error();
                    }
                    return;
                }
                let wait = FIRST_RETRY.saturating_mul(1 << entry.attempts.min(16).saturating_sub(1)).min(LAST_RETRY);
                (self.tell)(&path, Verdict::Again(&error, wait));
                entry.state = State::Again(Instant::now() + wait);
            }
        }
    }

    fn count(&self) {
        let mut states = BTreeMap::from(["waiting", "following", "annotated", "quarantined"].map(|state| (state, 0)));
        for entry in self.entries.values() {
            let state = match entry.state {
                State::Waiting | State::Again(_) => "waiting",
                State::Running(_) => "following",
                State::Annotated => "annotated",
                State::Quarantined => "quarantined",
            };
            *states.entry(state).or_default() += 1;
        }
        self.metrics.round(states);
    }
}

impl Watching {
    /// Where the result of a recording goes.
    fn output(&self, recording: &Path) -> PathBuf {
        let named = match (&self.out, recording.strip_prefix(&self.folder)) {
            (Some(out), Ok(within)) => out.join(within),
            _ => recording.to_owned(),
        };
        named.with_extension("annotated.mcap")
    }

    fn quarantine(&self, recording: &Path) -> PathBuf {
        self.output(recording).with_extension("").with_extension("quarantine.json")
    }

    /// What the outputs say of a recording.
    fn state(&self, recording: &Path, stamp: &Stamp) -> State {
        let output = self.output(recording);
        if sidecar_of(&output).with_extension("checkpoint").exists() {
            return State::Waiting;
        }
        if original_length(&output) == Some(stamp.length) {
            return State::Annotated;
        }
        let quarantine = std::fs::read(self.quarantine(recording)).ok();
        let quarantine = quarantine.and_then(|bytes| serde_json::from_slice::<Quarantine>(&bytes).ok());
        match quarantine.is_some_and(|quarantine| quarantine.stamp == *stamp) {
            true => State::Quarantined,
            false => State::Waiting,
        }
    }

    /// Whether nothing more is to be expected of a recording.
    fn is_finished(&self, path: &Path, stamp: &Stamp) -> bool {
        let modified = SystemTime::UNIX_EPOCH + Duration::from_nanos(stamp.modified_ns);
        let idle = modified.elapsed().is_ok_and(|age| age >= self.following.idle);
        idle || Growing::open(path).ok().flatten().is_some_and(|growing| growing.is_closed())
    }

    fn write(&self, quarantine: &Quarantine) -> Result<(), Error> {
        let path = self.quarantine(&quarantine.recording);
        let partial = Partial::create(&path)?;
        let written = serde_json::to_writer_pretty(partial.file(), quarantine);
        written.map_err(|error| Error::io("write", &path)(error.into()))?;
        partial.finish(false)
    }
}

/// Length of the recording that a result belongs to.
fn original_length(output: &Path) -> Option<u64> {
    match Recording::open(output).ok()?.kind().ok()? {
        Kind::Annotated { original, .. } => Some(original.length()),
        _ => None,
    }
}

/// The recordings in a folder and its folders, without what Stillpoint wrote.
fn recordings(folder: &Path) -> Result<BTreeMap<PathBuf, Stamp>, Error> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let Ok(entry) = entry else { continue };
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_dir() && !name.starts_with('.') {
            // What cannot be read now may be read the next time.
            found.extend(recordings(&path).unwrap_or_default());
        } else if kind.is_file() && name.ends_with(".mcap") && !is_ours(&name) {
            found.extend(stamp(&path).map(|stamp| (path, stamp)));
        }
    }
    Ok(found)
}

fn is_ours(name: &str) -> bool {
    name.ends_with(".annotated.mcap") || name.ends_with(".stillpoint.mcap") || name.starts_with('.')
}

fn stamp(path: &Path) -> Option<Stamp> {
    let metadata = std::fs::metadata(path).ok()?;
    let modified = metadata.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    Some(Stamp { length: metadata.len(), modified_ns: u64::try_from(modified.as_nanos()).ok()? })
}
