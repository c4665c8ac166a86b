//! Whole turns about the vertical, as on a table that is turned back to its mark.

use std::f64::consts::TAU;

use super::evidence::angle_between;
use super::piece::{Candidate, Piece};
use super::prediction::{Ends, furthest, motion};

/// Largest error of the rotation by a gyroscope that is not calibrated, as a share of it.
const OFF: f64 = 0.04;
/// Most whole turns that such an error cannot confuse.
const MOST: f64 = 10.0;
/// Largest angle between the poses before and after, rad: a table is level and flat.
const SAME: f64 = 0.05;
/// Largest tilt on the way, rad.
pub(super) const TILTED: f64 = 0.35;

/// Rotation about the vertical that a turn was, rad, if it was a whole number of turns on a table; counterclockwise seen
/// from above.
pub fn whole_turn(pieces: &[Piece], ends: &Ends) -> Option<f64> {
    let perfect = Candidate::default();
    let seen = motion(pieces.iter(), &perfect, ends).vertical;
    let whole = (seen / TAU).round();
    let near = whole != 0.0 && whole.abs() <= MOST && (seen - whole * TAU).abs() <= OFF * (whole * TAU).abs();
    let level = || angle_between(&ends.up[0], &ends.up[1]) <= SAME && furthest(pieces.iter(), &perfect, ends) <= TILTED;
    (near && level()).then_some(whole * TAU)
}
