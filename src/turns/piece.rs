//! Piece of motion, integrated so that bias and sensitivity can be applied afterwards.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Integrals of the raw rate ω over a time T, with t from 0 to T, in the sensor's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// Angle α = ∫ ω dt, rad.
    pub angle: Vector3<f64>,
    /// Coning β = ½ ∬ ω(t₂) × ω(t₁), t₂ before t₁, rad².
    pub coning: Vector3<f64>,
    /// Moment μ = ∫ (2t − T) ω dt, rad s: the change of the coning with the bias.
    pub moment: Vector3<f64>,
    /// Duration T, s.
    pub seconds: f64,
}

impl Piece {
    /// Joins this piece and the next. The integrals are exact, but the longer a piece, the more of it is beyond second
    /// order.
    pub fn then(&self, next: &Self) -> Self {
        Self {
            angle: self.angle + next.angle,
            coning: self.coning + next.coning + self.angle.cross(&next.angle) / 2.0,
            moment: self.moment + next.moment - self.angle * next.seconds + next.angle * self.seconds,
            seconds: self.seconds + next.seconds,
        }
    }

    /// Subtracts a bias (rad/s) from the rates.
    pub fn without(&self, bias: &Vector3<f64>) -> Self {
        Self { angle: self.angle - bias * self.seconds, coning: self.coning - bias.cross(&self.moment) / 2.0, ..*self }
    }

    /// Rotation vector of the attitude after the piece in the frame before it, rad, to second order in the rates; for a
    /// gyroscope whose bias is already subtracted.
    pub fn rotation(&self, candidate: &Candidate) -> Vector3<f64> {
        candidate.inverse * self.angle + candidate.cofactors * self.coning
    }
}

/// Candidate for the sensitivity S of the gyroscope: `true = S⁻¹ (measured − bias)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Inverse sensitivity C = S⁻¹.
    inverse: Matrix3<f64>,
    /// Cofactors of C, which map the cross product of two vectors that C maps.
    cofactors: Matrix3<f64>,
}

impl Candidate {
    /// Creates a candidate from C = S⁻¹.
    pub fn of_inverse(inverse: Matrix3<f64>) -> Self {
        let [x, y, z] = [0, 1, 2].map(|row| inverse.row(row).transpose());
        let cofactors = [y.cross(&z), z.cross(&x), x.cross(&y)].map(|row| row.transpose());
        Self { inverse, cofactors: Matrix3::from_rows(&cofactors) }
    }

    /// Inverse sensitivity C = S⁻¹.
    pub fn inverse(&self) -> &Matrix3<f64> {
        &self.inverse
    }
}

impl Default for Candidate {
    /// Creates a perfect gyroscope.
    fn default() -> Self {
        Self::of_inverse(Matrix3::identity())
    }
}
