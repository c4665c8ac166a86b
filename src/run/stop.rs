//! Request to stop, carried from a signal to the work in progress.

use std::future::Future;
use std::io;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use tokio::signal::unix::{SignalKind, signal};

use crate::Error;

/// A stop request, shared by all work; clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    signal: Arc<AtomicU8>,
    /// Time of the last check by this work, in milliseconds of the process.
    asked: Arc<AtomicU64>,
    /// Time limit of this work, and the instant when it ends.
    limit: Option<(Duration, Instant)>,
}

impl Stop {
    /// Listens for SIGINT (Ctrl-C) and SIGTERM from now on; once one comes, the future requests to stop.
    ///
    /// To be called within tokio's runtime.
    ///
    /// # Errors
    ///
    /// If the system refuses to.
    pub fn on_signal(self) -> io::Result<impl Future<Output = ()> + Send + 'static> {
        let (mut interrupted, mut terminated) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
        Ok(async move {
            let signal = tokio::select! {
                _ = interrupted.recv() => 2,
                _ = terminated.recv() => 15,
            };
            self.signal.store(signal, Ordering::Relaxed);
        })
    }

    /// Waits until a stop request has stayed unanswered for `patience`; returns its signal.
    pub async fn overdue(&self, patience: Duration) -> u8 {
        loop {
            tokio::time::sleep(Duration::from_millis(50)).await;
            if self.signal().is_some() {
                tokio::time::sleep(patience).await;
            }
            if let Some(signal) = self.signal() {
                return signal;
            }
        }
    }

    /// The same request, for a piece of work with its own time limit.
    pub fn of_work(&self, limit: Option<Duration>) -> Self {
        let limit = limit.and_then(|limit| Some((limit, Instant::now().checked_add(limit)?)));
        Self { signal: self.signal.clone(), asked: Arc::new(now().into()), limit }
    }

    /// Time since the last check by this work.
    pub fn silence(&self) -> Duration {
        Duration::from_millis(now().saturating_sub(self.asked.load(Ordering::Relaxed)))
    }

    /// Signal that requested to stop, if one did.
    pub fn signal(&self) -> Option<u8> {
        Some(self.signal.load(Ordering::Relaxed)).filter(|&signal| signal != 0)
    }

    /// Marks the request as answered, so that the program exits as usual.
    pub fn answered(&self) {
        self.signal.store(0, Ordering::Relaxed);
    }

    /// Checks for a stop request; to be called between pieces of work.
    ///
    /// # Errors
    ///
    /// [`Error::Stopped`] once a signal requested to stop, [`Error::Overdue`] once this work has taken too long.
    pub fn check(&self) -> Result<(), Error> {
        self.asked.store(now(), Ordering::Relaxed);
        match self.limit {
            _ if self.signal().is_some() => Err(Error::Stopped),
            Some((limit, until)) if Instant::now() >= until => Err(Error::Overdue(limit)),
            _ => Ok(()),
        }
    }
}

/// Milliseconds since the first call in this process.
fn now() -> u64 {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGAN.elapsed().as_millis() as u64
}
