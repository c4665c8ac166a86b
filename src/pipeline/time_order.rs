//! Time order of one IMU's messages, for files that hold one channel after the other, as some converters write them.
//!
//! A first pass finds the channels that are apart; a second one holds their messages until the other channels have
//! caught up.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::record::Message;

/// Lag behind another channel beyond which a message is not merely late, ns of log time.
const APART: u64 = 1_000_000_000;
/// Number of such messages in a row, while the other channel is silent, that shows channels apart. A clock that was set
/// back affects both channels.
const IN_A_ROW: u32 = 50;
/// Most bytes held (48 MiB).
const MOST: usize = 48 << 20;

/// Finds channels that are apart, or merges them.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct TimeOrder {
    /// Groups by source of an IMU.
    groups: BTreeMap<usize, Group>,
    apart: BTreeSet<u16>,
    /// Channels to merge, with the latest log time of each.
    merging: BTreeMap<u16, u64>,
    held: BTreeMap<(u64, u64), Held>,
    bytes: usize,
    count: u64,
    gave_up: bool,
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
    pub(crate) fn merging(channels: BTreeSet<u16>) -> Self {
        Self { merging: channels.into_iter().map(|channel| (channel, 0)).collect(), ..Self::default() }
    }

    /// Channels that were found apart, unless channels are merged.
    pub(crate) fn apart(&self) -> Option<BTreeSet<u16>> {
        (self.merging.is_empty() && !self.apart.is_empty()).then(|| self.apart.clone())
    }

    /// Description of the corrections.
    pub(crate) fn remark(&self) -> Option<String> {
        let text = match (self.merging.is_empty(), self.gave_up) {
            (true, _) => return None,
            (_, false) => {
                "accelerometer and gyroscope of an IMU stand one behind the other in the file: read in the order of their \
                 log times"
            }
            (_, true) => {
                "accelerometer and gyroscope of an IMU stand one behind the other in the file, too far apart to be held in \
                 memory: sort it first, with `mcap sort RECORDING -o SORTED`"
            }
        };
        Some(text.to_owned())
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

    /// Whether messages of a channel must be [held](Self::hold).
    pub(crate) fn holds(&self, channel: u16) -> bool {
        !self.gave_up && self.merging.contains_key(&channel)
    }

    /// Holds a message. Those whose turn has come are returned by [`next`](Self::next).
    pub(crate) fn hold(&mut self, message: &Message<'_>) {
        let Message { channel, sequence, log_time, publish_time, data } = *message;
        if let Some(newest) = self.merging.get_mut(&channel) {
            *newest = log_time.max(*newest);
        }
        self.count += 1;
        self.bytes += data.len() + 64;
        self.held
            .insert((log_time, self.count), Held { channel, sequence, log_time, publish_time, data: data.to_vec() });
        self.gave_up |= self.bytes > MOST;
    }

    /// Next message that no other can precede.
    pub(crate) fn next(&mut self) -> Option<Held> {
        let until = self.merging.values().min().copied().unwrap_or_default();
        let ((log_time, _), _) = self.held.first_key_value()?;
        if *log_time > until && !self.gave_up { None } else { self.pop() }
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
        order.apart().is_some()
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
        let mut order = TimeOrder::merging([1, 2].into());
        let mut told = Vec::new();
        for (channel, log_time) in [(1, 10), (1, 20), (1, 30), (2, 5), (2, 20), (2, 25)] {
            order.hold(&Message { channel, sequence: 0, log_time, publish_time: 0, data: &[7] });
            while let Some(held) = order.next() {
                told.push((held.message().log_time, held.message().channel));
            }
        }
        assert_eq!(told, [(5, 2), (10, 1), (20, 1), (20, 2), (25, 2)]);
        assert_eq!(order.pop().map(|held| held.message().log_time), Some(30));
    }
}
