//! Combinations of an accelerometer's parameters that its placements determine, though not every parameter.
//!
//! At rest ‖S⁻¹(m − b)‖ = g, one equation a placement, whatever its tilt. Near a face, gravity leans from the normal by a
//! tilt only, which tells roughly how much of the reading across it is bias. Whatever is assumed of any sensor (the
//! limits of its datasheet, small cross-axis sensitivities, the uncertainty of gravity) counts as a normal error beside
//! these equations. Gauss–Newton finds the likeliest parameters and their covariance.
//!
//! An error e across a length l adds e² / 2l to it, which no derivative shows: the mean and the variance of that go into
//! the equation (second-order extended Kalman filter; Gelb, "Applied optimal estimation", 1974, section 6.1). It is the
//! same for all placements in one direction.

mod combination;
mod posterior;
mod shown;

pub use self::combination::{Combination, combinations};
pub use self::shown::{Disagreement, Shown};
