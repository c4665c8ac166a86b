//! A directory as a service: its recordings are followed and annotated, and it says how it is.

mod discovery;
mod http;
mod metrics;
mod results;
mod service;
mod watching;

pub use http::serve;
pub use metrics::Metrics;
pub use service::{Show, Verdict, watch};
pub use watching::Watching;
