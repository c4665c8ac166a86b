//! Channels of one IMU that stand one after the other in a file, as some converters write them.
//!
//! The first pass over a recording finds them, a second one [merges](super::time_merge) their messages. The log times tell
//! the order, or the stamps, where a converter logged each message at the time of writing.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::Stamp;

/// Lag behind another channel beyond which a message is not merely late, ns of log time.
const APART: u64 = 1_000_000_000;
/// Number of such messages in a row, while the other channel is silent, that shows channels apart. A clock that was set
/// back affects both channels.
const IN_A_ROW: u32 = 50;
/// Fewest messages of a channel whose place in the file counts.
const LEAST: u64 = 50;
/// Sign that accelerometer and gyroscope stand apart, in the words of the remarks.
pub(super) const BEHIND: &str = "accelerometer and gyroscope of an IMU stand one behind the other in the file";

/// Finds channels that are apart.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct TimeOrder {
    /// Groups by source of an IMU.
    groups: BTreeMap<usize, Group>,
    apart: BTreeSet<u16>,
    /// Place and time of each channel.
    spans: BTreeMap<u16, Span>,
    /// Number of messages whose stamps were noted.
    count: u64,
}

/// Channels that follow each other in a file, and the clock that tells their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Apart {
    pub(super) channels: BTreeSet<u16>,
    pub(super) clock: Clock,
}

/// Clock of the order of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clock {
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

impl TimeOrder {
    /// Channels that were found apart, of IMUs with these channels.
    pub(crate) fn apart(&self, parts: impl Iterator<Item = BTreeSet<u16>>) -> Option<Apart> {
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

    /// Remark on times that no order corrects, for IMUs with these channels.
    pub(crate) fn remark(&self, parts: impl Iterator<Item = BTreeSet<u16>>) -> Option<String> {
        self.behind(parts).any(|(_, common)| !common).then(|| {
            format!(
                "{BEHIND}, and in its times: none of one is from the time of the other. If a converter wrote them so, \
                 convert again with the sensor's time as header.stamp or log time"
            )
        })
    }

    /// Notes a message of a channel that these sources read.
    pub(crate) fn watch(&mut self, sources: impl Iterator<Item = usize>, channel: u16, log_time: u64) {
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
        self.count += 1;
        let span = self.spans.entry(channel);
        let Span { place, messages, time } =
            span.or_insert(Span { place: (self.count, 0), messages: 0, time: (stamp, stamp) });
        place.1 = self.count;
        *messages += 1;
        *time = (time.0.min(stamp), time.1.max(stamp));
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

    /// Channels that are apart by their stamps, and whether nothing can be done.
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
}
