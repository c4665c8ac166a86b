//! Where gravity must be after a turn, if it was known before and the gyroscope has such a sensitivity.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::piece::{Candidate, Piece};
use super::rotation::{exp, right_jacobian};

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
    /// The furthest that it came from where it began, rad.
    pub furthest: f64,
}

/// Follows specific force along a turn.
pub fn predict<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Prediction {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut at = Prediction {
        up: ends.up[0],
        by_inverse: SMatrix::zeros(),
        by_up: Matrix3::identity(),
        by_rate: Matrix3::zeros(),
        furthest: 0.0,
    };
    let mut since = 0.0;
    for piece in pieces {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        let between = |ends: &[Vector3<f64>; 2]| ends[0] * (1.0 - share) + ends[1] * share;
        // The mean rates hold what specific force adds where the rests are; here it adds this much more.
        let bias = between(&ends.rate) + ends.by_up * (at.up - between(&ends.up));
        let piece = piece.without(&bias);
        let turn = piece.rotation(candidate);
        let back = exp(&turn).transpose();
        at.up = back * at.up;
        let push = at.up.cross_matrix() * right_jacobian(&turn);
        at.by_inverse = back * at.by_inverse + push * by_inverse(&piece, candidate);
        at.by_up = back * at.by_up;
        at.by_rate = back * at.by_rate + push * candidate.inverse() * piece.seconds;
        at.furthest = at.furthest.max(libm::atan2(ends.up[0].cross(&at.up).norm(), ends.up[0].dot(&at.up)));
    }
    at
}

/// Where specific force points behind a turn, unit vector, and nothing else.
pub fn follow<'a>(pieces: impl Iterator<Item = &'a Piece> + Clone, candidate: &Candidate, ends: &Ends) -> Vector3<f64> {
    let total: f64 = pieces.clone().map(|piece| piece.seconds).sum::<f64>().max(f64::MIN_POSITIVE);
    let (mut up, mut since) = (ends.up[0], 0.0);
    for piece in pieces {
        let share = (since + piece.seconds / 2.0) / total;
        since += piece.seconds;
        let bias = ends.rate[0] * (1.0 - share) + ends.rate[1] * share;
        up = exp(&piece.without(&bias).rotation(candidate)).tr_mul(&up);
    }
    up
}

/// ∂(rotation vector)/∂C, row by row. The cofactors of C = I + δ are I + tr δ − δᵀ to first order, and so they are around any
/// other C that is near.
fn by_inverse(piece: &Piece, candidate: &Candidate) -> SMatrix<f64, 3, 9> {
    let inverse = candidate.inverse();
    let mut by = SMatrix::<f64, 3, 9>::zeros();
    for row in 0..3 {
        for column in 0..3 {
            let mut moved = Vector3::zeros();
            moved[row] += piece.angle[column];
            // ∂cof(C)/∂C_rc: the cofactors of the rows r+1 and r+2 hold row r.
            let [next, last] = [(row + 1) % 3, (row + 2) % 3];
            let unit = Vector3::ith(column, 1.0);
            let (a, b) = (inverse.row(next).transpose(), inverse.row(last).transpose());
            moved[next] += b.cross(&unit).dot(&piece.coning);
            moved[last] += unit.cross(&a).dot(&piece.coning);
            by.set_column(3 * row + column, &moved);
        }
    }
    by
}
