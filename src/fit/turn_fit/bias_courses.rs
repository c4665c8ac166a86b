//! Equations of turns on an accelerometer's bias that changes from rest to rest.

use nalgebra::{DMatrix, DVector, SVector};

use super::equations::{DATASHEET, UNKNOWNS};

/// Linearised equations of turns, weighted so that their errors are independent and of unit variance:
/// `design · δ + Σ by_rest · change ≈ targets`, with the unknowns less [`at`](Self::at).
#[derive(Clone, Debug)]
pub struct BiasCourses {
    /// Unknowns about which the equations are linearised: entries of the gyroscope's C less I, then the accelerometer's
    /// parameters in the order of [`Parameterisation::TRIANGULAR`](crate::fit::Parameterisation::TRIANGULAR).
    pub(in crate::fit) at: SVector<f64, UNKNOWNS>,
    pub(in crate::fit) targets: DVector<f64>,
    pub(in crate::fit) design: DMatrix<f64>,
    /// Time of each rest, s, with the derivatives of the equations by the bias during it: equations × 3.
    pub(in crate::fit) rests: Vec<(f64, DMatrix<f64>)>,
}

impl BiasCourses {
    /// Number of unknowns before those of the accelerometer.
    pub(in crate::fit) const BEFORE: usize = 9;

    /// Prior standard deviation of an entry of an inverse sensitivity.
    pub(in crate::fit) const PRIOR: f64 = DATASHEET;

    /// Moves the zero of time by so many seconds into the past.
    pub fn later(mut self, seconds: f64) -> Self {
        self.rests.iter_mut().for_each(|(time, _)| *time += seconds);
        self
    }
}
