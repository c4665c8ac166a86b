//! The wish to stop, carried from a signal to whoever works. How the program then exits is left to it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::Error;

/// Shared by all who work; clones are the same wish.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicU8>);

impl Stop {
    /// Waits for SIGINT (Ctrl-C) or SIGTERM, then asks to stop.
    pub async fn on_signal(self) {
        let signal = tokio::select! {
            Ok(()) = tokio::signal::ctrl_c() => 2,
            () = terminated() => 15,
        };
        self.0.store(signal, Ordering::Relaxed);
    }

    /// The signal that asked to stop, if one did.
    pub fn signal(&self) -> Option<u8> {
        Some(self.0.load(Ordering::Relaxed)).filter(|&signal| signal != 0)
    }

    /// The wish was met, and is no reason to end otherwise than usual.
    pub fn answered(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// To be asked between pieces of work.
    ///
    /// # Errors
    ///
    /// [`Error::Stopped`] once a signal asked to stop.
    pub fn check(&self) -> Result<(), Error> {
        self.signal().map_or(Ok(()), |_| Err(Error::Stopped))
    }
}

async fn terminated() {
    match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
        Ok(mut signals) => {
            signals.recv().await;
        }
        Err(_) => std::future::pending().await,
    }
}
