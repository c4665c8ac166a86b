//! A directory as a service: every recording in it is followed while it grows, annotated once, or put aside with the
//! reason. [`discovery`](super::discovery) finds recordings, [`results`](super::results) tells their state.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use super::discovery::{Stamp, recordings};
use super::results::{self, Attempt, Quarantine, make_way};
use super::watching::{WatchState, Watching};
use crate::Error;
use crate::config::Config;
use crate::pipeline::events::{Ending, Notice};
use crate::run::output::written::Written;
use crate::run::stop::Stop;
use crate::run::tail::{Following, Tailed, set_aside, tail_one};
use crate::run::watch::metrics::Metrics;

/// Wait after the first failed attempt at a recording; doubled after each further one.
pub(super) const FIRST_RETRY: Duration = Duration::from_secs(1);
/// Longest wait between two attempts.
pub(super) const LAST_RETRY: Duration = Duration::from_secs(60);
/// Number of attempts after which a refusal by the system counts as permanent. A full disk and another stillpoint never
/// do.
const ATTEMPTS: u32 = 6;

/// Number of runs that died on a recording after which it is left alone. Fewer may have been killed for other reasons.
const DEATHS: u32 = 4;

/// Event in the work on a recording.
#[derive(Debug)]
pub enum Verdict<'a> {
    /// Work on it begins; whether its recorder has finished it.
    Begun(bool),
    /// It was annotated.
    Annotated(&'a Tailed),
    /// It cannot be annotated, and is left alone until it changes.
    Quarantined(&'a str),
    /// It will be tried again after that time.
    Again(&'a Error, Duration),
}

/// Factory of further receivers for the news of a growing recording; called once for each recording.
pub type Show<'a> = &'a (dyn Fn() -> Box<dyn FnMut(&Notice<'_>) + 'a> + Sync);

#[derive(Debug)]
struct Entry {
    stamp: Stamp,
    state: WatchState,
    attempts: u32,
    /// Number of runs that died while they worked on it.
    deaths: u32,
    /// Whether nothing more is to be expected of it, as it is.
    finished: bool,
}

struct Finished {
    path: PathBuf,
    result: Result<Tailed, Error>,
}

/// Watches until `stop` asks to stop; the next watch resumes the recordings that are being followed.
///
/// # Errors
///
/// If the folder cannot be read at the start.
pub fn watch(
    watching: &Watching,
    config: &(dyn Fn() -> Config + Sync),
    stop: &Stop,
    metrics: &Metrics,
    show: Show<'_>,
    notify: &dyn Fn(&Path, Verdict<'_>),
) -> Result<(), Error> {
    recordings(&watching.folder)?;
    let fingerprint = || crc32fast::hash(config().canonical().as_bytes());
    let configuration = fingerprint();
    let mut watcher = Watcher { watching, configuration, entries: BTreeMap::new(), metrics, notify };
    let (sender, receiver) = channel();
    std::thread::scope(|scope| {
        let mut next_look = Instant::now();
        while stop.check().is_ok() {
            // Not after each finished recording: there may be thousands.
            if Instant::now() >= next_look {
                watcher.look(fingerprint());
                next_look = Instant::now() + watching.interval;
            }
            while let Some((path, finished)) = watcher.next() {
                let sender: Sender<Finished> = sender.clone();
                let stop = stop.of_work(finished.then(|| watching.time_limit(&path)));
                let work = {
                    let (path, stop) = (path.clone(), stop.clone());
                    move || {
                        let work = || one(watching, &path, finished, &config(), &stop, metrics, show);
                        let result = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
                            let why = panic.downcast_ref::<String>().map_or("unknown", String::as_str);
                            Err(Error::input(&path, format!("Stillpoint itself failed on it: {why}")))
                        });
                        // Nobody receives it once the watch ends.
                        let _ = sender.send(Finished { path, result });
                    }
                };
                metrics.begin(&path, stop);
                (watcher.notify)(&path, Verdict::Begun(finished));
                if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, work) {
                    let result = Err(Error::io("work on", &path)(error));
                    watcher.finish(Finished { path, result });
                }
            }
            watcher.count();
            watcher.wait(&receiver, stop, next_look);
        }
    });
    while let Ok(finished) = receiver.try_recv() {
        watcher.finish(finished);
    }
    Ok(())
}

/// Follows one recording, or processes a finished one.
fn one(
    watching: &Watching,
    path: &Path,
    finished: bool,
    config: &Config,
    stop: &Stop,
    metrics: &Metrics,
    show: Show<'_>,
) -> Result<Tailed, Error> {
    let output = watching.output(path);
    if let Some(folder) = output.parent() {
        std::fs::create_dir_all(folder).map_err(Error::io("write", folder))?;
    }
    let attempt = Attempt::begin(watching.attempt(path), path);
    let tailed = follow(watching, path, &output, finished, config, stop, metrics, show);
    // However it ended, the process survived it.
    attempt.end();
    tailed
}

#[expect(clippy::too_many_arguments, reason = "as its only caller")]
fn follow(
    watching: &Watching,
    path: &Path,
    output: &Path,
    finished: bool,
    config: &Config,
    stop: &Stop,
    metrics: &Metrics,
    show: Show<'_>,
) -> Result<Tailed, Error> {
    make_way(path, output, &|_| stop.check())?;
    let idle = if finished { Duration::ZERO } else { watching.following.idle };
    let following = Following { idle, ..watching.following.clone() };
    // A finished recording is processed too fast for anyone to watch.
    let mut show = (!finished).then(show);
    let mut notify = |notice: Notice<'_>| {
        metrics.note(path, &notice);
        show.iter_mut().for_each(|show| show(&notice));
    };
    let tailed = tail_one(path, output, config, &following, stop, &mut notify)?;
    metrics.done(path, &tailed.report, tailed.length);
    match tailed.ending {
        // The name is free for the next recording.
        Ending::Replaced | Ending::Truncated if tailed.output.exists() => {
            Ok(Tailed { output: set_aside(&tailed.output)?, ..tailed })
        }
        _ => Ok(tailed),
    }
}

struct Watcher<'a> {
    watching: &'a Watching,
    /// Fingerprint of the configuration in force.
    configuration: u32,
    entries: BTreeMap<PathBuf, Entry>,
    metrics: &'a Metrics,
    notify: &'a dyn Fn(&Path, Verdict<'_>),
}

impl Watcher<'_> {
    /// Looks through the directory. After a change of the configuration, recordings that were refused are tried again.
    fn look(&mut self, configuration: u32) {
        if std::mem::replace(&mut self.configuration, configuration) != configuration {
            self.entries.retain(|_, entry| entry.state != WatchState::Quarantined);
        }
        let Ok(found) = recordings(&self.watching.folder) else {
            self.metrics.error();
            return;
        };
        self.entries.retain(|path, entry| found.contains_key(path) || matches!(entry.state, WatchState::Running(_)));
        for (path, stamp) in found {
            match self.entries.get_mut(&path) {
                Some(entry)
                    if entry.stamp == stamp || matches!(entry.state, WatchState::Running(_) | WatchState::Again(_)) => {
                }
                _ => {
                    let state = self.watching.state(&path, &stamp, self.configuration);
                    let deaths = match state {
                        WatchState::Waiting => Attempt::deaths(&self.watching.attempt(&path), &stamp),
                        _ => 0,
                    };
                    self.entries.insert(path.clone(), Entry { stamp, state, attempts: 0, deaths, finished: false });
                    if deaths >= DEATHS {
                        let why = format!("{deaths} runs died while they worked on it: killed, or out of memory");
                        self.leave_alone(&path, &Error::input(&path, why));
                    }
                }
            }
        }
    }

    /// The next recording to be worked on, and whether it is finished.
    fn next(&mut self) -> Option<(PathBuf, bool)> {
        let running =
            |as_finished| self.entries.values().filter(|entry| entry.state == WatchState::Running(as_finished)).count();
        let running_finished = running(true);
        let room = [(false, running(false) < self.watching.growing), (true, running(true) < self.watching.finished)];
        if room.iter().all(|(_, free)| !free) {
            return None;
        }
        let now = Instant::now();
        let in_doubt = self.entries.values().any(|entry| entry.deaths > 0 && entry.state == WatchState::Running(true));
        for (path, entry) in &mut self.entries {
            let due = match entry.state {
                WatchState::Waiting => entry.stamp.length > 0,
                WatchState::Again(at) => at <= now,
                _ => false,
            };
            if !due {
                continue;
            }
            // Without room for finished recordings, those known to be finished are skipped unread.
            if entry.finished && !room.contains(&(true, true)) {
                continue;
            }
            entry.finished = entry.finished || self.watching.is_finished(path, &entry.stamp);
            let finished = entry.finished;
            // A recording on which a run died is worked on alone, so that the next death has a known cause.
            if in_doubt || entry.deaths > 0 && running_finished > 0 {
                continue;
            }
            if room.contains(&(finished, true)) {
                entry.state = WatchState::Running(finished);
                return Some((path.clone(), finished));
            }
        }
        None
    }

    /// Takes results until the next look is due.
    fn wait(&mut self, receiver: &Receiver<Finished>, stop: &Stop, until: Instant) {
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
        self.metrics.end(&path);
        let Some(entry) = self.entries.get_mut(&path) else { return };
        let now = Stamp::of(&path).unwrap_or_else(|| entry.stamp.clone());
        match result {
            Ok(tailed) => {
                (self.notify)(&path, Verdict::Annotated(&tailed));
                self.watching.forgive(&path);
                let is_its = |length| length == now.length || length == results::length(&path, &now);
                entry.state = match tailed.ending {
                    // Another recording may have taken the name since.
                    Ending::Replaced | Ending::Truncated => WatchState::Waiting,
                    // Its output has just been compared, whatever its times say.
                    _ if tailed.written == Written::Before && is_its(tailed.length) => WatchState::Annotated,
                    Ending::Finished | Ending::Idle | Ending::Deleted => {
                        self.watching.state(&path, &now, self.configuration)
                    }
                };
                (entry.attempts, entry.deaths, entry.finished) = (0, 0, false);
                entry.stamp = now;
            }
            Err(Error::Stopped | Error::Paused) => entry.state = WatchState::Waiting,
            Err(error) => {
                self.metrics.error();
                entry.attempts += 1;
                let for_good = matches!(
                    error,
                    Error::Input { .. }
                        | Error::Unfit { .. }
                        | Error::Exists(_)
                        | Error::Itself(_)
                        | Error::ItselfAnnotated(_)
                        | Error::Overdue(_)
                );
                let passes = error.is_full() || matches!(error, Error::Busy(_));
                if for_good || entry.attempts >= ATTEMPTS && !passes {
                    self.leave_alone(&path, &error);
                    return;
                }
                let wait = FIRST_RETRY.saturating_mul(1 << entry.attempts.min(16).saturating_sub(1)).min(LAST_RETRY);
                (self.notify)(&path, Verdict::Again(&error, wait));
                entry.state = WatchState::Again(Instant::now() + wait);
            }
        }
    }

    /// Puts a recording aside, with the reason.
    fn leave_alone(&mut self, path: &Path, error: &Error) {
        let Some(entry) = self.entries.get_mut(path) else { return };
        let reason = match error {
            Error::Overdue(_) => format!("{}: {error}", path.display()),
            error => error.to_string(),
        };
        (self.notify)(path, Verdict::Quarantined(&reason));
        self.metrics.forget(path);
        entry.state = WatchState::Quarantined;
        if let Some(now) = Stamp::of(path) {
            entry.stamp = now;
        }
        let quarantine = Quarantine::new(path, entry.stamp.clone(), reason, self.configuration);
        if self.watching.write(&quarantine).is_err() {
            // A restart will find it out again.
            self.metrics.error();
        }
        Attempt::forget(&self.watching.attempt(path));
    }

    fn count(&self) {
        let mut states = BTreeMap::from(["waiting", "following", "annotated", "quarantined"].map(|state| (state, 0)));
        for entry in self.entries.values() {
            let state = match entry.state {
                WatchState::Waiting | WatchState::Again(_) => "waiting",
                WatchState::Running(_) => "following",
                WatchState::Annotated => "annotated",
                WatchState::Quarantined => "quarantined",
            };
            *states.entry(state).or_default() += 1;
        }
        self.metrics.round(states);
    }
}
