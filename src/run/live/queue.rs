//! What waits to be shown. Whoever puts something in never waits; showing it is left to [`live`](super).
//!
//! Recorders write in bursts, a second of messages at a time and an hour of them where a tail catches up. A viewer's own
//! place for messages that it has not taken yet is small, and what does not find room there is lost. So the bursts wait
//! here, and what was learned overtakes them.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use foxglove::RawChannel;

/// Messages of the recording that wait, at most; more of them are not shown.
const BULK: usize = 1 << 14;
/// Annotations that wait, at most: those of a day.
const LEARNED: usize = 1 << 17;

/// A message to be shown.
pub(super) struct Item {
    pub(super) channel: Arc<RawChannel>,
    pub(super) log_time: u64,
    pub(super) data: Vec<u8>,
    /// Whether it is one of very many, as the recording's own messages are. Of the others, viewers that join late are given
    /// the last.
    pub(super) is_bulk: bool,
}

/// Shared by those who put in and the one who takes out.
#[derive(Default)]
pub(super) struct Queue {
    waiting: Mutex<Waiting>,
    came: Condvar,
}

#[derive(Default)]
struct Waiting {
    learned: VecDeque<Item>,
    bulk: VecDeque<Item>,
    closed: bool,
}

impl Waiting {
    fn is_empty(&self) -> bool {
        self.learned.is_empty() && self.bulk.is_empty()
    }
}

impl Queue {
    /// Appends an item, if there is room.
    pub(super) fn put(&self, item: Item) {
        let mut waiting = self.lock();
        let Waiting { learned, bulk, .. } = &mut *waiting;
        let (items, room) = if item.is_bulk { (bulk, BULK) } else { (learned, LEARNED) };
        if items.len() < room {
            items.push_back(item);
            self.came.notify_one();
        }
    }

    /// The next items, `most` at most and none if none came for so long; `None` when there will be no more.
    pub(super) fn take(&self, most: usize, patience: Duration) -> Option<Vec<Item>> {
        let idle = |waiting: &mut Waiting| waiting.is_empty() && !waiting.closed;
        let waited = self.came.wait_timeout_while(self.lock(), patience, idle);
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if waiting.closed && waiting.is_empty() {
            return None;
        }
        let Waiting { learned, bulk, .. } = &mut *waiting;
        let first = most.min(learned.len());
        let then = (most - first).min(bulk.len());
        Some(learned.drain(..first).chain(bulk.drain(..then)).collect())
    }

    /// Nothing more will be put in.
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
        let queue = Queue::default();
        let item = |log_time, is_bulk| Item { channel: channel.clone(), log_time, data: Vec::new(), is_bulk };
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
    fn nothing_to_show_is_no_end() {
        let queue = Queue::default();
        assert!(queue.take(1, Duration::from_millis(1)).unwrap().is_empty());
    }
}
