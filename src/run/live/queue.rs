//! Queue of messages to be shown. Putting an item in never waits.
//!
//! Recorders write in bursts, a second of messages at a time, or an hour of them where a tail catches up. A viewer's
//! own buffer is small and drops what does not fit. So the bursts wait here, and annotations overtake them.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use foxglove::RawChannel;

/// Most waiting messages of the recording; further ones are not shown.
const BULK: usize = 1 << 14;
/// Most waiting annotations: those of a day.
const LEARNED: usize = 1 << 17;
/// Most waiting bytes, of either kind (32 MiB).
const BYTES: usize = 32 << 20;

/// A message to be shown.
pub(super) struct Item {
    pub(super) channel: Arc<RawChannel>,
    pub(super) log_time: u64,
    pub(super) data: Vec<u8>,
    /// Whether it is one of very many, like the recording's own messages. Of other topics, viewers that join late get
    /// the last message.
    pub(super) is_bulk: bool,
}

/// Queue shared by the producers and the one consumer.
pub(super) struct Queue {
    waiting: Mutex<Waiting>,
    came: Condvar,
    /// Longest item, in bytes.
    longest: usize,
}

#[derive(Default)]
struct Waiting {
    learned: Line,
    bulk: Line,
    closed: bool,
}

#[derive(Default)]
struct Line {
    items: VecDeque<Item>,
    bytes: usize,
}

impl Line {
    fn put(&mut self, item: Item, most: usize) -> bool {
        let bytes = self.bytes + item.data.len();
        let has_room = self.items.len() < most && bytes <= BYTES;
        if has_room {
            self.items.push_back(item);
            self.bytes = bytes;
        }
        has_room
    }

    fn take(&mut self, most: usize) -> Vec<Item> {
        let taken: Vec<_> = self.items.drain(..most.min(self.items.len())).collect();
        self.bytes -= taken.iter().map(|item| item.data.len()).sum::<usize>();
        taken
    }
}

impl Waiting {
    fn is_empty(&self) -> bool {
        self.learned.items.is_empty() && self.bulk.items.is_empty()
    }
}

impl Queue {
    /// An empty queue for items of at most `longest` bytes.
    pub(super) fn new(longest: usize) -> Self {
        Self { waiting: Mutex::default(), came: Condvar::new(), longest }
    }

    /// Appends an item if there is room.
    pub(super) fn put(&self, item: Item) {
        if item.data.len() > self.longest {
            return;
        }
        let mut waiting = self.lock();
        let Waiting { learned, bulk, .. } = &mut *waiting;
        let has_room = if item.is_bulk { bulk.put(item, BULK) } else { learned.put(item, LEARNED) };
        if has_room {
            self.came.notify_one();
        }
    }

    /// The next items, at most `most`, and none if none comes within `patience`; `None` once the queue is closed and
    /// empty.
    pub(super) fn take(&self, most: usize, patience: Duration) -> Option<Vec<Item>> {
        let idle = |waiting: &mut Waiting| waiting.is_empty() && !waiting.closed;
        let waited = self.came.wait_timeout_while(self.lock(), patience, idle);
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if waiting.closed && waiting.is_empty() {
            return None;
        }
        let mut taken = waiting.learned.take(most);
        taken.extend(waiting.bulk.take(most - taken.len()));
        Some(taken)
    }

    /// Whether no item waits.
    pub(super) fn is_empty(&self) -> bool {
        self.lock().is_empty()
    }

    /// Closes the queue: no further item is put in.
    pub(super) fn close(&self) {
        self.lock().closed = true;
        self.came.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use foxglove::{ChannelBuilder, Context};

    #[test]
    fn what_was_learned_overtakes_and_never_lacks_room_for_what_was_recorded() {
        let channel = ChannelBuilder::new("/t").message_encoding("cdr").context(&Context::new()).build_raw().unwrap();
        let queue = Queue::new(100);
        let item = |log_time, is_bulk| Item { channel: channel.clone(), log_time, data: Vec::new(), is_bulk };
        queue.put(Item { data: vec![0; 101], ..item(9, false) });
        (0..2 * BULK as u64).for_each(|time| queue.put(item(time, true)));
        queue.put(item(7, false));
        queue.close();
        let times = |most| {
            let items = queue.take(most, Duration::ZERO)?;
            Some(items.iter().map(|item| item.log_time).collect::<Vec<_>>())
        };
        assert_eq!(times(3), Some(vec![7, 0, 1]));
        assert_eq!(times(usize::MAX).unwrap().len(), BULK - 2, "bounded");
        assert_eq!(times(1), None);
    }

    #[test]
    fn so_many_bytes_wait_and_no_more() {
        let channel = ChannelBuilder::new("/t").message_encoding("cdr").context(&Context::new()).build_raw().unwrap();
        let queue = Queue::new(1 << 20);
        let put = || queue.put(Item { channel: channel.clone(), log_time: 1, data: vec![0; 1 << 20], is_bulk: false });
        (0..100).for_each(|_| put());
        assert_eq!(queue.take(8, Duration::ZERO).unwrap().len(), 8);
        (0..100).for_each(|_| put());
        assert_eq!(queue.take(100, Duration::ZERO).unwrap().len(), BYTES >> 20);
    }

    #[test]
    fn nothing_to_show_is_no_end() {
        let queue = Queue::new(1);
        assert!(queue.take(1, Duration::from_millis(1)).unwrap().is_empty());
    }
}
