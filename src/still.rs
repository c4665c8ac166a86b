//! Whether a sensor rests, and what it read while it did. What the rests say about the sensor is left to
//! [`fit`](crate::fit).

mod config;

pub use config::{Config, Detector};
