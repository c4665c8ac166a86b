//! Recordings with known truth: a [`Scenario`] describes the sensors, their rests and their motion, [`samples`]
//! computes their readings, and [`record`] writes an MCAP recording.
//!
//! The motion is physical: the gyroscope's true rate is the derivative of the attitude, the true specific force is the
//! reaction to gravity plus the acceleration of the hand, and a rest has no motion at all. Noise comes from a seeded
//! generator: the same scenario gives the same bytes.
//!
//! ```
//! use stillpoint::simulate::{Scenario, record};
//!
//! let scenario = Scenario::builtin("demo")?;
//! let mut recording = Vec::new();
//! let truth = record(&scenario, &mut recording)?;
//! assert_eq!(truth.rests.len(), 9);
//! assert!(recording.starts_with(b"\x89MCAP0\r\n"));
//! # Ok::<(), stillpoint::simulate::Error>(())
//! ```

mod builtin;
mod error;
mod fault;
mod load;
mod message;
mod pose;
mod sample;
mod scenario;
mod sensor;
mod temperature;
mod trajectory;
mod truth;
mod validate;
mod write;

pub use builtin::BUILTIN;
pub use error::Error;
pub use fault::{Axis, Fault};
pub use sample::{Reading, Samples, samples};
pub use scenario::{
    Compression, Encoding, Motion, Pose, Recording, Reference, Scenario, Sensitivity, Triad, Vibration,
};
pub use temperature::Temperature;
pub use truth::{Rest, TriadTruth, Truth};
pub use write::record;
