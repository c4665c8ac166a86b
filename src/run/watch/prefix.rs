//! A prefix of an object store as a service: each recording under it that has not changed from one listing to the next
//! gets a sidecar, once, and another one in its place when the recording was replaced.

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
use crate::run::prefix::{WithSidecar, with_sidecars};
use crate::run::stop::Stop;
use crate::run::store::{Listed, ResultMark, marked};
use crate::run::tail::Tailed;
use crate::run::watch::metrics::Metrics;

/// Time by which a sidecar is certainly younger than its recording, in milliseconds (a day): a recording that is sent in parts
/// may bear the time of the first.
const YOUNGER_MS: i64 = 86_400_000;

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
    /// Whether another one had its name before, as far as this watch saw.
    is_another: bool,
}

/// A recording to work on.
struct Due {
    path: PathBuf,
    version: String,
    sidecar: PathBuf,
    /// Whether its sidecar's name is taken, and whether certainly by that of another recording.
    is_taken: bool,
    is_another: bool,
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
    let fingerprint = || crc32fast::hash(config().canonical().as_bytes());
    let mut configuration = fingerprint();
    let mut known: BTreeMap<PathBuf, Known> = BTreeMap::new();
    while stop.check().is_ok() {
        let next_look = Instant::now() + watching.interval;
        let current = fingerprint();
        if std::mem::replace(&mut configuration, current) != current {
            // What was refused may be accepted now.
            let refused = known.values_mut().filter(|entry| entry.state == KnownState::LeftAlone);
            refused.for_each(|entry| (entry.state, entry.attempts) = (KnownState::New, 0));
        }
        match with_sidecars(&watching.prefix, watching.out.as_deref()) {
            Ok(found) => {
                // Those that are gone are forgotten with it.
                let mut before = std::mem::take(&mut known);
                let mut due = VecDeque::new();
                for WithSidecar { recording, sidecar, there } in found {
                    let (entry, is_due) = look(before.remove(&recording.path), &recording, there.as_ref());
                    if is_due {
                        let (path, version, is_another) = (recording.path.clone(), recording.version, entry.is_another);
                        due.push_back(Due { path, version, sidecar, is_taken: there.is_some(), is_another });
                    }
                    known.insert(recording.path, entry);
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

/// State of a recording by a listing, and whether it is due. Where the times do not tell whether its sidecar is its own, it
/// is due as well, and the mark on the sidecar tells.
fn look(before: Option<Known>, recording: &Listed, there: Option<&Listed>) -> (Known, bool) {
    let is_same = before.as_ref().is_some_and(|entry| entry.version == recording.version);
    let is_another = before.as_ref().is_some_and(|entry| entry.is_another || !is_same);
    let same = before.filter(|_| is_same);
    let is_younger = there.is_some_and(|there| there.modified_ms.saturating_sub(recording.modified_ms) > YOUNGER_MS);
    let state = match same.as_ref().map(|entry| entry.state) {
        Some(KnownState::New) | None if is_younger && !is_another => KnownState::Annotated,
        Some(state) => state,
        None => KnownState::New,
    };
    let is_due = match state {
        KnownState::New => same.is_some(),
        KnownState::Again(at) => at <= Instant::now(),
        KnownState::Annotated | KnownState::LeftAlone => false,
    };
    let attempts = same.map_or(0, |entry| entry.attempts);
    (Known { version: recording.version.clone(), state, attempts, is_another }, is_due)
}

/// Works on the recordings that are due, several at a time.
fn work(
    watching: &WatchingPrefix,
    due: VecDeque<Due>,
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
                    let Some(due) = next.filter(|_| stop.check().is_ok()) else { return };
                    let stop = stop.of_work(watching.time_limit);
                    metrics.begin(&due.path, stop.clone());
                    let result = one(&due, &config(), &stop);
                    if sender.send((due.path, result)).is_err() {
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

/// Annotates a recording, unless its sidecar is there already.
fn one(due: &Due, config: &Config, stop: &Stop) -> Result<Option<Tailed>, Error> {
    let Due { path, version, sidecar, .. } = due;
    let there = if due.is_taken { marked(sidecar)? } else { None };
    if there.as_ref().is_some_and(|mark| is_own(mark.as_ref(), version, due.is_another)) {
        return Ok(None);
    }
    let input = Input::open_original(path, Access::Read)?;
    let options = Options { form: Form::Sidecar, force: there.is_some(), ..Options::default() };
    let (report, written) = annotate(&input, std::slice::from_ref(sidecar), config, options, &|_| stop.check())?;
    let (length, output) = (input.length(), sidecar.to_owned());
    Ok(Some(Tailed { report, length, output, written, ending: Ending::Finished }))
}

/// Whether a sidecar is that of a recording, whatever its configuration. One without a mark was put there by another program,
/// and is taken for it unless the recording was certainly replaced.
fn is_own(mark: Option<&ResultMark>, version: &str, is_another: bool) -> bool {
    match mark.map(|mark| mark.input.as_str()).filter(|input| !input.is_empty()) {
        Some(input) if input.contains(':') => input == version,
        // Of a file, which has no version.
        Some(length) => !is_another && version.split(':').next() == Some(length),
        None => !is_another,
    }
}

fn finish(
    entry: &mut Known,
    path: &Path,
    result: Result<Option<Tailed>, Error>,
    metrics: &Metrics,
    notify: &dyn Fn(&Path, Verdict<'_>),
) {
    match result {
        Ok(tailed) => {
            if let Some(tailed) = tailed.filter(|tailed| tailed.written == Written::Now) {
                metrics.done(path, &tailed.report, tailed.length);
                notify(path, Verdict::Annotated(&tailed));
            }
            (entry.state, entry.attempts, entry.is_another) = (KnownState::Annotated, 0, false);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn listed(version: &str, modified_ms: i64) -> Listed {
        Listed { path: PathBuf::from("s3://robots/17.mcap"), length: 10, version: version.to_owned(), modified_ms }
    }

    #[test]
    fn a_sidecar_that_is_much_younger_is_the_recordings_own_and_any_other_is_looked_at() {
        let (old, young) = (listed("s", 0), listed("s", 2 * YOUNGER_MS));
        let (first, is_due) = look(None, &listed("10:a", 1), Some(&young));
        assert!(first.state == KnownState::Annotated && !is_due);
        // Replaced meanwhile: once it stays as it is, it is due.
        let (replaced, is_due) = look(Some(first), &listed("10:b", 1), Some(&young));
        assert!(replaced.state == KnownState::New && replaced.is_another && !is_due);
        let (stays, is_due) = look(Some(replaced), &listed("10:b", 1), Some(&young));
        assert!(stays.is_another && is_due);
        let (unknown, is_due) = look(None, &listed("10:a", 1), Some(&old));
        assert!(!is_due && look(Some(unknown), &listed("10:a", 1), Some(&old)).1);
    }

    #[test]
    fn a_mark_tells_whether_a_sidecar_is_of_this_version() {
        let mark = |input: &str| ResultMark { input: input.to_owned(), ..ResultMark::of(&Config::default()) };
        assert!(is_own(Some(&mark("10:a")), "10:a", true));
        assert!(!is_own(Some(&mark("10:b")), "10:a", false));
        assert!(is_own(Some(&mark("10")), "10:a", false), "of a file of this length");
        assert!(!is_own(Some(&mark("10")), "10:a", true) && !is_own(Some(&mark("11")), "10:a", false));
        assert!(is_own(None, "10:a", false) && !is_own(None, "10:a", true));
    }
}
