//! What rests say about a sensor. Finding the rests is left to [`still`](crate::still), choosing among them and saying
//! what came out to [`engine`](crate::engine).
//!
//! The measurement model everywhere is `measured = b + S · true` (Guang-Lin et al., 2012, at rest and at constant
//! temperature); [`Shape`] says which entries of S are unknown.

pub mod accelerometer;
pub mod gyroscope;
pub mod secondary;

mod calibration;
mod config;
mod fixture;
mod lsqlin;
mod orientation;
mod scatter;

pub use calibration::{Calibration, Shape};
pub use config::{Bounds, Config, Estimator, Model};
pub use fixture::{Face, Fixture};
pub use lsqlin::{Error, Solution, lsqlin};
pub use orientation::guess;
pub use scatter::variance_between;
