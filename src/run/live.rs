//! Server for viewers of the Foxglove WebSocket protocol: it shows the used messages and all findings of recordings
//! while they are followed. [`tail`](super::tail()) reports the [`Notice`].
//!
//! No viewer can delay a tail. Each has its own queue, and a slow one loses its oldest messages; one that takes nothing
//! at all for many seconds is disconnected.

mod door;
mod gate;
mod previous_calibration;
mod queue;
mod session;
mod shared;
mod unfinished;

pub use gate::Viewers;
pub use session::Session;

use std::fmt;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use foxglove::websocket::Capability;
use foxglove::{Context, WebSocketServer};
use tokio::runtime::{Builder, Runtime};

use crate::Error;
use crate::run::runtime::runtime;
use queue::Queue;
use shared::{Last, Shared};

/// A server that viewers connect to. It stops when dropped.
pub struct Live {
    address: SocketAddr,
    shared: Arc<Shared>,
    sender: Option<JoinHandle<()>>,
    /// One thread for all viewers: a crowd of them cannot take every core.
    runtime: Option<Runtime>,
}

impl Live {
    /// Listens on an address, within the limits for viewers; port 0 takes any free port.
    ///
    /// # Errors
    ///
    /// If nothing can listen there.
    pub fn open(address: SocketAddr, viewers: Viewers) -> Result<Self, Error> {
        let refused = |error| Error::io("listen on", address.to_string().as_ref())(error);
        let runtime =
            runtime(|| Builder::new_multi_thread().worker_threads(1).enable_all().build()).map_err(refused)?;
        let listener =
            TcpListener::bind(address).and_then(|listener| listener.set_nonblocking(true).map(|()| listener));
        let listener = listener.map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        let (context, last) = (Context::new(), Arc::new(Last::default()));
        let serve = |host: Ipv4Addr| {
            WebSocketServer::new()
                .name(concat!("stillpoint ", env!("CARGO_PKG_VERSION")))
                .bind(host.to_string(), 0)
                .capabilities([Capability::Time])
                .listener(last.clone())
                .context(&context)
                .tokio_runtime(runtime.handle())
                .start_blocking()
        };
        let host = gate::unguessable();
        // Not every system gives a machine more than one loopback address.
        let (host, served) = match serve(host) {
            Err(_) => (Ipv4Addr::LOCALHOST, serve(Ipv4Addr::LOCALHOST)),
            served => (host, served),
        };
        let server = served.map_err(|error| match error {
            foxglove::FoxgloveError::Bind(error) => refused(error),
            other => refused(std::io::Error::other(other)),
        })?;
        let inner = SocketAddr::new(host.into(), server.port());
        let (longest, rate) = (viewers.owed, viewers.rate);
        {
            let _inside = runtime.enter();
            let listener = tokio::net::TcpListener::from_std(listener).map_err(refused)?;
            runtime.spawn(gate::keep(listener, inner, viewers));
        }
        let viewers = runtime.handle().clone();
        let (queue, topics) = (Queue::new(longest), Mutex::default());
        let shared = Arc::new(Shared { server, context, viewers, topics, queue, last, rate });
        let publish = {
            let shared = shared.clone();
            move || shared.publish()
        };
        let sender = std::thread::Builder::new().spawn(publish).map_err(refused)?;
        Ok(Self { address, shared, sender: Some(sender), runtime: Some(runtime) })
    }

    /// Address that it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Session of a recording that is about to be followed.
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
        // A panic of the sender does not matter here.
        let _ = self.sender.take().map(JoinHandle::join);
        if let Some(runtime) = self.runtime.take() {
            // Viewers get no notice; their connection ends.
            runtime.shutdown_background();
        }
    }
}
