//! Heading of a body that is tilted a little: what a compass, a pair of antennas or an odometry on it shows.
//!
//! The attitude is split into the rotation about the vertical and the least rotation that tilts the body (swing and twist:
//! Dobrowolski, "Swing-twist decomposition in Clifford algebra", arXiv 1506.05481, 2015). With the body's `level` axis r,
//! vertical while it is level, and the vertical u as the body sees it, the heading ψ changes by ω · (u + r) / (1 + u · r).
//! On a slope of γ that is the rate over cos γ: the integral of ω · u would miss 0.4 % of each turn at 5°.

use nalgebra::Vector3;

use super::evidence::angle_between;
use super::piece::{Candidate, Piece};
use super::prediction::{Ends, motion, rotations};
use super::rotation::seen_after;
use super::whole_turn::TILTED;

/// Change of heading along a turn by a gyroscope that is not calibrated, rad, whole turns counted.
pub fn heading_seen(pieces: &[Piece], ends: &Ends, level: &Vector3<f64>) -> f64 {
    motion(pieces.iter(), &Candidate::default(), ends).vertical + heading_excess(pieces, ends, level)
}

/// What the change of heading is more than the integral of the rate about the vertical, rad. It is of second order in the
/// tilt, so that no calibrated gyroscope is needed.
pub fn heading_excess(pieces: &[Piece], ends: &Ends, level: &Vector3<f64>) -> f64 {
    /// Least 1 + u · r: heading has no meaning for a body that lies upside down.
    const LEAST: f64 = 0.1;
    let mut up = ends.up[0];
    let mut excess = 0.0;
    for turn in rotations(pieces.iter(), &Candidate::default(), ends) {
        let next = seen_after(&turn, &up);
        let middle = (up + next) / 2.0;
        excess += turn.dot(&((middle + level) / (1.0 + middle.dot(level)).max(LEAST) - up));
        up = next;
    }
    excess
}

/// Axis of a body that is vertical while it is level, unit vector: the mean of the directions of specific force at its
/// rests, of those that are near one of them.
pub fn level_axis(near: &Vector3<f64>, ups: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let sum: Vector3<f64> = ups.filter(|up| angle_between(up, near) <= TILTED).sum();
    sum.try_normalize(f64::MIN_POSITIVE).unwrap_or(*near)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::{Matrix3, Rotation3};

    use super::*;

    /// A body that turns about its own z on a slope, so far, in pieces.
    fn on_slope(slope: f64, angle: f64) -> (Vec<Piece>, Ends) {
        let count = 50;
        let angle_of_piece = Vector3::z() * (angle / f64::from(count));
        let piece = Piece { angle: angle_of_piece, seconds: 0.1, ..Piece::default() };
        let before = Rotation3::from_scaled_axis(Vector3::x() * slope) * Vector3::z();
        let after = Rotation3::from_scaled_axis(Vector3::z() * -angle) * before;
        let ends = Ends { up: [before, after], rate: [Vector3::zeros(); 2], by_up: Matrix3::zeros() };
        (vec![piece; count as usize], ends)
    }

    #[test]
    fn heading_on_a_slope_is_the_rotation_about_the_body_s_own_axis() {
        for (slope, angle) in [(0.0, TAU), (0.1, TAU), (0.2, 1.0), (-0.1, -3.0)] {
            let (pieces, ends) = on_slope(slope, angle);
            let seen = heading_seen(&pieces, &ends, &Vector3::z());
            assert!((seen - angle).abs() < 1e-9, "{slope} {angle}: {seen}");
            let vertical = seen - heading_excess(&pieces, &ends, &Vector3::z());
            assert!((vertical - angle * slope.cos()).abs() < 1e-9, "{slope} {angle}: {vertical}");
        }
    }

    #[test]
    fn a_whole_turn_on_a_slope_is_one_whatever_is_taken_for_level() {
        let (pieces, ends) = on_slope(0.1, TAU);
        for level in [ends.up[0], Vector3::new(0.03, -0.05, 1.0).normalize()] {
            let seen = heading_seen(&pieces, &ends, &level);
            assert!((seen - TAU).abs() < 1e-5, "{seen}");
        }
    }

    #[test]
    fn level_is_the_mean_of_the_rests_that_lie_alike() {
        let (_, ends) = on_slope(0.1, TAU / 2.0);
        let level = level_axis(&ends.up[0], ends.up.into_iter().chain([Vector3::x(), -Vector3::z()]));
        assert!((level - Vector3::z()).norm() < 1e-12, "{level}");
    }
}
