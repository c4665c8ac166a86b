//! What rests say about a sensor. Finding the rests is left to [`still`](crate::still), choosing among them and saying
//! what came out to [`engine`](crate::engine).
//!
//! The measurement model everywhere is `measured = b + S · true` at rest (Guang-Lin et al., 2012, at constant
//! temperature); [`Shape`] says what of it is unknown, and every fit is a [`System`] of equations about that.

pub mod accelerometer;
pub mod contradiction;
pub mod gyroscope;
pub mod posed;
pub mod secondary;

mod alignment;
mod bars;
mod block;
mod bound;
mod calibration;
mod config;
mod conic;
mod estimate;
mod fixture;
mod gravity;
mod huber;
mod lsqlin;
mod orientation;
mod reference;
mod regression;
mod scatter;
mod shape;
mod student;
mod system;
mod worst;

pub use alignment::Alignment;
pub use block::Block;
pub use bound::{Bound, Bounds};
pub use calibration::Calibration;
pub use config::{Config, Estimator, FaceConfig, FixtureConfig, Loss, Model, Refit, Solid};
pub use estimate::{Estimate, Origin};
pub use fixture::{Face, Fixture};
pub use gravity::{EARTH_RATE, Gravity, Place, Source};
pub use huber::huber;
pub use lsqlin::{Error, Solution, lsqlin};
pub use orientation::guess;
pub use reference::NormalEquations;
pub use regression::Reading;
pub use scatter::{Assumed, Scatter};
pub use shape::{Shape, Term, Truth};
pub use system::{Limits, Row, Solved, System, limits};
pub use worst::directions;
