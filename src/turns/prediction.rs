//! Where gravity must be after a turn, if it was known before and the gyroscope has such a sensitivity.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::piece::{Candidate, Piece};
use super::rotation::{exp, exp_and_right_jacobian};

/// What is known of the rests at both ends of a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// Directions of specific force before and after, unit vectors in the sensor's axes.
    pub up: [Vector3<f64>; 2],
    /// Mean rates, rad/s.
    pub rate: [Vector3<f64>; 2],
    /// Sensitivity of the rate to specific force along a unit vector, rad/s. It is in the mean rates already; on the way
    /// specific force points elsewhere.
    pub by_up: Matrix3<f64>,
}

/// What is known of the end of a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Direction of specific force, unit vector.
    pub up: Vector3<f64>,
    /// How it moves with the entries of C, row by row.
    pub by_inverse: SMatrix<f64, 3, 9>,
    /// How it moves with the direction before: the rotation of the turn, transposed.
    pub by_up: Matrix3<f64>,
    /// How it moves with a rate that is added all along, s.
    pub by_rate: Matrix3<f64>,
}

/// Follows specific force along a turn.
///
/// A piece whose rotation vector errs by δ errs by R J δ in the axes before the turn, R being the attitude behind it and J
/// its right Jacobian. There the errors of the pieces add up.
pub fn predict<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Prediction {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut attitude = Matrix3::identity();
    let mut by_inverse = SMatrix::<f64, 3, 9>::zeros();
    let mut by_rate = Matrix3::zeros();
    let mut since = 0.0;
    for piece in pieces {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        let between = |ends: &[Vector3<f64>; 2]| ends[0] * (1.0 - share) + ends[1] * share;
        // The mean rates hold what specific force adds where the rests are; here it adds this much more.
        let bias = between(&ends.rate) + ends.by_up * (attitude.tr_mul(&ends.up[0]) - between(&ends.up));
        let piece = piece.without(&bias);
        let (rotation, jacobian) = exp_and_right_jacobian(&piece.rotation(candidate));
        attitude *= rotation;
        let push = attitude * jacobian;
        add_by_inverse(&mut by_inverse, &push, &piece);
        by_rate += push * piece.seconds;
    }
    let back = attitude.transpose();
    let across = back * ends.up[0].cross_matrix();
    Prediction {
        up: back * ends.up[0],
        by_inverse: across * by_inverse,
        by_up: back,
        by_rate: across * by_rate * candidate.inverse(),
    }
}

/// Adds `push` · ∂(rotation vector)/∂C, row by row. The cofactors of C = I + δ are I + tr δ − δᵀ to first order, and so they
/// are around any other C that is near.
fn add_by_inverse(sum: &mut SMatrix<f64, 3, 9>, push: &Matrix3<f64>, piece: &Piece) {
    let coning = push * piece.coning;
    for row in 0..3 {
        let along = push.column(row);
        for column in 0..3 {
            let mut entry = sum.column_mut(3 * row + column);
            entry += along * piece.angle[column] - push.column(column) * piece.coning[row];
            if row == column {
                entry += coning;
            }
        }
    }
}

/// The furthest that specific force comes from where it was before a turn, rad.
pub fn furthest<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> f64 {
    let (start, mut up, mut least) = (ends.up[0], ends.up[0], 1.0_f64);
    for turn in rotations(pieces, candidate, ends) {
        up = exp(&turn).tr_mul(&up);
        least = least.min(start.dot(&up));
    }
    libm::acos(least.clamp(-1.0, 1.0))
}

/// Where specific force points after a turn and on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// Direction after it, unit vector.
    pub up: Vector3<f64>,
    /// Mean of the directions on the way.
    pub mean: Vector3<f64>,
}

/// Follows the direction of specific force along a turn, and nothing else.
pub fn follow<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Followed {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let (mut up, mut since, mut sum) = (ends.up[0], 0.0, Vector3::zeros());
    for piece in pieces {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        let bias = ends.rate[0] * (1.0 - share) + ends.rate[1] * share;
        let next = exp(&piece.without(&bias).rotation(candidate)).tr_mul(&up);
        sum += (up + next) * (piece.seconds / 2.0);
        up = next;
    }
    Followed { up, mean: sum / total }
}

/// How the sensor turned, all in all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Of the whole rotation, 0 to π, rad.
    pub angle: f64,
    /// Of the whole rotation, unit vector in the sensor's axes before it; x where it did not turn.
    pub axis: Vector3<f64>,
    /// Rotation about the vertical, counterclockwise seen from above, whole turns counted, rad.
    pub vertical: f64,
}

/// Adds up a turn.
pub fn motion<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Motion {
    let (mut attitude, mut vertical) = (UnitQuaternion::identity(), 0.0);
    let mut up = ends.up[0];
    for turn in rotations(pieces, candidate, ends) {
        // Gravity keeps its part along the axis that it turns about.
        vertical += turn.dot(&up);
        up = exp(&turn).tr_mul(&up);
        attitude *= UnitQuaternion::from_scaled_axis(turn);
    }
    let (axis, angle) = attitude.axis_angle().unwrap_or((Vector3::x_axis(), 0.0));
    Motion { angle, axis: axis.into_inner(), vertical }
}

/// Rotation vectors of the pieces, less the mean rates at the ends, rad.
fn rotations<'a>(
    pieces: impl Iterator<Item = &'a Piece> + Clone,
    candidate: &Candidate,
    ends: &Ends,
) -> impl Iterator<Item = Vector3<f64>> {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut since = 0.0;
    pieces.map(move |piece| {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        piece.without(&(ends.rate[0] * (1.0 - share) + ends.rate[1] * share)).rotation(candidate)
    })
}
