//! First messages of a channel, held until the pace of their stamps is known: stamps in another unit than their field's
//! run thousands of times slower or faster than the log.

use serde::{Deserialize, Serialize};

use super::read::Read;

/// Pace of stamps against the log times beside them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Pace {
    /// About that of the log, or nothing can be said.
    Usual,
    /// The log times are those of writing, by a converter: they say nothing of the stamps.
    Written,
    /// 1000 to this power times that of the log.
    Thousands(i32),
}

/// Message with the stamp of its readings, ns, and its log time.
pub(super) type Stamped = (i64, u64, Vec<Read>);

/// Messages until the pace is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Opening {
    held: Vec<Stamped>,
}

/// Factor within which stamps and log go alike.
const ALIKE: f64 = 30.0;
/// Factor within which stamps go as in another unit.
const NEAR: f64 = 2.0;
/// Time of the log after which stamps that go like it are believed, or number of messages: several may be logged at once.
const BRIEF: i64 = 50_000_000;
const MOST_IN_BRIEF: usize = 256;
/// Time of the log after which another pace is known, ns …
const ENOUGH: i64 = 500_000_000;
/// … or, where hardly a stamp differs from the last: the coarsest clocks count whole seconds.
const LONG: i64 = 2_500_000_000;
/// Steps between messages of a sensor, ns; a log that goes faster is of the times of writing.
const FASTEST: i64 = 100_000;
const SLOWEST: i64 = 1_000_000_000;
/// Number of messages that tell of it.
const FEW: usize = 16;
/// Largest part of the log's time that makes hardly a difference.
const HARDLY: f64 = 1e-7;
/// Largest number of held messages, and that of messages logged at once.
const MOST: usize = 4096;
const MOST_AT_ONCE: usize = 64;

impl Opening {
    pub(super) fn hold(&mut self, stamp: i64, log_time: u64, readings: &[Read]) {
        self.held.push((stamp, log_time, readings.to_vec()));
    }

    /// Takes the held messages.
    pub(super) fn take(&mut self) -> Vec<Stamped> {
        std::mem::take(&mut self.held)
    }

    /// Pace of the held messages; `None` until there are enough of them.
    pub(super) fn pace(&self) -> Option<Pace> {
        let count = self.held.len();
        // Sorting for each message would take long.
        if count < 2 || count > 16 && !count.is_multiple_of(16) {
            return None;
        }
        let stamped = span(self.held.iter().map(|(stamp, ..)| *stamp).collect());
        let logged = span(self.held.iter().map(|(_, log, _)| i64::try_from(*log).unwrap_or(i64::MAX)).collect());
        if logged == 0 {
            return (count >= MOST_AT_ONCE).then_some(Pace::Written);
        }
        let step = |span: i64| span / count as i64;
        if step(logged) < FASTEST && (FASTEST..SLOWEST).contains(&step(stamped)) {
            return (count >= FEW).then_some(Pace::Written);
        }
        let ratio = stamped as f64 / logged as f64;
        let is_known = logged >= if ratio > HARDLY { ENOUGH } else { LONG };
        if (1.0 / ALIKE..ALIKE).contains(&ratio) {
            return (logged >= BRIEF || count >= MOST_IN_BRIEF).then_some(Pace::Usual);
        }
        match is_known {
            true => Some(of(ratio)),
            false => (count >= MOST).then_some(Pace::Usual),
        }
    }

    /// Pace of all messages at the end of the recording.
    pub(super) fn last_pace(&self) -> Pace {
        let stamped = span(self.held.iter().map(|(stamp, ..)| *stamp).collect());
        let logged = span(self.held.iter().map(|(_, log, _)| i64::try_from(*log).unwrap_or(i64::MAX)).collect());
        if logged < ENOUGH { Pace::Usual } else { of(stamped as f64 / logged as f64) }
    }
}

/// Pace of a ratio of times.
fn of(ratio: f64) -> Pace {
    if ratio <= 0.0 {
        return Pace::Usual;
    }
    let decades = libm::log10(ratio);
    let power = libm::rint(decades / 3.0);
    match (decades - 3.0 * power).abs() < libm::log10(NEAR) && power != 0.0 {
        true => Pace::Thousands(power as i32),
        false => Pace::Usual,
    }
}

/// Span of times without the outermost ones, a tenth at each end, so that single wrong ones do not count.
fn span(mut times: Vec<i64>) -> i64 {
    times.sort_unstable();
    let trimmed = times.len() / 10;
    let [first, last] =
        [times.get(trimmed), times.get(times.len().saturating_sub(trimmed + 1))].map(Option::<&i64>::copied);
    last.unwrap_or_default().saturating_sub(first.unwrap_or_default())
}
