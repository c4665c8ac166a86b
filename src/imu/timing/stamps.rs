//! Stamps of the messages of one channel, where they stand, wrap or make no sense.
//!
//! A reading under a stamp that has been is a repeat if it reads the same. If it does not, the clock is coarse or stuck, or
//! a batch was stamped at once: the readings under one stamp are spread over the step to the next one, and where that
//! does not come, the log time serves from there on.

use serde::{Deserialize, Serialize};

use super::read::Read;
use crate::Stamp;
use crate::imu::sample::{Reading, Sample};

/// A clock that stands for longer is stuck, ns: whole seconds are the coarsest that is met.
const STUCK: i64 = 2_500_000_000;
/// Messages under one stamp beyond which they are not held back.
const MOST_HELD: usize = 1 << 14;
/// Stamps that contradict the log time this often, and once in so many messages, make no sense.
const SENSELESS: u64 = 5;
const SENSELESS_ONCE_IN: u64 = 2000;
/// A stamp that runs ahead of the log time by more contradicts it, ns.
const AHEAD: i64 = 500_000_000;
/// Counters of 32 bits wrap after so many nanoseconds: of milliseconds, microseconds, nanoseconds.
const WRAPS: [i64; 3] = [(1 << 32) * 1_000_000, (1 << 32) * 1000, 1 << 32];

/// Follows the stamps of one IMU on one channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Stamps {
    /// What was lost by wrapping.
    wrapped: i64,
    /// As it stands in the last message, and the log time of that.
    last: Option<(i64, u64)>,
    /// The first message under the present stamp, and what followed it under the same.
    first: Vec<Read>,
    /// Stamp and log time of that message.
    begun: (i64, u64),
    held: Vec<(u64, Vec<Read>)>,
    /// Repeats of the first that were not held.
    repeated: u64,
    differ: bool,
    /// The last step between two stamps.
    step: i64,
    /// Stamp and log time from which on the log time serves.
    by_log: Option<(i64, u64)>,
    senseless: u64,
    messages: u64,
    counts: StampCounts,
}

/// What was done, in messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct StampCounts {
    repeats: u64,
    spread: u64,
    logged: u64,
    wraps: u64,
}

impl Stamps {
    /// Takes the readings of one message, all of one stamp.
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

    /// The recording has ended.
    pub(super) fn finish(&mut self, sink: &mut impl FnMut(Read)) {
        let (stamp, log) = self.begun;
        let last = self.held.last().map_or(log, |(log, _)| *log);
        let step = if self.step > 0 { self.step } else { since(last, log) };
        self.leave(stamp.saturating_add(step), last, sink);
    }

    /// What was done, one line each.
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

    /// Another message under the stamp of the one before.
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
            // A sensor that says the same for ever.
            true => self.repeated += 1,
            false => self.held.push((log_time, readings.to_vec())),
        }
    }

    /// The stamp has moved on: what was held back under the last one is spread up to this one, or was repeated.
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
        // Over a gap, as before; without any step before, as long as it took to record them.
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

    /// The stamp with what was lost by wrapping: it fell back by what a counter of 32 bits holds, and goes on as the log
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

/// Nanoseconds from one log time to another.
fn since(log_time: u64, log: u64) -> i64 {
    i64::try_from(i128::from(log_time) - i128::from(log)).unwrap_or(i64::MAX)
}

fn stamp_of(reading: &Reading) -> Option<Stamp> {
    match reading {
        Reading::Sample(Sample { stamp, .. }) => Some(*stamp),
        Reading::Clipped(_) | Reading::NewRound { .. } => None,
    }
}

/// Whether two messages read the same.
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
