//! Messages whose stamps do not go on from those before, held until the next ones tell what they are: single wrong
//! stamps, readings that come late, or a clock that was set.

use serde::{Deserialize, Serialize};

use super::log_interval::since;
use super::read::Read;

/// Largest excess of a stamp's step over the log time's, ns. More contradicts the log time.
pub(super) const AHEAD: i64 = 500_000_000;
/// Longest step that is believed at once, whatever the log says, ns.
const FAR: i64 = 10_000_000_000;
/// Largest lateness of a reading, ns: the largest `still.late_s`.
const LATEST: i64 = 10_000_000_000;
/// Number of messages in a row that show that the clock was set.
const PATIENCE: usize = 5;
/// Number of messages without an order among them that show that stamps make no sense.
const SENSELESS: usize = 16;
/// Largest number of messages, or readings of a sensor, that are held at once.
pub(super) const MOST_HELD: usize = 1 << 14;

/// Point of a channel's course: a stamp, ns, and the log time beside it.
pub(super) type Point = (i64, u64);

/// Message off the course.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Stray {
    /// Stamp as recorded, and unwrapped, ns.
    pub(super) recorded: i64,
    pub(super) stamp: i64,
    pub(super) log_time: u64,
    pub(super) readings: Vec<Read>,
}

/// Held messages off the course, in the order of their arrival.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Strays {
    held: Vec<Stray>,
}

/// Verdict on the held messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Course {
    /// Not yet known.
    Unknown,
    /// A new course from the message at this index on, as when the clock was set.
    New(usize),
    /// No course at all.
    Senseless,
}

impl Stray {
    fn point(&self) -> Point {
        (self.stamp, self.log_time)
    }

    /// Lateness behind the newest stamp, ns, if it can be late.
    pub(super) fn lateness(&self, newest: i64) -> Option<i64> {
        let late = newest.saturating_sub(self.stamp);
        // A stamp of 0 was not set.
        ((1..=LATEST).contains(&late) && self.recorded != 0).then_some(late)
    }
}

/// Whether a point goes on from the one before, after steps of about this length, ns.
pub(super) fn goes_on(before: Point, now: Point, step: i64, late_nanos: i64) -> bool {
    let (interval, logged) = (now.0.saturating_sub(before.0), since(now.1, before.1));
    (-late_nanos.max(1)..=logged.saturating_add(AHEAD)).contains(&interval)
        && interval <= FAR.max(step.saturating_mul(5))
}

/// Whether stamps go from one point to the next as the log does, however far.
pub(super) fn agrees(before: Point, now: Point) -> bool {
    let (interval, logged) = (now.0.saturating_sub(before.0), since(now.1, before.1));
    interval > 0 && interval.saturating_sub(logged).saturating_abs() <= AHEAD
}

impl From<Vec<Stray>> for Strays {
    fn from(held: Vec<Stray>) -> Self {
        Self { held }
    }
}

impl Strays {
    pub(super) fn is_empty(&self) -> bool {
        self.held.is_empty()
    }

    pub(super) fn take(&mut self) -> Vec<Stray> {
        std::mem::take(&mut self.held)
    }

    /// Index of the first of those that are a course of their own at the end of a recording, if they are: more than come late
    /// at once.
    pub(super) fn ends_in_course(&self, step: i64, late_nanos: i64) -> Option<usize> {
        let pairs = self.held.windows(2).rev();
        let ordered = pairs.take_while(|pair| goes_on(pair[0].point(), pair[1].point(), step, late_nanos)).count();
        (ordered >= 4 * PATIENCE).then(|| self.held.len() - 1 - ordered)
    }

    /// Holds a message, and tells what those that are held are, by the last point of the course so far.
    pub(super) fn hold(&mut self, stray: Stray, last: Point, step: i64, late_nanos: i64) -> Course {
        self.held.push(stray);
        let pairs = self.held.windows(2).rev();
        let ordered = pairs.take_while(|pair| goes_on(pair[0].point(), pair[1].point(), step, late_nanos)).count();
        let first = self.held.len() - 1 - ordered;
        let (Some(begun), Some(now)) = (self.held.get(first), self.held.last()) else { return Course::Unknown };
        let is_new = ordered + 1 >= PATIENCE
            && begun.lateness(last.0).is_none_or(|late| {
                // A clock that was set back stays behind; readings that come late are few, or come at once.
                let passed = match since(now.log_time, last.1) {
                    ..=0 => now.stamp.saturating_sub(begun.stamp),
                    _ => since(now.log_time, begun.log_time),
                };
                passed >= late / 5 * 4 || self.held.len() >= MOST_HELD
            });
        if is_new {
            return Course::New(first);
        }
        let wrong = self.held.iter().filter(|stray| stray.lateness(last.0).is_none()).count();
        if wrong >= SENSELESS || self.held.len() >= MOST_HELD { Course::Senseless } else { Course::Unknown }
    }
}
