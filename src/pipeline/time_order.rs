//! Time order of one IMU's messages, for files that hold one channel after the other, as some converters write them.
//!
//! A first pass finds the channels that are apart; a second one holds their messages until the other channels have
//! caught up. The log times tell the order, or the stamps, where a converter logged each message at the time of writing.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::record::Message;

/// Lag behind another channel beyond which a message is not merely late, ns of log time.
const APART: u64 = 1_000_000_000;
/// Number of such messages in a row, while the other channel is silent, that shows channels apart. A clock that was set
/// back affects both channels.
const IN_A_ROW: u32 = 50;
/// Fewest messages of a channel whose place in the file counts.
const LEAST: u64 = 50;
/// Most bytes held (48 MiB).
const MOST: usize = 48 << 20;

/// Finds channels that are apart, or merges them.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct TimeOrder {
    /// Groups by source of an IMU.
    groups: BTreeMap<usize, Group>,
    apart: BTreeSet<u16>,
    /// Place and time of each channel.
    spans: BTreeMap<u16, Span>,
    /// Channels to merge, with the latest time of each.
    merging: BTreeMap<u16, u64>,
    clock: Clock,
    held: BTreeMap<(u64, u64), Held>,
    bytes: usize,
    count: u64,
    gave_up: bool,
}

/// Channels that follow each other in a file, and the clock that tells their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Apart {
    channels: BTreeSet<u16>,
    clock: Clock,
}

/// Clock of the order of messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Clock {
    #[default]
    LogTimes,
    Stamps,
}

/// Messages of one channel.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Span {
    /// Numbers of the first and the last message.
    place: (u64, u64),
    messages: u64,
    /// Earliest and latest stamp.
    time: (Stamp, Stamp),
}

/// Channels of one IMU.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Group {
    last: BTreeMap<u16, u64>,
    /// Channel of the last message, and its number of consecutive messages far behind the other channels.
    behind: (u16, u32),
}

/// A held message.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Held {
    channel: u16,
    sequence: u32,
    log_time: u64,
    publish_time: u64,
    data: Vec<u8>,
}

impl Held {
    pub(crate) fn message(&self) -> Message<'_> {
        let Self { channel, sequence, log_time, publish_time, ref data } = *self;
        Message { channel, sequence, log_time, publish_time, data }
    }
}

impl TimeOrder {
    /// Order that merges these channels.
    pub(crate) fn merging(Apart { channels, clock }: Apart) -> Self {
        Self { merging: channels.into_iter().map(|channel| (channel, 0)).collect(), clock, ..Self::default() }
    }

    /// Channels that were found apart, of IMUs with these channels, unless channels are merged.
    pub(crate) fn apart(&self, parts: impl Iterator<Item = BTreeSet<u16>>) -> Option<Apart> {
        if !self.merging.is_empty() {
            return None;
        }
        if !self.apart.is_empty() {
            return Some(Apart { channels: self.apart.clone(), clock: Clock::LogTimes });
        }
        let channels: BTreeSet<_> =
            self.behind(parts).filter(|(_, common)| *common).flat_map(|(part, _)| part).collect();
        (!channels.is_empty()).then_some(Apart { channels, clock: Clock::Stamps })
    }

    /// Pairs of channels of one IMU, one wholly behind the other in the file, and whether their stamps have a time in
    /// common.
    fn behind(&self, parts: impl Iterator<Item = BTreeSet<u16>>) -> impl Iterator<Item = ([u16; 2], bool)> {
        let span = |channel: u16| self.spans.get(&channel).filter(|span| span.messages >= LEAST);
        let pairs = parts.flat_map(|part| {
            let with = |&one: &u16| part.iter().filter(move |&&other| one < other).map(move |&other| [one, other]);
            part.iter().flat_map(with).collect::<Vec<_>>()
        });
        pairs.filter_map(move |[one, other]| {
            let (a, b) = (span(one)?, span(other)?);
            let is_behind = a.place.1 < b.place.0 || b.place.1 < a.place.0;
            let common = a.time.1.min(b.time.1).since(a.time.0.max(b.time.0));
            is_behind.then_some(([one, other], common > APART as i64))
        })
    }

    /// Description of the corrections, or of what cannot be corrected, for IMUs with these channels.
    pub(crate) fn remark(&self, parts: impl Iterator<Item = BTreeSet<u16>>) -> Option<String> {
        const BEHIND: &str = "accelerometer and gyroscope of an IMU stand one behind the other in the file";
        let order = match self.clock {
            Clock::LogTimes => "log times",
            Clock::Stamps => "stamps (the log times are those of writing)",
        };
        if self.merging.is_empty() {
            let apart = self.behind(parts).any(|(_, common)| !common);
            return apart.then(|| {
                format!(
                    "{BEHIND}, and in its times: none of one is from the time of the other. If a converter wrote them so, \
                     convert again with the sensor's time as header.stamp or log time"
                )
            });
        }
        Some(match (self.gave_up, self.clock) {
            (false, _) => format!("{BEHIND}: read in the order of their {order}"),
            (true, Clock::LogTimes) => format!(
                "{BEHIND}, too far apart to be held in memory: sort it first, with `mcap sort RECORDING -o SORTED`"
            ),
            (true, Clock::Stamps) => format!(
                "{BEHIND}, too far apart to be held in memory, and the log times are those of writing: convert again with the \
                 sensor's time as log time, then `mcap sort RECORDING -o SORTED`"
            ),
        })
    }

    /// Notes a message of a channel that these sources read.
    pub(crate) fn watch(&mut self, sources: impl Iterator<Item = usize>, channel: u16, log_time: u64) {
        if !self.merging.is_empty() {
            return;
        }
        for source in sources {
            let Group { last, behind } = self.groups.entry(source).or_default();
            let goes_on = last.insert(channel, log_time).is_none_or(|before| before <= log_time);
            if last.len() < 2 {
                continue;
            }
            let is_far = |(&other, &at): (&u16, &u64)| other != channel && at > log_time.saturating_add(APART);
            let is_behind = goes_on && last.iter().any(is_far);
            *behind = match (is_behind, behind.0 == channel) {
                (true, true) => (channel, behind.1 + 1),
                (is_behind, _) => (channel, u32::from(is_behind)),
            };
            if behind.1 == IN_A_ROW {
                self.apart.extend(last.keys());
            }
        }
    }

    /// Notes the stamp of a message of a channel that is used.
    pub(crate) fn watch_stamp(&mut self, channel: u16, stamp: Stamp) {
        if !self.merging.is_empty() {
            return;
        }
        self.count += 1;
        let span = self.spans.entry(channel);
        let Span { place, messages, time } =
            span.or_insert(Span { place: (self.count, 0), messages: 0, time: (stamp, stamp) });
        place.1 = self.count;
        *messages += 1;
        *time = (time.0.min(stamp), time.1.max(stamp));
    }

    /// Whether messages of a channel must be [held](Self::hold).
    pub(crate) fn holds(&self, channel: u16) -> bool {
        !self.gave_up && self.merging.contains_key(&channel)
    }

    /// Holds a message of this stamp, if it has one. Those whose turn has come are returned by [`next`](Self::next).
    pub(crate) fn hold(&mut self, message: &Message<'_>, stamp: impl FnOnce() -> Option<Stamp>) {
        let Message { channel, sequence, log_time, publish_time, data } = *message;
        let newest = self.merging.get(&channel).copied().unwrap_or_default();
        let time = match self.clock {
            Clock::LogTimes => log_time,
            // A message that cannot be read has no other time than the one before it.
            Clock::Stamps => stamp().map_or(newest, |stamp| u64::try_from(stamp.nanos()).unwrap_or_default()),
        };
        self.merging.insert(channel, time.max(newest));
        self.count += 1;
        self.bytes += data.len() + 64;
        self.held.insert((time, self.count), Held { channel, sequence, log_time, publish_time, data: data.to_vec() });
        self.gave_up |= self.bytes > MOST;
    }

    /// Next message that no other can precede.
    pub(crate) fn next(&mut self) -> Option<Held> {
        let until = self.merging.values().min().copied().unwrap_or_default();
        let ((time, _), _) = self.held.first_key_value()?;
        if *time > until && !self.gave_up { None } else { self.pop() }
    }

    /// Next message, once no more arrive.
    pub(crate) fn pop(&mut self) -> Option<Held> {
        let (_, held) = self.held.pop_first()?;
        self.bytes -= held.data.len() + 64;
        Some(held)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apart(messages: impl IntoIterator<Item = (u16, u64)>) -> bool {
        let mut order = TimeOrder::default();
        messages.into_iter().for_each(|(channel, ms)| order.watch([0].into_iter(), channel, ms * 1_000_000));
        order.apart(std::iter::empty()).is_some()
    }

    /// Which channels are apart by their stamps, and whether nothing can be done.
    fn by_stamps(messages: impl IntoIterator<Item = (u16, i64)>) -> (Option<Apart>, bool) {
        let mut order = TimeOrder::default();
        for (channel, ms) in messages {
            order.watch_stamp(channel, Stamp::from_nanos(ms * 1_000_000));
        }
        let parts = || std::iter::once(BTreeSet::from([1, 2]));
        (order.apart(parts()), order.remark(parts()).is_some())
    }

    #[test]
    fn channels_that_were_logged_as_they_were_written_stand_apart_by_their_stamps() {
        let run = |channel: u16, from: i64| (0..600).map(move |i| (channel, from + 10 * i));
        let both = Apart { channels: [1, 2].into(), clock: Clock::Stamps };
        assert_eq!(by_stamps(run(1, 0).chain(run(2, 3))), (Some(both), false));
        assert_eq!(by_stamps((0..600).flat_map(|i| [(1, 10 * i), (2, 10 * i + 3)])), (None, false));
        assert_eq!(by_stamps(run(1, 0).chain(run(2, 0)).chain(run(1, 6000))), (None, false));
        // Stamps of writing: no order brings them together.
        assert_eq!(by_stamps(run(1, 0).chain(run(2, 6000))), (None, true));
        // Of another IMU.
        assert_eq!(by_stamps(run(1, 0).chain(run(3, 3))), (None, false));
    }

    #[test]
    fn channels_one_behind_the_other_stand_apart_and_a_clock_that_was_set_back_does_not() {
        let run = |channel: u16| (0..600).map(move |i| (channel, 10 * i));
        assert!(apart(run(1).chain(run(2))));
        let beside = || (0..600).flat_map(|i| [(1, 10 * i), (2, 10 * i + 3)]);
        assert!(!apart(beside()));
        assert!(!apart(beside().chain(beside())));
        let batches =
            (0..5).flat_map(|s| [1, 2].into_iter().flat_map(move |c| (0..200).map(move |i| (c, 2000 * s + 10 * i))));
        assert!(apart(batches));
    }

    #[test]
    fn merged_messages_come_in_the_order_of_their_log_times() {
        let mut order = TimeOrder::merging(Apart { channels: [1, 2].into(), clock: Clock::LogTimes });
        let mut told = Vec::new();
        for (channel, log_time) in [(1, 10), (1, 20), (1, 30), (2, 5), (2, 20), (2, 25)] {
            order.hold(&Message { channel, sequence: 0, log_time, publish_time: 0, data: &[7] }, || None);
            while let Some(held) = order.next() {
                told.push((held.message().log_time, held.message().channel));
            }
        }
        assert_eq!(told, [(5, 2), (10, 1), (20, 1), (20, 2), (25, 2)]);
        assert_eq!(order.pop().map(|held| held.message().log_time), Some(30));
    }

    #[test]
    fn messages_logged_as_they_were_written_are_merged_by_their_stamps() {
        let mut order = TimeOrder::merging(Apart { channels: [1, 2].into(), clock: Clock::Stamps });
        let mut told = Vec::new();
        let stamps = [(1, Some(10)), (1, None), (1, Some(30)), (2, Some(5)), (2, Some(20)), (2, Some(25))];
        for (log_time, (channel, stamp)) in (0..).zip(stamps) {
            let message = Message { channel, sequence: 0, log_time, publish_time: 0, data: &[7] };
            order.hold(&message, || stamp.map(Stamp::from_nanos));
            while let Some(held) = order.next() {
                told.push(held.message().log_time);
            }
        }
        assert_eq!(told, [3, 0, 1, 4, 5]);
    }
}
