//! The wish to stop, carried from a signal to whoever works. How the program then exits is left to it.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

use crate::Error;

/// Shared by all who work; clones are the same wish.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    signal: Arc<AtomicU8>,
    /// When this work asked last, in milliseconds of the process.
    asked: Arc<AtomicU64>,
    /// How long this work may take, and until when.
    limit: Option<(Duration, Instant)>,
}

impl Stop {
    /// Waits for SIGINT (Ctrl-C) or SIGTERM, then asks to stop.
    pub async fn on_signal(self) {
        let signal = tokio::select! {
            Ok(()) = tokio::signal::ctrl_c() => 2,
            () = terminated() => 15,
        };
        self.signal.store(signal, Ordering::Relaxed);
    }

    /// Waits until somebody has wished to stop for so long, and the wish was not met.
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

    /// The same wish, for work of its own that may take so long.
    pub fn of_work(&self, limit: Option<Duration>) -> Self {
        let limit = limit.and_then(|limit| Some((limit, Instant::now().checked_add(limit)?)));
        Self { signal: self.signal.clone(), asked: Arc::new(now().into()), limit }
    }

    /// How long ago this work asked last.
    pub fn silence(&self) -> Duration {
        Duration::from_millis(now().saturating_sub(self.asked.load(Ordering::Relaxed)))
    }

    /// The signal that asked to stop, if one did.
    pub fn signal(&self) -> Option<u8> {
        Some(self.signal.load(Ordering::Relaxed)).filter(|&signal| signal != 0)
    }

    /// The wish was met, and is no reason to end otherwise than usual.
    pub fn answered(&self) {
        self.signal.store(0, Ordering::Relaxed);
    }

    /// To be asked between pieces of work.
    ///
    /// # Errors
    ///
    /// [`Error::Stopped`] once a signal asked to stop, [`Error::Overdue`] once this work has taken too long.
    pub fn check(&self) -> Result<(), Error> {
        self.asked.store(now(), Ordering::Relaxed);
        match self.limit {
            _ if self.signal().is_some() => Err(Error::Stopped),
            Some((limit, until)) if Instant::now() >= until => Err(Error::Overdue(limit)),
            _ => Ok(()),
        }
    }
}

/// Milliseconds since the process first asked.
fn now() -> u64 {
    static BEGAN: LazyLock<Instant> = LazyLock::new(Instant::now);
    BEGAN.elapsed().as_millis() as u64
}

async fn terminated() {
    match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
        Ok(mut signals) => {
            signals.recv().await;
        }
        Err(_) => std::future::pending().await,
    }
}
