//! Detection of zero-velocity segments (rests), and the statistics of their readings.
//!
//! Biases are unknown, so a test on ‖a‖ − g cannot work. The generalised likelihood-ratio test for zero velocity with
//! unknown mean (Skog et al., "Zero-velocity detection", IEEE TBME 2010, with the mean as a nuisance parameter) is the
//! variance in a sliding window, relative to the sensor's own noise floor. Theirs is one joint test of accelerometer
//! and gyroscope, the sum of both; here each triad is tested separately and the loudest decides, so that a quiet one
//! cannot outvote a moving one.

mod allan_variance;
mod alternation;
mod config;
mod moments;
mod noise_floor;
mod placement_number;
mod rest;
mod saturation;
mod segmenter;
mod signal;
mod sketch;
mod status;
mod stretch;
mod thermometer;
mod time_base;
mod triad_track;
mod triads;
mod waiting_rests;
mod window;

pub use allan_variance::{AllanSums, Octave, Octaves};
pub use config::{Config, Detector};
pub use moments::Moments;
pub use rest::{Rest, TriadMean};
pub use saturation::ReadingRange;
pub use segmenter::{Outcome, Segmenter};
pub use signal::Signal;
pub use sketch::Sketch;
pub use status::{State, Status};
pub use stretch::Stretch;
pub use time_base::{Tick, TimeBase};
