//! What rests say about a sensor. Finding the rests is left to [`still`](crate::still), choosing among them and saying
//! what came out to [`engine`](crate::engine).
//!
//! The measurement model everywhere is `measured = b + S · true` at rest (Guang-Lin et al., 2012, at constant
//! temperature); [`Shape`] says what of it is unknown, and every fit is a [`System`] of equations about that.

pub mod accelerometer;
pub mod contradiction;
pub mod gyroscope;
pub mod secondary;

mod bars;
mod calibration;
mod config;
mod estimate;
mod fixture;
mod gravity;
mod lsqlin;
mod orientation;
mod regression;
mod scatter;
mod shape;
mod system;
mod worst;

pub use calibration::Calibration;
pub use config::{Bounds, Config, Estimator, Model};
pub use estimate::{Estimate, Origin};
pub use fixture::{Face, Fixture};
pub use gravity::{EARTH_RATE, Gravity, Place, Source};
pub use lsqlin::{Error, Solution, lsqlin};
pub use orientation::guess;
pub use regression::Reading;
pub use scatter::{Assumed, Block, Scatter};
pub use shape::{Shape, Term, Truth};
pub use system::{Limits, Row, Solved, System, limits};
pub use worst::directions;
