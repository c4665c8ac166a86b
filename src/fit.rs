//! What rests say about a sensor. Finding the rests is left to [`still`](crate::still), choosing among them and saying
//! what came out to [`engine`](crate::engine).
//!
//! The measurement model everywhere is `measured = b + S · true` at rest (Guang-Lin et al., 2012, at constant
//! temperature); [`Parameterisation`] says what of it is unknown, and every fit is a [`LinearSystem`] of equations about that.

pub mod accelerometer;
pub mod gyroscope;
pub mod known_poses;
pub mod outlier_test;
pub mod secondary;
pub mod turn_fit;

mod bound;
mod calibration;
mod config;
mod error;
mod estimate;
mod fixture;
mod gravity;
mod huber;
mod initial_guess;
mod linear_system;
mod lsqlin;
mod noise_density;
mod normal_equations;
mod parameterisation;
mod placement_scatter;
mod quadratic_program;
mod regression;
mod reliability;
mod residual_block;
mod student_t;
mod time_interpolation;
mod uncertainty;
mod wandering;
mod worst_case;

pub use bound::{Bound, Bounds};
pub use calibration::Calibration;
pub use config::{Config, Estimator, FaceConfig, FixtureConfig, Loss, Model, Refit, Solid};
pub use error::Error;
pub use estimate::{Estimate, Origin};
pub use fixture::{Face, Fixture};
pub use gravity::{EARTH_RATE, Gravity, Place, Source};
pub use huber::huber;
pub use initial_guess::guess;
pub use linear_system::{Limits, LinearSystem, Row, Solved, limits};
pub use lsqlin::{Solution, lsqlin};
pub use noise_density::{NoiseDensity, noise_densities};
pub use normal_equations::NormalEquations;
pub use parameterisation::{Parameterisation, Term, Truth};
pub use placement_scatter::{Assumed, PlacementScatter};
pub use regression::Reading;
pub use reliability::{Check, Reliability};
pub use residual_block::ResidualBlock;
pub use time_interpolation::TimeInterpolation;
pub use wandering::{Hint, Slope, Wandering, slope, unexcluded, wandering};
pub use worst_case::directions;
