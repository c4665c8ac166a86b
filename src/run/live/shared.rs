//! What all sessions share: the server, and the publisher that shows what waits for viewers.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{ChannelBuilder, ChannelId, Context, PartialMetadata, RawChannel, SinkId, WebSocketServerHandle};
use tokio::runtime::Handle;

use super::queue::{Item, Queue};

/// So many messages are shown at a time, …
const BATCH: usize = 128;
/// … with so much between them, that viewers keep up: each has room for 1,024 that it has not taken yet. At 12,800 a
/// second that is 10 ms; an IMU and its corrected twin seldom have a tenth of that.
fn pause(rate: u32) -> Duration {
    Duration::from_secs(1) * BATCH as u32 / rate.max(1)
}
/// Topics of recordings that are gone are shown for so long, to whoever comes late, and for the next recording.
const FAREWELL: Duration = Duration::from_secs(10);
/// Viewers have so long to ask for a topic that is new before they miss its first messages.
const GREETING: Duration = Duration::from_millis(500);
/// When nothing happens, viewers are told the time after so long.
const QUIET: Duration = Duration::from_millis(500);
/// Viewers have so long to take what is on its way when everything ends.
const PARTING: Duration = Duration::from_millis(500);
/// Times that go back by no more are of messages that annotations overtook, not of another recording (1 h).
const DISORDER: u64 = 3_600_000_000_000;

/// What the tails and the publisher share.
pub(super) struct Shared {
    pub(super) server: WebSocketServerHandle,
    pub(super) context: Arc<Context>,
    pub(super) viewers: Handle,
    pub(super) topics: Mutex<HashMap<ChannelId, Offered>>,
    pub(super) queue: Queue,
    pub(super) last: Arc<Last>,
    /// Messages that they are shown in a second.
    pub(super) rate: u32,
}

/// A topic that is offered to viewers.
pub(super) struct Offered {
    channel: Arc<RawChannel>,
    since: Instant,
    /// Recordings that are followed and have it.
    recordings: usize,
    /// Since when there is none.
    gone: Option<Instant>,
}

impl Shared {
    /// Shows what is put into the queue, until that is closed.
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
                // Viewers that are told no time plot by their own clock; the first that they are told is where plots begin.
                time.into_iter().for_each(|time| self.server.broadcast_time(time));
                std::thread::sleep(pause(self.rate));
            }
            self.forget_gone(&mut shown);
        }
        if self.is_watched() {
            // What is on its way to them arrives; nobody tells when it has.
            std::thread::sleep(PARTING);
        }
    }

    /// Offers a topic to the viewers. The thread that serves them does it: `foxglove` tells a viewer of a topic before it
    /// notes that this one may ask for it, and would refuse a quick one.
    pub(super) fn advertise(&self, topic: ChannelBuilder) -> Option<Arc<RawChannel>> {
        // What is offered now is not forgotten at the same time.
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

    /// A recording that has this topic is not followed any more.
    pub(super) fn leave(&self, topic: ChannelId) {
        if let Some(offered) = self.topics().get_mut(&topic) {
            offered.recordings = offered.recordings.saturating_sub(1);
            offered.gone = (offered.recordings == 0).then(Instant::now);
        }
    }

    /// Takes the topics back that no recording has had for a while, once all of their messages have been shown.
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

/// The last message on each topic but those of very many messages: whoever joins late is given it.
#[derive(Default)]
pub(super) struct Last(Mutex<HashMap<ChannelId, Item>>);

impl Last {
    fn forget(&self, topic: ChannelId) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&topic);
    }

    /// Shows a message. Whoever subscribes meanwhile gets it once or twice, never not at all.
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
    /// Sends it to one viewer, or to all that subscribed.
    fn log(&self, viewer: Option<SinkId>) {
        let metadata = PartialMetadata { log_time: Some(self.log_time) };
        self.channel.log_with_meta_to_sink(&self.data, metadata, viewer);
    }
}
