//! Messages of channels that stand [apart](super::time_order) in a file, in the order of their times.
//!
//! Messages are held until every other channel has caught up. What does not fit into memory lies in sorted runs on a
//! [`Shelf`]: an external merge sort (Knuth, The Art of Computer Programming 3, 5.4), so that any length of recording is
//! read in two passes.

mod sorted_runs;

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use self::sorted_runs::{AT_ONCE, Place, Run};
pub(crate) use self::sorted_runs::{Held, Shelf};
use super::time_order::{Apart, BEHIND, Clock};
use crate::record::Message;
use crate::{Error, Stamp};

/// Most bytes held in memory (48 MiB).
const MOST: usize = 48 << 20;
/// Merges the messages of channels that are apart.
pub(crate) struct TimeMerge {
    /// Channels to merge, with the latest time of each.
    latest: BTreeMap<u16, u64>,
    clock: Clock,
    held: BTreeMap<Place, Held>,
    /// Bytes held in memory, and how many may be.
    bytes: usize,
    most: usize,
    count: u64,
    shelf: Box<dyn Shelf>,
    /// Bytes on the shelf.
    shelved: u64,
    runs: Vec<Run>,
    /// Next message of each run, the earliest first.
    heads: BinaryHeap<Reverse<(Place, usize)>>,
    failure: Option<Error>,
}

impl TimeMerge {
    /// Merges these channels, with the help of an empty shelf.
    pub(crate) fn new(Apart { channels, clock }: Apart, shelf: Box<dyn Shelf>) -> Self {
        Self {
            latest: channels.into_iter().map(|channel| (channel, 0)).collect(),
            clock,
            held: BTreeMap::new(),
            bytes: 0,
            most: MOST,
            count: 0,
            shelf,
            shelved: 0,
            runs: Vec::new(),
            heads: BinaryHeap::new(),
            failure: None,
        }
    }

    /// Description of the correction.
    pub(crate) fn remark(&self) -> String {
        let order = match self.clock {
            Clock::LogTimes => "log times",
            Clock::Stamps => "stamps (the log times are those of writing)",
        };
        format!("{BEHIND}: read in the order of their {order}")
    }

    /// Error of the shelf, if it failed. The merged messages are then incomplete.
    pub(crate) fn take_failure(&mut self) -> Option<Error> {
        self.failure.take()
    }

    /// Whether messages of a channel must be [held](Self::hold).
    pub(crate) fn holds(&self, channel: u16) -> bool {
        self.latest.contains_key(&channel)
    }

    /// Holds a message of this stamp, if it has one. Those whose turn has come are returned by [`next`](Self::next).
    pub(crate) fn hold(&mut self, message: &Message<'_>, stamp: impl FnOnce() -> Option<Stamp>) {
        let Message { channel, log_time, .. } = *message;
        let newest = self.latest.get(&channel).copied().unwrap_or_default();
        let time = match self.clock {
            Clock::LogTimes => log_time,
            // A message that cannot be read has no other time than the one before it.
            Clock::Stamps => stamp().map_or(newest, |stamp| u64::try_from(stamp.nanos()).unwrap_or_default()),
        };
        self.latest.insert(channel, time.max(newest));
        self.count += 1;
        let held = Held::of(message);
        self.bytes += held.size();
        self.held.insert((time, self.count), held);
        if self.bytes > self.most {
            let shelved = self.shelve();
            self.note(shelved);
        }
    }

    /// Next message that no other can precede.
    pub(crate) fn next(&mut self) -> Option<Held> {
        let until = self.latest.values().min().copied().unwrap_or_default();
        if self.first()?.0 > until { None } else { self.pop() }
    }

    /// Next message, once no more arrive.
    pub(crate) fn pop(&mut self) -> Option<Held> {
        match self.heads.peek() {
            Some(&Reverse((place, run))) if self.first() == Some(place) => {
                self.heads.pop();
                let taken = self.take_from(run);
                self.note(taken)
            }
            _ => {
                let (_, held) = self.held.pop_first()?;
                self.bytes -= held.size();
                Some(held)
            }
        }
    }

    /// Place of the earliest message that is held.
    fn first(&self) -> Option<Place> {
        let shelved = self.heads.peek().map(|Reverse((place, _))| *place);
        let held = self.held.first_key_value().map(|(place, _)| *place);
        shelved.into_iter().chain(held).min()
    }

    /// Puts all that is in memory on the shelf, as a run.
    fn shelve(&mut self) -> Result<(), Error> {
        let Some((&first, _)) = self.held.first_key_value() else { return Ok(()) };
        let begin = self.shelved;
        let mut bytes = Vec::new();
        while let Some((place, held)) = self.held.pop_first() {
            held.write(place, &mut bytes);
            if bytes.len() > AT_ONCE || self.held.is_empty() {
                self.shelf.append(&bytes)?;
                self.shelved += bytes.len() as u64;
                bytes.clear();
            }
        }
        self.bytes = 0;
        self.heads.push(Reverse((first, self.runs.len())));
        self.runs.push(Run::new(begin..self.shelved));
        Ok(())
    }

    /// Takes the next message of a run, and lines up the one behind it.
    fn take_from(&mut self, index: usize) -> Result<Option<Held>, Error> {
        let Some(run) = self.runs.get_mut(index) else { return Ok(None) };
        let taken = run.take(&mut *self.shelf)?;
        match run.peek(&mut *self.shelf)? {
            Some(place) => self.heads.push(Reverse((place, index))),
            None => *run = Run::new(0..0),
        }
        Ok(taken)
    }

    /// Keeps the first failure, behind which nothing more is merged.
    fn note<T: Default>(&mut self, result: Result<T, Error>) -> T {
        result.unwrap_or_else(|error| {
            self.failure.get_or_insert(error);
            self.held.clear();
            self.heads.clear();
            self.bytes = 0;
            T::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A shelf in memory, which fails behind so many bytes.
    struct Memory(Vec<u8>, usize);

    impl Shelf for Memory {
        fn append(&mut self, bytes: &[u8]) -> Result<(), Error> {
            if self.0.len() + bytes.len() > self.1 {
                return Err(Error::io("write temporary data beside it", std::path::Path::new("out"))(
                    std::io::ErrorKind::StorageFull.into(),
                ));
            }
            self.0.extend(bytes);
            Ok(())
        }

        fn read_at(&mut self, at: u64, into: &mut [u8]) -> Result<(), Error> {
            into.copy_from_slice(&self.0[at as usize..at as usize + into.len()]);
            Ok(())
        }
    }

    /// A merge of channels 1 and 2 that holds so many bytes in memory.
    fn merge(clock: Clock, most: usize, shelf: usize) -> TimeMerge {
        let merge = TimeMerge::new(Apart { channels: [1, 2].into(), clock }, Box::new(Memory(Vec::new(), shelf)));
        TimeMerge { most, ..merge }
    }

    /// Messages of these channels, times and data in the order in which they come.
    fn merged(messages: &[(u16, u64, Vec<u8>)], merge: &mut TimeMerge) -> Vec<(u16, u64, Vec<u8>)> {
        let mut told = Vec::new();
        for (channel, log_time, data) in messages {
            let message = Message { channel: *channel, sequence: 7, log_time: *log_time, publish_time: 9, data };
            merge.hold(&message, || None);
            told.extend(std::iter::from_fn(|| merge.next()));
        }
        told.extend(std::iter::from_fn(|| merge.pop()));
        assert!(told.iter().all(|held| (held.message().sequence, held.message().publish_time) == (7, 9)));
        let parts = |held: Held| (held.message().channel, held.message().log_time, held.message().data.to_vec());
        told.into_iter().map(parts).collect()
    }

    proptest! {
        /// By time, and what is of one time in the order of the file, however little fits into memory.
        #[test]
        fn what_does_not_fit_into_memory_comes_in_the_same_order(
            messages in prop::collection::vec((1_u16..3, 0_u64..50, prop::collection::vec(any::<u8>(), 0..90)), 0..120),
            most in 0_usize..4000,
        ) {
            let mut sorted = messages.clone();
            sorted.sort_by_key(|(_, log_time, _)| *log_time);
            // One channel wholly behind the other, each in order, as it stands in a file.
            sorted.sort_by_key(|(channel, ..)| *channel);
            let told = merged(&sorted, &mut merge(Clock::LogTimes, most, usize::MAX));
            sorted.sort_by_key(|(_, log_time, _)| *log_time);
            prop_assert_eq!(told, sorted);
            // In any order nothing is lost.
            let mut told = merged(&messages, &mut merge(Clock::LogTimes, most, usize::MAX));
            let mut all = messages;
            told.sort();
            all.sort();
            prop_assert_eq!(told, all);
        }
    }

    #[test]
    fn a_message_longer_than_what_is_read_at_once_comes_back_whole() {
        let messages =
            [(1, 10, vec![1; 3 * AT_ONCE]), (1, 20, vec![2; AT_ONCE - 10]), (2, 5, vec![3]), (2, 15, vec![4])];
        let told = merged(&messages, &mut merge(Clock::LogTimes, 100, usize::MAX));
        assert_eq!(told, [2, 0, 3, 1].map(|i: usize| messages[i].clone()));
    }

    #[test]
    fn a_shelf_that_is_full_is_a_failure_and_nothing_more_comes() {
        let messages: Vec<_> = (0..1000).map(|i| (1, i, vec![0; 50])).collect();
        let mut merge = merge(Clock::LogTimes, 5000, 20_000);
        merged(&messages, &mut merge);
        assert!(merge.take_failure().unwrap().to_string().contains("cannot write temporary data beside it"));
        assert!(merge.bytes <= 5000);
    }

    #[test]
    fn merged_messages_come_in_the_order_of_their_log_times() {
        let mut order = merge(Clock::LogTimes, MOST, 0);
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
        let mut order = merge(Clock::Stamps, MOST, 0);
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
