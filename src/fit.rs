//! What rests say about a sensor. Finding the rests is left to [`still`](crate::still).

mod config;

pub use config::{Bounds, Config, Estimator, Model, Refit};
