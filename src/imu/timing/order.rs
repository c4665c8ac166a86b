//! Readings of one IMU, sorted by stamp if they arrive a little late.
//!
//! Readings are held back at the beginning, so that the first late ones are not lost. Once [`CALM`] readings have
//! arrived in order, over twice the allowed delay or more, none is held back until one is late.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::read::Read;
use super::strays::MOST_HELD;
use crate::imu::sample::{Reading, Sample};
use crate::plural::counted;

/// Number of readings in order after which none is held back any more.
const CALM: u32 = 200;
/// Number of consecutive readings beyond the allowed delay that show that the clock was set back.
const PATIENCE: u32 = 5;

/// Queue that holds readings back until all earlier ones must have arrived.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Order {
    late_nanos: i64,
    holds: bool,
    /// Whether a reading was ever late.
    ever: bool,
    calm: u32,
    /// First stamp, ns.
    first: Option<i64>,
    /// Queues by sensor.
    queues: Vec<HeldBack>,
    count: u64,
    /// Largest log time released so far: no result was known earlier.
    log_time: u64,
    moved: u64,
    lost: u64,
}

/// Held readings of one sensor, in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct HeldBack {
    /// Latest stamp, ns.
    newest: Option<i64>,
    behind: u32,
    /// Stamp in ns, number of the reading, and the reading.
    held: VecDeque<(i64, u64, Read)>,
}

impl Order {
    pub(super) fn new(late_nanos: i64) -> Self {
        Self {
            late_nanos,
            holds: late_nanos > 0,
            ever: false,
            calm: 0,
            first: None,
            queues: Vec::new(),
            count: 0,
            log_time: 0,
            moved: 0,
            lost: 0,
        }
    }

    /// Adds a reading.
    pub(super) fn pass(&mut self, read: Read, sink: &mut impl FnMut(Read)) {
        let (_, sensor, reading) = read;
        if self.queues.len() <= sensor.index() {
            self.queues.resize_with(sensor.index() + 1, HeldBack::default);
        }
        let Some(queue) = self.queues.get_mut(sensor.index()) else { return };
        let stamp = reading.stamp().nanos();
        let newest = queue.newest.unwrap_or(stamp);
        let late = newest.saturating_sub(stamp);
        if late > self.late_nanos {
            // Not late, but a different time: no held reading belongs after it.
            queue.behind += 1;
            if queue.behind >= PATIENCE {
                (queue.newest, queue.behind) = (Some(stamp), 0);
            }
            self.let_go(None, sink);
            return self.tell(read, sink);
        }
        queue.behind = 0;
        queue.newest = Some(newest.max(stamp));
        if late > 0 {
            match self.holds {
                true => self.moved += u64::from(matches!(reading, Reading::Sample(_))),
                false => self.lost += 1,
            }
            (self.ever, self.holds, self.calm) = (true, self.late_nanos > 0, 0);
        }
        if !self.holds {
            return self.tell(read, sink);
        }
        self.count += 1;
        let at = queue.held.iter().rposition(|&(held, ..)| held <= stamp).map_or(0, |at| at + 1);
        queue.held.insert(at, (stamp, self.count, read));
        let until = match queue.held.len() > MOST_HELD {
            true => newest,
            false => newest.max(stamp).saturating_sub(self.late_nanos),
        };
        self.calm += 1;
        let first = *self.first.get_or_insert(stamp);
        let is_long = newest.max(stamp).saturating_sub(first) >= self.late_nanos.saturating_mul(2);
        if self.calm >= CALM && is_long && !self.ever {
            self.holds = false;
            return self.let_go(None, sink);
        }
        self.let_go(Some(until), sink);
    }

    /// Releases all held readings at the end of the recording.
    pub(super) fn finish(&mut self, sink: &mut impl FnMut(Read)) {
        self.let_go(None, sink);
    }

    /// Description of the corrections.
    pub(super) fn remark(&self) -> Option<String> {
        let ms = (self.late_nanos as f64 * 1e-3).round() / 1e3;
        (self.moved + self.lost > 0).then(|| {
            let lost = match self.lost {
                0 => String::new(),
                lost => format!(", but for {} before any was expected to be late", counted(lost, "reading")),
            };
            let moved = counted(self.moved, "reading");
            format!("{moved} came late by up to {ms} ms (still.late_s) and were sorted in{lost}")
        })
    }

    /// Releases readings up to a stamp, in order, or all of them.
    fn let_go(&mut self, until: Option<i64>, sink: &mut impl FnMut(Read)) {
        loop {
            let front = |queue: &HeldBack| queue.held.front().map(|&(stamp, number, _)| (stamp, number));
            let heads = self.queues.iter().enumerate().filter_map(|(i, queue)| Some((front(queue)?, i)));
            let Some(((stamp, _), i)) = heads.min() else { return };
            if until.is_some_and(|until| stamp > until) {
                return;
            }
            let Some((.., read)) = self.queues.get_mut(i).and_then(|queue| queue.held.pop_front()) else { return };
            self.tell(read, sink);
        }
    }

    fn tell(&mut self, (imu, sensor, reading): Read, sink: &mut impl FnMut(Read)) {
        let reading = match reading {
            Reading::Sample(sample) if self.ever => {
                self.log_time = self.log_time.max(sample.log_time);
                Reading::Sample(Sample { log_time: self.log_time, ..sample })
            }
            reading => reading,
        };
        sink((imu, sensor, reading));
    }
}
