//! A stretch of motion, integrated so that bias and sensitivity can be applied afterwards.

use nalgebra::{Matrix3, Vector3};

/// Integrals of the raw rate ω over a time T, t running from 0 to T, in the sensor's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Piece {
    /// α = ∫ ω dt, rad.
    pub angle: Vector3<f64>,
    /// β = ½ ∬ ω(t₂) × ω(t₁), t₂ before t₁, rad²: the coning.
    pub coning: Vector3<f64>,
    /// μ = ∫ (2t − T) ω dt, rad s: what a change of bias changes the coning by.
    pub moment: Vector3<f64>,
    /// T, s.
    pub seconds: f64,
}

impl Piece {
    /// This one and the next as one. The integrals are exact; the longer a piece, the more of it is beyond second order.
    pub fn then(&self, next: &Self) -> Self {
        Self {
            angle: self.angle + next.angle,
            coning: self.coning + next.coning + self.angle.cross(&next.angle) / 2.0,
            moment: self.moment + next.moment - self.angle * next.seconds + next.angle * self.seconds,
            seconds: self.seconds + next.seconds,
        }
    }

    /// The same of rates that were a bias (rad/s) less.
    pub fn without(&self, bias: &Vector3<f64>) -> Self {
        Self { angle: self.angle - bias * self.seconds, coning: self.coning - bias.cross(&self.moment) / 2.0, ..*self }
    }

    /// Rotation vector of the attitude after in the frame before, rad, to second order in the rates, of a gyroscope whose
    /// bias was taken out.
    pub fn rotation(&self, candidate: &Candidate) -> Vector3<f64> {
        candidate.inverse * self.angle + candidate.cofactors * self.coning
    }
}

/// A sensitivity S of the gyroscope to be tried: `true = S⁻¹ (measured − bias)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// C = S⁻¹.
    inverse: Matrix3<f64>,
    /// Cofactors of C, by which a cross product of vectors that C maps is mapped.
    cofactors: Matrix3<f64>,
}

impl Candidate {
    /// Of C = S⁻¹.
    pub fn of_inverse(inverse: Matrix3<f64>) -> Self {
        let [x, y, z] = [0, 1, 2].map(|row| inverse.row(row).transpose());
        let cofactors = [y.cross(&z), z.cross(&x), x.cross(&y)].map(|row| row.transpose());
        Self { inverse, cofactors: Matrix3::from_rows(&cofactors) }
    }

    /// C = S⁻¹.
    pub fn inverse(&self) -> &Matrix3<f64> {
        &self.inverse
    }
}

impl Default for Candidate {
    /// A perfect gyroscope.
    fn default() -> Self {
        Self::of_inverse(Matrix3::identity())
    }
}
