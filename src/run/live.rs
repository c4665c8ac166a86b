//! Recordings while they are followed, for viewers that speak the Foxglove WebSocket protocol: the messages that are used
//! and everything that is learned. What happens is left to [`tail`](super::tail()), which tells the [`News`].
//!
//! No viewer can hold a tail up. Each has a queue of its own, and a slow one loses its oldest messages; one that takes
//! nothing at all for many seconds is let go.

mod previous_calibration;
mod queue;
mod session;

pub use session::Session;

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use foxglove::websocket::{Capability, ChannelView, Client, ServerListener};
use foxglove::{
    ChannelBuilder, ChannelId, Context, PartialMetadata, RawChannel, SinkId, WebSocketServer, WebSocketServerHandle,
};
use tokio::runtime::{Builder, Handle, Runtime};

use crate::Error;
use queue::{Item, Queue};

/// So many messages are shown at a time, …
const BATCH: usize = 128;
/// … with so much between them, that viewers keep up: each has room for 1,024 that it has not taken yet. That is 12,800
/// a second; an IMU and its corrected twin seldom have a tenth of that.
const PAUSE: Duration = Duration::from_millis(10);
/// Viewers have so long to ask for a topic that is new before they miss its first messages.
const GREETING: Duration = Duration::from_millis(500);
/// When nothing happens, viewers are told the time after so long.
const QUIET: Duration = Duration::from_millis(500);
/// Viewers have so long to take what is on its way when everything ends.
const PARTING: Duration = Duration::from_millis(500);
/// Times that go back by no more are of messages that annotations overtook, not of another recording (1 h).
const DISORDER: u64 = 3_600_000_000_000;

/// A server that viewers connect to. It stops when it is dropped.
pub struct Live {
    address: SocketAddr,
    shared: Arc<Shared>,
    publisher: Option<JoinHandle<()>>,
    /// One thread for all viewers: a crowd of them cannot take every core.
    runtime: Option<Runtime>,
}

/// What the tails and the publisher share.
struct Shared {
    server: WebSocketServerHandle,
    context: Arc<Context>,
    viewers: Handle,
    /// When each topic was offered to them.
    offered: Mutex<HashMap<ChannelId, Instant>>,
    queue: Queue,
    last: Arc<Last>,
}

impl Live {
    /// Listens on an address; port 0 is any that is free.
    ///
    /// # Errors
    ///
    /// If nothing can listen there.
    pub fn open(address: SocketAddr) -> Result<Self, Error> {
        let refused = |error| Error::io("listen on", address.to_string().as_ref())(error);
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().map_err(refused)?;
        let (context, last) = (Context::new(), Arc::new(Last::default()));
        let host = match address {
            SocketAddr::V4(address) => address.ip().to_string(),
            SocketAddr::V6(address) => format!("[{}]", address.ip()),
        };
        let server = WebSocketServer::new()
            .name(concat!("stillpoint ", env!("CARGO_PKG_VERSION")))
            .bind(host, address.port())
            .capabilities([Capability::Time])
            .listener(last.clone())
            .context(&context)
            .tokio_runtime(runtime.handle())
            .start_blocking()
            .map_err(|error| match error {
                foxglove::FoxgloveError::Bind(error) => refused(error),
                other => refused(std::io::Error::other(other)),
            })?;
        let address = SocketAddr::new(address.ip(), server.port());
        let viewers = runtime.handle().clone();
        let (queue, offered) = (Queue::default(), Mutex::default());
        let shared = Arc::new(Shared { server, context, viewers, offered, queue, last });
        let publish = {
            let shared = shared.clone();
            move || shared.publish()
        };
        let publisher = std::thread::Builder::new().spawn(publish).map_err(refused)?;
        Ok(Self { address, shared, publisher: Some(publisher), runtime: Some(runtime) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// A recording that is about to be followed.
    pub fn session(&self) -> Session<'_> {
        Session::new(&self.shared)
    }
}

impl fmt::Debug for Live {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Live").field("address", &self.address).finish_non_exhaustive()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.shared.queue.close();
        // It is of no matter here whether it panicked.
        let _ = self.publisher.take().map(JoinHandle::join);
        if let Some(runtime) = self.runtime.take() {
            // Viewers are not told, and see the connection end.
            runtime.shutdown_background();
        }
    }
}

impl Shared {
    /// Shows what is put into the queue, until that is closed.
    fn publish(&self) {
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
                std::thread::sleep(PAUSE);
            }
        }
        if self.is_watched() {
            // What is on its way to them arrives; nobody tells when it has.
            std::thread::sleep(PARTING);
        }
    }

    /// Offers a topic to the viewers. The thread that serves them does it: `foxglove` tells a viewer of a topic before it
    /// notes that this one may ask for it, and would refuse a quick one.
    fn advertise(&self, topic: ChannelBuilder) -> Option<Arc<RawChannel>> {
        let (sender, receiver) = std::sync::mpsc::channel();
        self.viewers.spawn(async move { sender.send(topic.build_raw()) });
        let built = receiver.recv().ok()?;
        let built = built.inspect_err(|error| tracing::warn!("a topic is not shown live: {error}")).ok()?;
        let mut offered = self.offered.lock().unwrap_or_else(PoisonError::into_inner);
        offered.entry(built.id()).or_insert_with(Instant::now);
        Some(built)
    }

    fn offered_for(&self, topic: ChannelId) -> Duration {
        let offered = self.offered.lock().unwrap_or_else(PoisonError::into_inner);
        offered.get(&topic).map_or(Duration::ZERO, Instant::elapsed)
    }

    /// Whether there is any viewer.
    fn is_watched(&self) -> bool {
        self.server.client_count() > 0
    }
}

/// The last message on each topic but those of very many messages: whoever joins late is given it.
#[derive(Default)]
struct Last(Mutex<HashMap<ChannelId, Item>>);

impl Last {
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
