//! Counters of a service, and their text for Prometheus. [`serve`](crate::run::watch::http) serves it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::engine::Message;
use crate::pipeline::events::Notice;
use crate::printable;
use crate::run::batch::Report;
use crate::run::stop::Stop;

/// Counters shared by all work.
#[derive(Debug, Default)]
pub struct Metrics(Mutex<Counts>);

#[derive(Debug, Default)]
struct Counts {
    messages: u64,
    samples: u64,
    rests: u64,
    refits: u64,
    bytes: u64,
    damages: u64,
    errors: u64,
    /// Recordings by state.
    states: BTreeMap<&'static str, u64>,
    followed: BTreeMap<PathBuf, FollowedCounts>,
    /// Time of the last look through the directory.
    round: Option<Instant>,
    /// Stop requests of the work in progress, by recording.
    working: BTreeMap<PathBuf, Stop>,
}

/// Counts of a recording that is followed, so that nothing is counted twice when it is read again.
#[derive(Debug, Default)]
struct FollowedCounts {
    rests: u64,
    /// Rests in the findings since the last [`Notice::Read`].
    seen: u64,
    read: u64,
    length: u64,
    /// Time since which unread bytes wait without progress.
    behind: Option<Instant>,
}

impl Metrics {
    /// Counts news of a recording.
    pub fn note(&self, recording: &Path, notice: &Notice<'_>) {
        let counts = &mut *self.lock();
        match notice {
            Notice::Message { samples, .. } => {
                counts.messages += 1;
                counts.samples += *samples as u64;
            }
            Notice::Annotation { event, .. } if matches!(event.message, Message::Calibration(_)) => counts.refits += 1,
            Notice::Damage(_) => counts.damages += 1,
            Notice::Imu { findings, .. } => counts.followed(recording).seen += findings.rests.len() as u64,
            Notice::Read(progress) => {
                let followed = counts.followed(recording);
                followed.length = progress.length;
                let rests = std::mem::take(&mut followed.seen);
                counts.reach(recording, rests, progress.read);
            }
            _ => {}
        }
    }

    /// Registers work on a recording; `stop` shows its last check.
    pub fn begin(&self, recording: &Path, stop: Stop) {
        self.lock().working.insert(recording.to_owned(), stop);
    }

    /// Removes work on a recording that ended, in whatever way.
    pub fn end(&self, recording: &Path) {
        self.lock().working.remove(recording);
    }

    /// Counts a finished recording.
    pub fn done(&self, recording: &Path, report: &Report, length: u64) {
        let counts = &mut *self.lock();
        counts.reach(recording, report.imus.iter().map(|imu| imu.rests.len() as u64).sum(), length);
        counts.followed.remove(recording);
    }

    /// Forgets a recording that is no longer followed.
    pub fn forget(&self, recording: &Path) {
        self.lock().followed.remove(recording);
    }

    /// Counts an error.
    pub fn error(&self) {
        self.lock().errors += 1;
    }

    /// Records a look through the directory, with the number of recordings in each state.
    pub fn round(&self, states: BTreeMap<&'static str, u64>) {
        let counts = &mut *self.lock();
        counts.states = states;
        counts.round = Some(Instant::now());
    }

    /// Whether the last look through the directory, and the last sign of work on every recording, are recent.
    pub fn is_alive(&self, within: Duration) -> bool {
        let counts = self.lock();
        let goes_on = counts.working.values().all(|work| work.silence() < within);
        goes_on && counts.round.is_some_and(|round| round.elapsed() < within)
    }

    /// Whether the directory has been looked through at all.
    pub fn is_ready(&self) -> bool {
        self.lock().round.is_some()
    }

    /// All metrics in the text format of Prometheus.
    pub fn text(&self) -> String {
        let counts = &*self.lock();
        let mut out = String::new();
        let mut metric = |name: &str, kind: &str, help: &str, values: &[(String, f64)]| {
            let _ = writeln!(out, "# HELP stillpoint_{name} {help}\n# TYPE stillpoint_{name} {kind}");
            for (labels, value) in values {
                let _ = writeln!(out, "stillpoint_{name}{labels} {value}");
            }
        };
        let states = counts.states.iter().map(|(state, &n)| (format!("{{state=\"{state}\"}}"), n as f64));
        metric("recordings", "gauge", "Recordings in the directory.", &states.collect::<Vec<_>>());
        for (name, help, value) in [
            ("messages_total", "Messages that were used.", counts.messages),
            ("samples_total", "Readings of a triad.", counts.samples),
            ("rests_total", "Rests that were found.", counts.rests),
            ("refits_total", "Calibrations that were published.", counts.refits),
            ("bytes_total", "Bytes of recordings that were read.", counts.bytes),
            ("damages_total", "Damages that were found in recordings.", counts.damages),
            ("errors_total", "Attempts at a recording that failed.", counts.errors),
        ] {
            metric(name, "counter", help, &[(String::new(), value as f64)]);
        }
        let behind = |followed: &FollowedCounts| followed.length.saturating_sub(followed.read) as f64;
        let seconds = |followed: &FollowedCounts| followed.behind.map_or(0.0, |since| since.elapsed().as_secs_f64());
        let lag = |of: &dyn Fn(&FollowedCounts) -> f64| -> Vec<_> {
            let each = counts.followed.iter();
            each.map(|(path, followed)| (format!("{{recording=\"{}\"}}", escaped(path)), of(followed))).collect()
        };
        metric("lag_bytes", "gauge", "Recorded and not read yet; an open chunk is not whole yet.", &lag(&behind));
        metric("lag_seconds", "gauge", "For how long something recorded has not been read.", &lag(&seconds));
        out
    }

    fn lock(&self) -> MutexGuard<'_, Counts> {
        // The numbers are valid even if a thread panicked while it held the lock.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Counts {
    fn followed(&mut self, recording: &Path) -> &mut FollowedCounts {
        self.followed.entry(recording.to_owned()).or_default()
    }

    /// Counts the progress of a recording, as far as it is new.
    fn reach(&mut self, recording: &Path, rests: u64, read: u64) {
        let followed = self.followed(recording);
        let (new_rests, new_bytes) = (rests.saturating_sub(followed.rests), read.saturating_sub(followed.read));
        followed.rests = followed.rests.max(rests);
        if read >= followed.length {
            followed.behind = None;
        } else if new_bytes > 0 || followed.behind.is_none() {
            followed.behind = Some(Instant::now());
        }
        followed.read = followed.read.max(read);
        self.rests += new_rests;
        self.bytes += new_bytes;
    }
}

/// A path as a label value.
fn escaped(path: &Path) -> String {
    printable(&path.display().to_string()).replace('\\', "\\\\").replace('"', "\\\"")
}
