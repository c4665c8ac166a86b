//! A directory as a service: its recordings are followed and annotated, and its health is reported.

mod discovery;
mod http;
mod metrics;
mod prefix;
mod results;
mod service;
mod watching;

pub use http::serve;
pub use metrics::Metrics;
pub use prefix::{WatchingPrefix, watch_prefix};
pub use service::{Show, Verdict, watch};
pub use watching::Watching;
