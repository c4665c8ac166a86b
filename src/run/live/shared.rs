//! State shared by all sessions: the server, and the sender that shows the waiting messages.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelBuilder, ChannelId, Context, PartialMetadata, RawChannel, SinkId, WebSocketServerHandle};
use tokio::runtime::Handle;

use super::queue::{Item, Queue};

/// Most messages that are shown between two pauses.
const BATCH: usize = 128;
/// Pause between two batches, so that viewers keep up: each buffers 1,024 messages. At 12,800 messages per second it is
/// 10 ms; an IMU and its corrected twin seldom have a tenth of that rate.
fn pause(rate: u32) -> Duration {
    Duration::from_secs(1) * BATCH as u32 / rate.max(1)
}
/// Time for which topics of ended recordings are still offered, for viewers that come late and for the next recording.
const FAREWELL: Duration = Duration::from_secs(10);
/// Time that viewers have to subscribe to a new topic before they miss its first messages.
const GREETING: Duration = Duration::from_millis(500);
/// Interval of time messages when nothing happens.
const QUIET: Duration = Duration::from_millis(500);
/// Time that viewers have to receive the last messages at the end.
const PARTING: Duration = Duration::from_millis(500);
/// Largest step back in time that is a message overtaken by annotations, not another recording, in nanoseconds (1 h).
const DISORDER: u64 = 3_600_000_000_000;

/// State shared by the tails and the sender.
pub(super) struct Shared {
    pub(super) server: WebSocketServerHandle,
    pub(super) context: Arc<Context>,
    pub(super) viewers: Handle,
    pub(super) topics: Mutex<HashMap<ChannelId, Offered>>,
    pub(super) queue: Queue,
    pub(super) last: Arc<Last>,
    /// Messages per second that are shown.
    pub(super) rate: u32,
}

/// A topic that is offered to viewers.
pub(super) struct Offered {
    channel: Arc<RawChannel>,
    since: Instant,
    /// Number of followed recordings that have it.
    recordings: usize,
    /// Time since which no recording has it.
    gone: Option<Instant>,
}

impl Shared {
    /// Shows the queued items until the queue is closed.
    pub(super) fn publish(&self) {
        let mut shown = HashSet::new();
        let mut time = None;
        while let Some(batch) = self.queue.take(BATCH, QUIET) {
            for item in batch {
                if shown.insert(item.channel.id()) && self.is_watched() {
                    std::thread::sleep(GREETING.saturating_sub(self.offered_for(item.channel.id())));
                }
                if time.is_none() {
                    self.server.broadcast_time(item.log_time);
                }
                time = time.filter(|&time| item.log_time <= time && item.log_time >= time.saturating_sub(DISORDER));
                time = time.or(Some(item.log_time));
                self.last.show(item);
            }
            if self.is_watched() {
                // Viewers without a time plot by their own clock; plots begin at the first time that is sent.
                time.into_iter().for_each(|time| self.server.broadcast_time(time));
                std::thread::sleep(pause(self.rate));
            }
            self.forget_gone(&mut shown);
        }
        if self.is_watched() {
            // Lets the last messages arrive; nothing reports when they have.
            std::thread::sleep(PARTING);
        }
    }

    /// Offers a topic to the viewers, on the thread that serves them: `foxglove` announces a topic to a viewer before
    /// it accepts the viewer's subscription, and would refuse a quick one.
    pub(super) fn advertise(&self, topic: ChannelBuilder) -> Option<Arc<RawChannel>> {
        // Holds the lock, so that a topic offered now is not forgotten at the same time.
        let mut topics = self.topics();
        let (sender, receiver) = std::sync::mpsc::channel();
        self.viewers.spawn(async move { sender.send(topic.build_raw()) });
        let built = receiver.recv().ok()?;
        let built = built.inspect_err(|error| tracing::warn!("a topic is not shown live: {error}")).ok()?;
        let new = || Offered { channel: built.clone(), since: Instant::now(), recordings: 0, gone: None };
        let offered = topics.entry(built.id()).or_insert_with(new);
        (offered.recordings, offered.gone) = (offered.recordings + 1, None);
        Some(built)
    }

    /// Notes that a recording with this topic is no longer followed.
    pub(super) fn leave(&self, topic: ChannelId) {
        if let Some(offered) = self.topics().get_mut(&topic) {
            offered.recordings = offered.recordings.saturating_sub(1);
            offered.gone = (offered.recordings == 0).then(Instant::now);
        }
    }

    /// Withdraws topics that no recording has had for a while, once all of their messages have been shown.
    fn forget_gone(&self, shown: &mut HashSet<ChannelId>) {
        if !self.queue.is_empty() {
            return;
        }
        let mut topics = self.topics();
        topics.retain(|id, offered| {
            let stays = offered.gone.is_none_or(|gone| gone.elapsed() < FAREWELL);
            if !stays {
                let (channel, (sender, closed)) = (offered.channel.clone(), std::sync::mpsc::channel());
                self.viewers.spawn(async move {
                    channel.close();
                    sender.send(())
                });
                let _ = closed.recv();
                self.last.forget(*id);
                shown.remove(id);
            }
            stays
        });
    }

    fn offered_for(&self, topic: ChannelId) -> Duration {
        self.topics().get(&topic).map_or(Duration::ZERO, |offered| offered.since.elapsed())
    }

    fn topics(&self) -> MutexGuard<'_, HashMap<ChannelId, Offered>> {
        self.topics.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether there is any viewer.
    pub(super) fn is_watched(&self) -> bool {
        self.server.client_count() > 0
    }
}

/// The last message on each topic, except bulk topics, for viewers that join late.
#[derive(Default)]
pub(super) struct Last(Mutex<HashMap<ChannelId, Item>>);

impl Last {
    fn forget(&self, topic: ChannelId) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&topic);
    }

    /// Shows a message. A viewer that subscribes meanwhile gets it once or twice, but never misses it.
    fn show(&self, item: Item) {
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        item.log(None);
        if !item.is_bulk {
            last.insert(item.channel.id(), item);
        }
    }
}

impl ServerListener for Last {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let (Some(item), Some(viewer)) = (last.get(&channel.id()), client.sink_id()) {
            item.log(Some(viewer));
        }
    }
}

impl Item {
    /// Sends it to one viewer, or to all subscribers.
    fn log(&self, viewer: Option<SinkId>) {
        let metadata = PartialMetadata { log_time: Some(self.log_time) };
        self.channel.log_with_meta_to_sink(&self.data, metadata, viewer);
    }
}
