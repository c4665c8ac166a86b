//! Motion from one rest to the next (leg), and several legs as one turn.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::piece::Piece;
use super::preintegrator::{Integrals, Preintegrator, Stretch};
use crate::Stamp;

/// Leg: motion from one rest to the next, whether or not these are accepted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    /// Start of the rest that it leaves …
    pub from: Stamp,
    /// … and of the rest that it reaches.
    pub to: Stamp,
    /// Pieces between the rests; empty once dropped.
    pub(super) pieces: Vec<Integrals>,
    /// Integral over the rest that it reaches.
    pub(super) rest: Option<Integrals>,
    /// Summary of the leg; its integrals are too long to be accurate.
    pub(super) sum: Stretch,
}

impl Leg {
    /// Merges pairs of neighbouring pieces as long as they are short.
    pub(super) fn coarsen(&mut self) {
        /// Largest sum of the angles of a pair, rad.
        const SHORT: f64 = 0.25;
        let mut coarser: Vec<Integrals> = Vec::with_capacity(self.pieces.len());
        let mut single = false;
        for piece in &self.pieces {
            let angle = |piece: &Integrals| piece.piece().angle.norm();
            match coarser.last_mut().filter(|last| single && angle(last) + angle(piece) <= SHORT) {
                Some(last) => {
                    *last = last.then(piece);
                    single = false;
                }
                None => {
                    coarser.push(*piece);
                    single = true;
                }
            }
        }
        coarser.shrink_to_fit();
        self.pieces = coarser;
    }

    /// Drops the pieces, and keeps the summary.
    pub(super) fn forget(&mut self) {
        self.pieces = Vec::new();
    }
}

/// Reason why a turn is of no use for the gyroscope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unusable {
    /// Readings are missing within the turn.
    #[error("readings are missing")]
    Gap,
    /// The stamps break within the turn.
    #[error("the stamps break")]
    Stamps,
    /// Readings stopped at an end of the range.
    #[error("the rate reached the end of the range: turn it more slowly, or set a wider range")]
    Clipped,
    /// The turn is so long that the bias wanders meanwhile.
    #[error("it lasted more than 20 s")]
    TooLong,
    /// The turn was too long ago, or too long a way, to be stored.
    #[error("it was too long ago, or too long a way, to be remembered")]
    Forgotten,
}

/// Turn from an accepted rest to the next accepted one.
#[derive(Clone, Debug)]
pub struct Turn<'a> {
    /// Start of the rest before.
    pub from: Stamp,
    /// Start of the rest after.
    pub to: Stamp,
    /// Legs of the turn.
    pub(super) legs: &'a [Leg],
    /// Summary of the turn; its integrals are too long to be of use.
    sum: Stretch,
    /// Largest reading of the stream, rad/s.
    pub(super) peak: f64,
}

impl<'a> Turn<'a> {
    /// Joins legs that follow each other.
    pub(super) fn of(legs: &'a [Leg], peak: f64) -> Option<Self> {
        let (first, last) = (legs.first()?, legs.last()?);
        let sum = legs.iter().skip(1).fold(first.sum, |sum, leg| sum.then(&leg.sum));
        Some(Self { from: first.from, to: last.to, legs, sum, peak })
    }

    /// Pieces of the turn in order, including the rests within it.
    pub fn pieces(&self) -> Vec<Piece> {
        let last = self.legs.len() - 1;
        let legs = self.legs.iter().enumerate();
        let pieces = legs.flat_map(|(i, leg)| leg.pieces.iter().chain(leg.rest.iter().filter(move |_| i < last)));
        pieces.map(Integrals::piece).collect()
    }

    /// Start and end of the motion, as far as the pieces resolve them.
    pub fn span(&self) -> (Stamp, Stamp) {
        (self.sum.start, self.sum.end)
    }

    /// Duration, s.
    pub fn seconds(&self) -> f64 {
        self.sum.end.seconds_since(self.sum.start)
    }

    /// ∫ ‖ω‖ dt of the raw rates, rad.
    pub fn path(&self) -> f64 {
        f64::from(self.sum.path)
    }

    /// Mean specific force during the turn, m/s²; `None` if it rested in between.
    pub fn force(&self) -> Option<Vector3<f64>> {
        self.sum.force().filter(|_| self.legs.len() == 1)
    }

    /// Largest raw reading, rad/s.
    pub fn peak(&self) -> f64 {
        f64::from(self.sum.peak)
    }

    /// Variance of the angle about an axis from changes faster than the samples, rad²: interpolation by second
    /// differences would change the angle by a twelfth of them.
    pub fn roughness(&self) -> f64 {
        f64::from(self.sum.roughness) / 72.0
    }

    /// Reason why the turn is of no use for the gyroscope, whose range may be known.
    pub fn unusable(&self, range: Option<f64>) -> Option<Unusable> {
        /// Largest duration and gap, s.
        const LONGEST: f64 = 20.0;
        const GAP: f32 = 0.1;
        /// Share of a range from which on a reading is clipped.
        const NEAR: f64 = 0.98;
        let pinned = self.sum.pinned >= Preintegrator::CLIPPED && self.peak() >= NEAR * self.peak;
        if self.sum.broken {
            Some(Unusable::Stamps)
        } else if self.sum.gap > GAP {
            Some(Unusable::Gap)
        } else if pinned || range.is_some_and(|range| self.peak() >= NEAR * range) {
            Some(Unusable::Clipped)
        } else if self.seconds() > LONGEST {
            Some(Unusable::TooLong)
        } else if self.legs.iter().any(|leg| leg.pieces.is_empty()) {
            Some(Unusable::Forgotten)
        } else {
            None
        }
    }

    /// Whether its pieces are short enough for rates in units of `unit` rad/s.
    pub fn resolves(&self, unit: f64) -> bool {
        /// Longest piece for which the second order suffices, rad.
        const LONGEST: f64 = 0.5;
        self.pieces().iter().all(|piece| unit * piece.angle.norm() <= LONGEST)
    }
}
