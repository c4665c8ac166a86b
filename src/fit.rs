//! Calibration of a sensor from its rests. [`still`](crate::still) finds the rests; [`engine`](crate::engine) chooses
//! among them and publishes the results.
//!
//! The measurement model at rest is everywhere `measured = b + S · true` (Guang-Lin et al., 2012, at constant
//! temperature). [`Parameterisation`] says which of its parameters are unknown, and every fit is a [`LinearSystem`] of
//! equations about them.

pub mod accelerometer;
pub mod gyroscope;
pub mod known_poses;
pub mod outlier_test;
pub mod partial;
pub mod secondary;
pub mod temperature;
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
mod next_pose;
mod noise_density;
mod normal_equations;
mod parameterisation;
mod placement_scatter;
mod quadratic_program;
mod regression;
mod reliability;
mod residual_block;
mod student_t;
mod tails;
mod time_interpolation;
mod uncertainty;
mod wandering;
mod worst_case;

pub use bound::{Bound, Bounds};
pub use calibration::Calibration;
pub use config::{Config, Estimator, FaceConfig, FixtureConfig, Loss, Model, Refit, RotationConfig, Solid};
pub use error::Error;
pub use estimate::{Estimate, Origin};
pub use fixture::{Face, Fixture};
pub use gravity::{EARTH_RATE, EarthLocation, Gravity, Source};
pub use huber::huber;
pub use initial_guess::guess;
pub use linear_system::{Limits, LinearSystem, Row, Solved, limits};
pub use lsqlin::{Solution, lsqlin};
pub use next_pose::{PosePlan, PoseSearch};
pub use noise_density::{NoiseDensity, noise_densities};
pub use normal_equations::NormalEquations;
pub use parameterisation::{Parameterisation, Term, Truth};
pub use placement_scatter::{Assumed, PlacementScatter};
pub use regression::Reading;
pub use reliability::{Check, Reliability};
pub use residual_block::ResidualBlock;
pub use tails::{fisher_beyond, student_beyond};
pub use time_interpolation::TimeInterpolation;
pub use wandering::{Hint, Slope, Wandering, slope, unexcluded, wandering};
pub use worst_case::directions;
