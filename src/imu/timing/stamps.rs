//! Stamps of the messages of one channel that stand still, wrap or are implausible.
//!
//! A reading with a repeated stamp is a duplicate if its values are the same. If they differ, the clock is coarse or
//! stuck, or a batch was stamped at once: the readings with one stamp are spread over the step to the next stamp. If no
//! next stamp comes, the log time is used from there on.

use serde::{Deserialize, Serialize};

use super::read::Read;
use crate::Stamp;
use crate::imu::sample::{Reading, Sample};

/// Longest time for which a working clock stands still, ns: the coarsest known clocks count whole seconds.
const STUCK: i64 = 2_500_000_000;
/// Largest number of held messages with one stamp.
const MOST_HELD: usize = 1 << 14;
/// Stamps are implausible if they contradict the log time this often, and in one of so many messages.
const SENSELESS: u64 = 5;
const SENSELESS_ONCE_IN: u64 = 2000;
/// Largest excess of a stamp's step over the log time's, ns. More contradicts the log time.
const AHEAD: i64 = 500_000_000;
/// Ranges of 32-bit counters of milliseconds, microseconds and nanoseconds, in ns.
const WRAPS: [i64; 3] = [(1 << 32) * 1_000_000, (1 << 32) * 1000, 1 << 32];

/// Tracker of the stamps of one IMU on one channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Stamps {
    /// Sum of all wraps so far, ns.
    wrapped: i64,
    /// Unwrapped stamp of the last message, ns, and its log time.
    last: Option<(i64, u64)>,
    /// Readings of the first message with the current stamp. Those of later messages with this stamp are in `held`.
    first: Vec<Read>,
    /// Stamp and log time of the first message.
    begun: (i64, u64),
    held: Vec<(u64, Vec<Read>)>,
    /// Number of repeats of the first message that were not held.
    repeated: u64,
    differ: bool,
    /// Last step between two stamps, ns.
    step: i64,
    /// Stamp and log time from which on stamps are computed from the log time.
    by_log: Option<(i64, u64)>,
    senseless: u64,
    messages: u64,
    counts: StampCounts,
}

/// Number of messages by kind of correction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct StampCounts {
    repeats: u64,
    spread: u64,
    logged: u64,
    wraps: u64,
}

impl Stamps {
    /// Adds the readings of one message, all of one stamp.
    pub(super) fn pass(&mut self, log_time: u64, readings: &[Read], late_nanos: i64, sink: &mut impl FnMut(Read)) {
        let Some(stamp) = readings.iter().find_map(|(.., reading)| stamp_of(reading)) else { return };
        self.messages += 1;
        if let Some((stamp, log)) = self.by_log {
            self.counts.logged += 1;
            return tell(readings, stamp.saturating_add(since(log_time, log)), sink);
        }
        let raw = self.unwrapped(stamp.nanos(), log_time);
        match self.last {
            Some((last, _)) if last == raw && !self.first.is_empty() => return self.stand(log_time, readings, sink),
            Some((last, log)) => {
                self.leave(raw, log_time, sink);
                let (interval, logged) = (raw.saturating_sub(last), since(log_time, log));
                if interval < -late_nanos.max(1) || interval > logged.saturating_add(AHEAD) {
                    self.senseless += 1;
                    if self.senseless >= SENSELESS && self.senseless * SENSELESS_ONCE_IN >= self.messages {
                        self.by_log = Some((last.saturating_add(logged), log_time));
                        self.counts.logged += 1;
                        return tell(readings, last.saturating_add(logged), sink);
                    }
                } else if interval > 0 {
                    self.step = interval;
                }
            }
            None => {}
        }
        self.last = Some((raw, log_time));
        self.begun = (raw, log_time);
        self.first.clear();
        self.first.extend_from_slice(readings);
        tell(readings, raw, sink);
    }

    /// Releases all held readings at the end of the recording.
    pub(super) fn finish(&mut self, sink: &mut impl FnMut(Read)) {
        let (stamp, log) = self.begun;
        let last = self.held.last().map_or(log, |(log, _)| *log);
        let step = if self.step > 0 { self.step } else { since(last, log) };
        self.leave(stamp.saturating_add(step), last, sink);
    }

    /// Corrections, one line each.
    pub(super) fn remarks(&self) -> impl Iterator<Item = String> {
        let StampCounts { repeats, spread, logged, wraps } = self.counts;
        let share = |count: u64| {
            format!("{count} of {} messages ({:.1} %)", self.messages, 100.0 * count as f64 / self.messages as f64)
        };
        let line = |count: u64, text: &str| (count > 0).then(|| format!("{} {text}", share(count)));
        [
            line(repeats, "repeat a reading under its stamp, and count once"),
            line(
                spread,
                "differ under one stamp: a coarse clock, or a batch; their times are spread up to the next stamp",
            ),
            line(logged, "have stamps that stand still or make no sense: their log time is used"),
            (wraps > 0).then(|| format!("the stamps are of 32 bits and wrapped {wraps} times: they are continued")),
        ]
        .into_iter()
        .flatten()
    }

    /// Handles another message with the same stamp.
    fn stand(&mut self, log_time: u64, readings: &[Read], sink: &mut impl FnMut(Read)) {
        let (stamp, log) = self.begun;
        self.differ |= !same(&self.first, readings);
        let is_full = self.held.len() >= MOST_HELD;
        if self.differ && (is_full || since(log_time, log) > STUCK) {
            for (log_time, readings) in std::mem::take(&mut self.held) {
                self.counts.logged += 1;
                tell(&readings, stamp.saturating_add(since(log_time, log)), sink);
            }
            self.counts.logged += 1;
            self.by_log = Some((stamp, log));
            return tell(readings, stamp.saturating_add(since(log_time, log)), sink);
        }
        match is_full {
            // A sensor that repeats the same reading forever.
            true => self.repeated += 1,
            false => self.held.push((log_time, readings.to_vec())),
        }
    }

    /// Handles the end of a stamp: the held readings are spread up to the next stamp, or dropped as duplicates.
    fn leave(&mut self, next: i64, log_time: u64, sink: &mut impl FnMut(Read)) {
        if self.held.is_empty() {
            return;
        }
        let held = std::mem::take(&mut self.held);
        let repeated = std::mem::take(&mut self.repeated);
        if !std::mem::take(&mut self.differ) {
            self.counts.repeats += held.len() as u64 + repeated;
            return;
        }
        let (stamp, log) = self.begun;
        let mut step = next.saturating_sub(stamp);
        // Over a gap, use the last step; without one, the time it took to record the readings.
        let usual = if self.step > 0 { self.step.saturating_mul(3) } else { since(log_time, log).max(1) };
        if step <= 0 || step > usual {
            step = if self.step > 0 { self.step } else { usual };
        }
        let parts = held.len() as i64 + 1;
        for (i, (_, readings)) in (1..).zip(&held) {
            self.counts.spread += 1;
            tell(readings, stamp.saturating_add((i128::from(step) * i128::from(i) / i128::from(parts)) as i64), sink);
        }
    }

    /// Unwraps a stamp. A wrap is a fall by the range of a 32-bit counter after which the stamp continues as the log
    /// time does.
    fn unwrapped(&mut self, raw: i64, log_time: u64) -> i64 {
        let stamp = raw.saturating_add(self.wrapped);
        let Some((last, log)) = self.last.filter(|&(last, _)| stamp < last) else { return stamp };
        let logged = since(log_time, log);
        let goes_on = |wrap: i64| {
            let on = stamp.saturating_add(wrap).saturating_sub(last);
            (1..=1_000_000_000).contains(&on) && (on - logged).abs() < AHEAD && last - self.wrapped < wrap
        };
        match WRAPS.into_iter().find(|&wrap| goes_on(wrap)) {
            Some(wrap) => {
                self.wrapped = self.wrapped.saturating_add(wrap);
                self.counts.wraps += 1;
                stamp.saturating_add(wrap)
            }
            None => stamp,
        }
    }
}

/// Nanoseconds from log time `log` to `log_time`.
fn since(log_time: u64, log: u64) -> i64 {
    i64::try_from(i128::from(log_time) - i128::from(log)).unwrap_or(i64::MAX)
}

fn stamp_of(reading: &Reading) -> Option<Stamp> {
    match reading {
        Reading::Sample(Sample { stamp, .. }) => Some(*stamp),
        Reading::Clipped(_) | Reading::NewRound { .. } => None,
    }
}

/// Whether the values of two messages are the same.
fn same(one: &[Read], other: &[Read]) -> bool {
    let values = |readings: &[Read]| {
        let value = |&(imu, sensor, reading): &Read| match reading {
            Reading::Sample(sample) => Some((imu, sensor, sample.value)),
            _ => None,
        };
        readings.iter().filter_map(value).collect::<Vec<_>>()
    };
    values(one) == values(other)
}

/// Passes readings on with another stamp.
fn tell(readings: &[Read], nanos: i64, sink: &mut impl FnMut(Read)) {
    let stamp = Stamp::from_nanos(nanos);
    for &(imu, sensor, reading) in readings {
        let reading = match reading {
            Reading::Sample(sample) => Reading::Sample(Sample { stamp, ..sample }),
            Reading::Clipped(_) => Reading::Clipped(stamp),
            Reading::NewRound { log_time, .. } => Reading::NewRound { stamp, log_time },
        };
        sink((imu, sensor, reading));
    }
}
