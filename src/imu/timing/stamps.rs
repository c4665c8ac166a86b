//! Stamps of the messages of one channel that stand still, wrap, stray or are in another unit.
//!
//! A stamp that does not go on from those before it waits for the next ones. If these go on, it is a single wrong one,
//! which the log time replaces, or its reading is late. If they go on from it, the clock was set.
//!
//! A reading with a repeated stamp is a duplicate if its values are the same. If they differ, the clock is coarse or
//! stuck, or a batch was stamped at once: the readings with one stamp are spread over the step to the next stamp. If no
//! next stamp comes, the log time is used from there on.

use serde::{Deserialize, Serialize};

use super::log_interval::since;
use super::opening::{Opening, Pace, Stamped};
use super::read::Read;
use super::stamp_counts::StampCounts;
use super::strays::{AHEAD, Course, MOST_HELD, Point, Stray, Strays, agrees, goes_on};
use crate::Stamp;
use crate::imu::sample::{Reading, Sample};

/// Longest time for which a working clock stands still, ns: the coarsest known clocks count whole seconds.
const STUCK: i64 = 2_500_000_000;
/// Stamps are implausible if their course is broken this often, and in one of so many messages.
const SENSELESS: u64 = 5;
const SENSELESS_ONCE_IN: u64 = 2000;
/// Ranges of 32-bit counters of milliseconds, microseconds and nanoseconds, in ns.
const WRAPS: [i64; 3] = [(1 << 32) * 1_000_000, (1 << 32) * 1000, 1 << 32];

/// Tracker of the stamps of one IMU on one channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Stamps {
    opening: Opening,
    /// Pace of the stamps, once known.
    pace: Option<Pace>,
    /// Sum of all wraps so far, ns.
    wrapped: i64,
    /// Newest stamp of the course, unwrapped, ns, and its log time.
    last: Option<Point>,
    strays: Strays,
    /// Readings of the first message with the current stamp. Those of later messages with this stamp are in `held`.
    first: Vec<Read>,
    /// Stamp and log time of the first message.
    begun: Point,
    held: Vec<(u64, Vec<Read>)>,
    /// Number of repeats of the first message that were not held.
    repeated: u64,
    differ: bool,
    /// Last step between two stamps, ns.
    step: i64,
    /// Stamp and log time from which on stamps are computed from the log time.
    by_log: Option<Point>,
    senseless: u64,
    messages: u64,
    counts: StampCounts,
}

impl Stamps {
    /// Adds the readings of one message, all of one stamp.
    pub(super) fn pass(&mut self, log_time: u64, readings: &[Read], late_nanos: i64, sink: &mut impl FnMut(Read)) {
        let Some(stamp) = readings.iter().find_map(|(.., reading)| stamp_of(reading)) else { return };
        self.messages += 1;
        if self.pace.is_some() {
            return self.follow(stamp.nanos(), log_time, readings, late_nanos, sink);
        }
        self.opening.hold(stamp.nanos(), log_time, readings);
        if let Some(pace) = self.opening.pace() {
            self.open(pace, late_nanos, sink);
        }
    }

    /// Releases all held readings at the end of the recording.
    pub(super) fn finish(&mut self, late_nanos: i64, sink: &mut impl FnMut(Read)) {
        if self.pace.is_none() {
            self.open(self.opening.last_pace(), late_nanos, sink);
        }
        if let (Some(last), Some(first)) = (self.last, self.strays.ends_in_course(self.step, late_nanos)) {
            self.set(last, first, late_nanos, sink);
        }
        for stray in self.strays.take() {
            let stands = stray.stamp == self.begun.0 && !self.first.is_empty();
            match self.last.filter(|last| agrees(*last, (stray.stamp, stray.log_time))) {
                _ if stands => self.stand(stray.log_time, &stray.readings, sink),
                Some(_) => {
                    self.leave(stray.stamp, stray.log_time, sink);
                    self.advance(stray.stamp, stray.log_time, &stray.readings, sink);
                }
                None => self.leave_out(&stray),
            }
        }
        let (stamp, log) = self.begun;
        let last = self.held.last().map_or(log, |(log, _)| *log);
        let step = if self.step > 0 { self.step } else { since(last, log) };
        self.leave(stamp.saturating_add(step), last, sink);
    }

    /// Corrections, one line each.
    pub(super) fn remarks(&self, late_nanos: i64) -> impl Iterator<Item = String> {
        self.counts.remarks(self.messages, self.pace, late_nanos)
    }

    /// Begins the course, once the pace is known.
    fn open(&mut self, pace: Pace, late_nanos: i64, sink: &mut impl FnMut(Read)) {
        self.pace = Some(pace);
        let held = self.opening.take();
        if let (Pace::Thousands(_), Some((_, log, _))) = (pace, held.first()) {
            self.by_log = Some((Stamp::from_log_time(*log).nanos(), *log));
        }
        let point = |message: &Stamped| (message.0, message.1);
        let is_wrong = |pair: &&[Stamped]| !goes_on(point(&pair[0]), point(&pair[1]), 0, late_nanos);
        // A wrong stamp at the very beginning is none to go on from.
        let wrong = held.windows(2).take_while(is_wrong).count();
        let begin = if self.by_log.is_some() || wrong + 1 >= held.len() { 0 } else { wrong };
        let first = held.get(begin).map_or(0, |(stamp, ..)| *stamp);
        for (i, (stamp, log_time, readings)) in held.into_iter().enumerate() {
            if i < begin {
                self.counts.left_out += 1;
                self.counts.count_wrong(stamp.saturating_sub(first));
            } else {
                self.follow(stamp, log_time, &readings, late_nanos, sink);
            }
        }
    }

    /// Handles a message after the opening.
    fn follow(
        &mut self,
        recorded: i64,
        log_time: u64,
        readings: &[Read],
        late_nanos: i64,
        sink: &mut impl FnMut(Read),
    ) {
        if let Some((stamp, log)) = self.by_log {
            self.counts.logged += 1;
            return tell(readings, stamp.saturating_add(since(log_time, log)), sink);
        }
        let stamp = self.unwrapped(recorded, log_time);
        let stands = stamp == self.begun.0 && !self.first.is_empty();
        if let Some(last) = self.last.filter(|last| !stands && !self.goes_on(*last, (stamp, log_time), late_nanos)) {
            let stray = Stray { recorded, stamp, log_time, readings: readings.to_vec() };
            return match self.strays.hold(stray, last, self.step, late_nanos) {
                Course::Unknown => {}
                Course::New(first) => self.set(last, first, late_nanos, sink),
                Course::Senseless => self.give_up(last, sink),
            };
        }
        if !self.strays.is_empty() {
            self.pass_strays(stamp, sink);
        }
        match stands {
            true => self.stand(log_time, readings, sink),
            false => {
                self.leave(stamp, log_time, sink);
                self.advance(stamp, log_time, readings, sink);
            }
        }
    }

    /// Whether a message goes on from the last one. Log times of writing say nothing of it.
    fn goes_on(&self, last: Point, now: Point, late_nanos: i64) -> bool {
        let now = if self.pace == Some(Pace::Written) { (now.0, u64::MAX) } else { now };
        goes_on(last, now, self.step, late_nanos)
    }

    /// Passes a message on the course.
    fn advance(&mut self, stamp: i64, log_time: u64, readings: &[Read], sink: &mut impl FnMut(Read)) {
        match self.last {
            // It is late, and will be sorted in.
            Some((last, _)) if stamp < last => {}
            last => {
                self.step = last.map_or(0, |(last, _)| stamp.saturating_sub(last));
                self.last = Some((stamp, log_time));
            }
        }
        self.begun = (stamp, log_time);
        self.first.clear();
        self.first.extend_from_slice(readings);
        tell(readings, stamp, sink);
    }

    /// Handles the held messages off the course after it has gone on to `next`: each by itself is wrong, or late.
    fn pass_strays(&mut self, next: i64, sink: &mut impl FnMut(Read)) {
        let Some((last, log)) = self.last else { return };
        let mut before = last;
        for stray in self.strays.take() {
            let stamp = last.saturating_add(since(stray.log_time, log));
            if stray.lateness(last).is_none() && self.held.is_empty() && before < stamp && stamp < next {
                self.counts.count_wrong(stray.stamp.saturating_sub(last));
                before = stamp;
                tell(&stray.readings, stamp, sink);
            } else {
                self.leave_out(&stray);
            }
        }
    }

    fn leave_out(&mut self, stray: &Stray) {
        let newest = self.last.map(|(last, _)| last);
        match newest.and_then(|newest| stray.lateness(newest)) {
            Some(late) => self.counts.count_late(late),
            None => {
                self.counts.left_out += 1;
                self.counts.count_wrong(stray.stamp.saturating_sub(newest.unwrap_or(stray.stamp)));
            }
        }
    }

    /// Handles a clock that was set: the held messages from `first` on are a course of their own.
    fn set(&mut self, last: Point, first: usize, late_nanos: i64, sink: &mut impl FnMut(Read)) {
        let mut strays = self.strays.take();
        let course = strays.split_off(first);
        strays.iter().for_each(|stray| self.leave_out(stray));
        let Some(begun) = course.first().map(|stray| (stray.stamp, stray.log_time)) else { return };
        let is_pause = self.pace == Some(Pace::Written) && begun.0 > last.0;
        self.senseless += u64::from(!is_pause && !agrees(last, begun));
        if self.senseless >= SENSELESS && self.senseless * SENSELESS_ONCE_IN >= self.messages {
            self.strays = Strays::from(course);
            return self.give_up(last, sink);
        }
        self.leave(begun.0, begun.1, sink);
        self.last = None;
        for Stray { recorded, log_time, readings, .. } in course {
            self.follow(recorded, log_time, &readings, late_nanos, sink);
        }
    }

    /// Uses the log time from the held messages on.
    fn give_up(&mut self, (last, log): Point, sink: &mut impl FnMut(Read)) {
        self.leave(last.saturating_add(self.step), log, sink);
        self.by_log = Some((last, log));
        for Stray { log_time, readings, .. } in self.strays.take() {
            self.counts.logged += 1;
            tell(&readings, last.saturating_add(since(log_time, log)), sink);
        }
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
        let repeats = self.repeats(&held);
        self.counts.repeats += repeats.iter().filter(|repeats| **repeats).count() as u64;
        let fresh = (1..).zip(&held).zip(repeats).filter(|(_, repeats)| !repeats);
        for ((i, (_, readings)), _) in fresh {
            self.counts.spread += 1;
            tell(readings, stamp.saturating_add((i128::from(step) * i128::from(i) / i128::from(parts)) as i64), sink);
        }
    }

    /// Marks the held messages that repeat the one before them: a driver that is polled faster than its sensor measures repeats
    /// most, under a coarse clock, too. Fewer are chance.
    fn repeats(&self, held: &[(u64, Vec<Read>)]) -> Vec<bool> {
        let before = std::iter::once(&self.first).chain(held.iter().map(|(_, readings)| readings));
        let repeats: Vec<_> = held.iter().zip(before).map(|((_, readings), before)| same(before, readings)).collect();
        let count = repeats.iter().filter(|repeats| **repeats).count();
        if 2 * count > held.len() { repeats } else { vec![false; held.len()] }
    }

    /// Unwraps a stamp. A wrap is a fall by the range of a 32-bit counter after which the stamp continues as the log
    /// time does.
    fn unwrapped(&mut self, raw: i64, log_time: u64) -> i64 {
        let stamp = raw.saturating_add(self.wrapped);
        let Some((last, log)) = self.last.filter(|&(last, _)| stamp < last) else { return stamp };
        let logged = since(log_time, log);
        let goes_on = |wrap: i64| {
            let on = stamp.saturating_add(wrap).saturating_sub(last);
            (1..=1_000_000_000).contains(&on)
                && on.saturating_sub(logged).saturating_abs() < AHEAD
                && last - self.wrapped < wrap
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
