//! Prediction of the direction of gravity after a turn, from that before and a candidate for the gyroscope's
//! sensitivity.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::piece::{Candidate, Piece};
use super::rotation::{exp_and_right_jacobian, seen_after};

/// Rests at both ends of a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ends {
    /// Directions of specific force before and after, unit vectors in the sensor's axes.
    pub up: [Vector3<f64>; 2],
    /// Mean rates before and after, rad/s.
    pub rate: [Vector3<f64>; 2],
    /// Sensitivity of the rate to specific force along a unit vector, rad/s. The mean rates already include it for the
    /// directions at rest, not for those during the turn.
    pub by_up: Matrix3<f64>,
}

/// Predicted state at the end of a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// Direction of specific force, unit vector.
    pub up: Vector3<f64>,
    /// Derivative of the direction with respect to the entries of C, row by row.
    pub by_inverse: SMatrix<f64, 3, 9>,
    /// Derivative of the direction with respect to that before: the rotation of the turn, transposed.
    pub by_up: Matrix3<f64>,
    /// Derivative of the direction with respect to a constant rate added during the turn, s.
    pub by_rate: Matrix3<f64>,
}

/// Predicts the direction of specific force after a turn.
///
/// An error δ of a piece's rotation vector is an error R J δ in the axes before the turn, with R the attitude after the
/// piece and J its right Jacobian. In these axes the errors of the pieces add up.
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
        // The mean rates include the effect of specific force at the rests; here it differs by this much.
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

/// Adds `push` · ∂(rotation vector)/∂C, row by row. The cofactors of C = I + δ are I + tr δ − δᵀ to first order, which
/// also holds around any other C near I.
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

/// Largest angle between specific force during a turn and that before it, rad.
pub fn furthest<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> f64 {
    let (start, mut up, mut least) = (ends.up[0], ends.up[0], 1.0_f64);
    for turn in rotations(pieces, candidate, ends) {
        up = seen_after(&turn, &up);
        least = least.min(start.dot(&up));
    }
    libm::acos(least.clamp(-1.0, 1.0))
}

/// Direction of specific force during and after a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// Direction after the turn, unit vector.
    pub up: Vector3<f64>,
    /// Mean of the directions during the turn.
    pub mean: Vector3<f64>,
}

/// Follows only the direction of specific force along a turn.
pub fn follow<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Followed {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let (mut up, mut since, mut sum) = (ends.up[0], 0.0, Vector3::zeros());
    for piece in pieces {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        let bias = ends.rate[0] * (1.0 - share) + ends.rate[1] * share;
        let next = seen_after(&piece.without(&bias).rotation(candidate), &up);
        sum += (up + next) * (piece.seconds / 2.0);
        up = next;
    }
    Followed { up, mean: sum / total }
}

/// Total rotation of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Angle of the whole rotation, 0 to π, rad.
    pub angle: f64,
    /// Axis of the whole rotation, unit vector in the sensor's axes before it; x if it did not turn.
    pub axis: Vector3<f64>,
    /// Rotation about the vertical, counterclockwise seen from above, whole turns counted, rad.
    pub vertical: f64,
}

/// Sums up the rotation of a turn.
pub fn motion<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Motion {
    let (mut attitude, mut vertical) = (UnitQuaternion::identity(), 0.0);
    let mut up = ends.up[0];
    for turn in rotations(pieces, candidate, ends) {
        // The component of gravity along the axis of rotation stays the same.
        vertical += turn.dot(&up);
        up = seen_after(&turn, &up);
        attitude *= UnitQuaternion::from_scaled_axis(turn);
    }
    let (axis, angle) = attitude.axis_angle().unwrap_or((Vector3::x_axis(), 0.0));
    Motion { angle, axis: axis.into_inner(), vertical }
}

/// Rotation about the vertical along a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertical {
    /// Counterclockwise seen from above, whole turns counted, rad.
    pub angle: f64,
    /// Derivatives with respect to the entries of C, row by row.
    pub by_inverse: SVector<f64, 9>,
    /// Derivatives with respect to a rate that is added all along, s.
    pub by_rate: Vector3<f64>,
}

/// Adds up the rotation about the vertical.
pub fn vertical<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Vertical {
    let mut up = ends.up[0];
    let mut found = Vertical { angle: 0.0, by_inverse: SVector::zeros(), by_rate: Vector3::zeros() };
    for piece in unbiased(pieces, ends) {
        let turn = piece.rotation(candidate);
        found.angle += turn.dot(&up);
        found.by_rate += candidate.inverse().tr_mul(&up) * piece.seconds;
        let coning = up.dot(&piece.coning);
        for (entry, by) in found.by_inverse.iter_mut().enumerate() {
            let (row, column) = (entry / 3, entry % 3);
            *by += up[row] * piece.angle[column] - up[column] * piece.coning[row];
            if row == column {
                *by += coning;
            }
        }
        up = seen_after(&turn, &up);
    }
    found
}

/// Rotation vectors of the pieces, less the mean rates at the ends, rad.
pub(super) fn rotations<'a>(
    pieces: impl Iterator<Item = &'a Piece> + Clone,
    candidate: &Candidate,
    ends: &Ends,
) -> impl Iterator<Item = Vector3<f64>> {
    unbiased(pieces, ends).map(|piece| piece.rotation(candidate))
}

/// The pieces, less the mean rates at the ends.
fn unbiased<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, ends: &Ends) -> impl Iterator<Item = Piece> {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut since = 0.0;
    pieces.map(move |piece| {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        piece.without(&(ends.rate[0] * (1.0 - share) + ends.rate[1] * share))
    })
}
