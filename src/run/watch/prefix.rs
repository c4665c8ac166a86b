//! A prefix of an object store as a service: each recording under it that has not changed from one listing to the next
//! gets a sidecar, once.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::service::{FIRST_RETRY, LAST_RETRY, Verdict};
use crate::Error;
use crate::config::Config;
use crate::pipeline::events::Ending;
use crate::run::batch::{Form, Options, annotate};
use crate::run::input::splits::Input;
use crate::run::output::in_place::Access;
use crate::run::output::written::Written;
use crate::run::prefix::with_sidecars;
use crate::run::stop::Stop;
use crate::run::tail::Tailed;
use crate::run::watch::metrics::Metrics;

/// Options of watching a prefix.
#[derive(Clone, Debug)]
pub struct WatchingPrefix {
    /// The prefix.
    pub prefix: PathBuf,
    /// Prefix of the sidecars, under the same names; beside the recordings if `None`.
    pub out: Option<PathBuf>,
    /// Interval between two listings.
    pub interval: Duration,
    /// Most recordings that are worked on at a time.
    pub jobs: usize,
    /// Longest time that work on a recording may take.
    pub time_limit: Option<Duration>,
}

/// State of a recording.
struct Known {
    version: String,
    state: KnownState,
    attempts: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KnownState {
    /// Seen once in this version.
    New,
    /// Tried; to be tried again then.
    Again(Instant),
    Annotated,
    /// It cannot be annotated.
    LeftAlone,
}

/// Watches a prefix until `stop` asks to stop.
///
/// # Errors
///
/// If the prefix cannot be listed at the start.
pub fn watch_prefix(
    watching: &WatchingPrefix,
    config: &(dyn Fn() -> Config + Sync),
    stop: &Stop,
    metrics: &Metrics,
    notify: &dyn Fn(&Path, Verdict<'_>),
) -> Result<(), Error> {
    with_sidecars(&watching.prefix, watching.out.as_deref())?;
    tracing::info!("watching {}", watching.prefix.display());
    let mut known: BTreeMap<PathBuf, Known> = BTreeMap::new();
    while stop.check().is_ok() {
        let next_look = Instant::now() + watching.interval;
        match with_sidecars(&watching.prefix, watching.out.as_deref()) {
            Ok(found) => {
                // Those that are gone are forgotten with it.
                let mut before = std::mem::take(&mut known);
                let mut due = VecDeque::new();
                for (object, sidecar, is_there) in found {
                    let entry = before.remove(&object.path).filter(|entry| entry.version == object.version);
                    let state = match entry.as_ref().map(|entry| entry.state) {
                        _ if is_there => KnownState::Annotated,
                        Some(state) => state,
                        None => KnownState::New,
                    };
                    let is_due = match (&entry, state) {
                        (Some(_), KnownState::New) => true,
                        (_, KnownState::Again(at)) => at <= Instant::now(),
                        _ => false,
                    };
                    let attempts = entry.map_or(0, |entry| entry.attempts);
                    known.insert(object.path.clone(), Known { version: object.version, state, attempts });
                    if is_due {
                        due.push_back((object.path, sidecar));
                    }
                }
                count(&known, metrics);
                work(watching, due, &mut known, config, stop, metrics, notify);
                count(&known, metrics);
            }
            Err(_) => metrics.error(),
        }
        while stop.check().is_ok() && Instant::now() < next_look {
            std::thread::sleep(Duration::from_millis(50).min(watching.interval));
        }
    }
    Ok(())
}

/// Works on the recordings that are due, several at a time.
fn work(
    watching: &WatchingPrefix,
    due: VecDeque<(PathBuf, PathBuf)>,
    known: &mut BTreeMap<PathBuf, Known>,
    config: &(dyn Fn() -> Config + Sync),
    stop: &Stop,
    metrics: &Metrics,
    notify: &dyn Fn(&Path, Verdict<'_>),
) {
    let jobs = watching.jobs.min(due.len());
    let due = Mutex::new(due);
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            let (sender, due) = (sender.clone(), &due);
            let work = move || {
                loop {
                    let next = due.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
                    let Some((path, sidecar)) = next.filter(|_| stop.check().is_ok()) else { return };
                    let stop = stop.of_work(watching.time_limit);
                    metrics.begin(&path, stop.clone());
                    let result = one(&path, &sidecar, &config(), &stop);
                    if sender.send((path, result)).is_err() {
                        return;
                    }
                }
            };
            // What no thread works on is due again at the next listing.
            let _ = std::thread::Builder::new().spawn_scoped(scope, work);
        }
        drop(sender);
        for (path, result) in receiver {
            metrics.end(&path);
            if let Some(entry) = known.get_mut(&path) {
                finish(entry, &path, result, metrics, notify);
            }
        }
    });
}

fn one(path: &Path, sidecar: &Path, config: &Config, stop: &Stop) -> Result<Tailed, Error> {
    let input = Input::open_original(path, Access::Read)?;
    let options = Options { form: Form::Sidecar, ..Options::default() };
    let (report, written) = annotate(&input, &[sidecar.to_owned()], config, options, &|_| stop.check())?;
    let (length, output) = (input.length(), sidecar.to_owned());
    Ok(Tailed { report, length, output, written, ending: Ending::Finished })
}

fn finish(
    entry: &mut Known,
    path: &Path,
    result: Result<Tailed, Error>,
    metrics: &Metrics,
    notify: &dyn Fn(&Path, Verdict<'_>),
) {
    match result {
        Ok(tailed) => {
            if tailed.written == Written::Now {
                metrics.done(path, &tailed.report, tailed.length);
                notify(path, Verdict::Annotated(&tailed));
            }
            (entry.state, entry.attempts) = (KnownState::Annotated, 0);
        }
        Err(Error::Stopped | Error::Paused) => {}
        Err(error) if error.is_passing() => {
            metrics.error();
            let wait = FIRST_RETRY.saturating_mul(1 << entry.attempts.min(16)).min(LAST_RETRY);
            notify(path, Verdict::Again(&error, wait));
            (entry.state, entry.attempts) = (KnownState::Again(Instant::now() + wait), entry.attempts + 1);
        }
        Err(error) => {
            metrics.error();
            let reason = match error {
                Error::Overdue(_) => format!("{}: {error}", path.display()),
                error => error.to_string(),
            };
            notify(path, Verdict::Quarantined(&reason));
            metrics.forget(path);
            entry.state = KnownState::LeftAlone;
        }
    }
}

fn count(known: &BTreeMap<PathBuf, Known>, metrics: &Metrics) {
    let mut states = BTreeMap::from(["waiting", "following", "annotated", "quarantined"].map(|state| (state, 0)));
    for entry in known.values() {
        let state = match entry.state {
            KnownState::New | KnownState::Again(_) => "waiting",
            KnownState::Annotated => "annotated",
            KnownState::LeftAlone => "quarantined",
        };
        *states.entry(state).or_default() += 1;
    }
    metrics.round(states);
}
