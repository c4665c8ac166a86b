//! The server for viewers.

use stillpoint::Error;
use stillpoint::config::{Config, Limits};
use stillpoint::run::{Live, Viewers};

use crate::cli::Viewing;

/// Opens the server for viewers, if requested.
pub fn live(viewing: &Viewing, config: &Config) -> Result<Option<Live>, Error> {
    let Limits { viewers, viewer_kib, viewer_rate, .. } = config.limits;
    let allowed = viewing.live_allow.clone();
    let viewers = Viewers { most: viewers, owed: viewer_kib << 10, rate: viewer_rate, allowed };
    let live = viewing.live.map(|address| Live::open(address, viewers)).transpose()?;
    if let Some(live) = &live {
        tracing::info!("live at ws://{}", live.address());
    }
    Ok(live)
}
