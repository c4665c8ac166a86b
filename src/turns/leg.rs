//! The way from one rest to the next, and several of them as one turn. Which rests are to be believed is left to the
//! caller.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::piece::Piece;
use super::preintegrator::{Integrals, Preintegrator, Stretch};
use crate::Stamp;

/// From one rest to the next, whatever is thought of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    /// When the rest began that it leaves …
    pub from: Stamp,
    /// … and the one that it comes to.
    pub to: Stamp,
    /// What lies between them; empty once that was forgotten.
    pub(super) pieces: Vec<Integrals>,
    /// The inside of the rest that it comes to.
    pub(super) rest: Option<Integrals>,
    /// All of it as one, of which the integrals are worth little.
    pub(super) sum: Stretch,
}

impl Leg {
    /// Puts neighbouring pieces together as long as they are short.
    pub(super) fn coarsen(&mut self) {
        /// Of their angles, rad.
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

    /// Keeps what it was like, and not which way it went.
    pub(super) fn forget(&mut self) {
        self.pieces = Vec::new();
    }
}

/// Why a turn says nothing of the gyroscope.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unusable {
    /// In it.
    #[error("readings are missing")]
    Gap,
    /// In it.
    #[error("the stamps break")]
    Stamps,
    /// Readings stopped at an end of the range.
    #[error("the rate reached the end of the range: turn it more slowly, or set a wider range")]
    Clipped,
    /// The bias wanders meanwhile.
    #[error("it lasted more than 20 s")]
    TooLong,
    /// It was too long ago, or too long a way.
    #[error("it was too long ago, or too long a way, to be remembered")]
    Forgotten,
}

/// A turn from a rest that is believed to the next that is.
#[derive(Clone, Debug)]
pub struct Turn<'a> {
    /// When the rests began that it connects.
    pub from: Stamp,
    /// The one after.
    pub to: Stamp,
    /// The legs that it is made of.
    pub(super) legs: &'a [Leg],
    /// All of it as one, of which the integrals are worth nothing.
    sum: Stretch,
    /// Largest reading of the stream, rad/s.
    pub(super) peak: f64,
}

impl<'a> Turn<'a> {
    /// Of legs that follow each other.
    pub(super) fn of(legs: &'a [Leg], peak: f64) -> Option<Self> {
        let (first, last) = (legs.first()?, legs.last()?);
        let sum = legs.iter().skip(1).fold(first.sum, |sum, leg| sum.then(&leg.sum));
        Some(Self { from: first.from, to: last.to, legs, sum, peak })
    }

    /// What it is made of, in order; the rests within it are among them.
    pub fn pieces(&self) -> Vec<Piece> {
        let last = self.legs.len() - 1;
        let legs = self.legs.iter().enumerate();
        let pieces = legs.flat_map(|(i, leg)| leg.pieces.iter().chain(leg.rest.iter().filter(move |_| i < last)));
        pieces.map(Integrals::piece).collect()
    }

    /// When the motion began and ended, as far as pieces tell.
    pub fn span(&self) -> (Stamp, Stamp) {
        (self.sum.start, self.sum.end)
    }

    /// Seconds.
    pub fn seconds(&self) -> f64 {
        self.sum.end.seconds_since(self.sum.start)
    }

    /// ∫ ‖ω‖ dt of the raw rates, rad.
    pub fn path(&self) -> f64 {
        f64::from(self.sum.path)
    }

    /// Mean specific force on the way, m/s²; `None` if it rested in between.
    pub fn force(&self) -> Option<Vector3<f64>> {
        self.sum.force().filter(|_| self.legs.len() == 1)
    }

    /// Largest raw reading, rad/s.
    pub fn peak(&self) -> f64 {
        f64::from(self.sum.peak)
    }

    /// Variance of the angle about an axis by what changes faster than the samples follow, rad²: a twelfth of the second
    /// differences is what an interpolation by them would change.
    pub fn roughness(&self) -> f64 {
        f64::from(self.sum.roughness) / 72.0
    }

    /// Why it says nothing of the gyroscope, whose range may be known.
    pub fn unusable(&self, range: Option<f64>) -> Option<Unusable> {
        /// Seconds.
        const LONGEST: f64 = 20.0;
        const GAP: f32 = 0.1;
        /// Of a range.
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

    /// Whether its pieces are short enough for rates whose unit is so many rad/s.
    pub fn resolves(&self, unit: f64) -> bool {
        /// Beyond it the second order says too little, rad.
        const LONGEST: f64 = 0.5;
        self.pieces().iter().all(|piece| unit * piece.angle.norm() <= LONGEST)
    }
}
