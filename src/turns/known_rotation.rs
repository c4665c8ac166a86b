//! Rotation about the vertical that a turn is known to be, by a declaration or by a heading reference.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::declared::{Contradiction, contradiction, contradiction_beyond, seen_to_within};
use super::heading::{heading_excess, heading_seen};
use super::piece::Piece;
use super::prediction::Ends;

/// Rotation about the vertical between two rests, counterclockwise seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownRotation {
    /// Angle, rad; whole turns counted.
    pub angle: f64,
    /// Standard deviation of the heading at either rest, rad, if the angle is the change of a heading reference; `None` if
    /// it is declared.
    pub heading_std: Option<f64>,
}

impl KnownRotation {
    /// Rotation as somebody declares it.
    pub fn declared(angle: f64) -> Self {
        Self { angle, heading_std: None }
    }

    /// Change of a heading, up to whole turns.
    pub fn of_heading(change: f64, std: f64) -> Self {
        Self { angle: change, heading_std: Some(std) }
    }

    /// Rotation with its whole turns, unless the gyroscope contradicts it. A heading says nothing of whole turns: the
    /// gyroscope counts them, which errs by less than half a turn on any turn that is short enough to be used, whereas a
    /// reference may be silent or slow on the way. `level` is the body's axis that heading turns about.
    ///
    /// # Errors
    /// What was seen instead.
    pub fn checked(&self, pieces: &[Piece], ends: &Ends, level: &Vector3<f64>) -> Result<Self, Contradiction> {
        let Some(_) = self.heading_std else {
            return contradiction(pieces, ends, self.angle).map_or(Ok(*self), Err);
        };
        let seen = heading_seen(pieces, ends, level);
        let angle = self.angle + ((seen - self.angle) / TAU).round() * TAU;
        if seen_to_within(pieces, angle) + GRANTED * self.std() > COUNTED {
            return Err(Contradiction::Uncounted(seen));
        }
        let excess = heading_excess(pieces, ends, level);
        let contradicts = contradiction_beyond(pieces, ends, angle - excess, GRANTED * self.std());
        contradicts.map_or(Ok(Self { angle, ..*self }), Err)
    }

    /// The same as the integral of the rate about the vertical, which differs where the body is tilted on the way.
    pub fn about_vertical(&self, pieces: &[Piece], ends: &Ends, level: &Vector3<f64>) -> Self {
        match self.heading_std {
            Some(_) => Self { angle: self.angle - heading_excess(pieces, ends, level), ..*self },
            None => *self,
        }
    }

    /// The same by the least angle, if it is the change of a heading, which says nothing of whole turns.
    pub fn wrapped(&self) -> Self {
        match self.heading_std {
            Some(_) => Self { angle: self.angle - (self.angle / TAU).round() * TAU, ..*self },
            None => *self,
        }
    }

    /// Standard deviation of the angle, rad: a mark is met to half a degree, and a heading errs at both rests.
    pub fn std(&self) -> f64 {
        const MARK: f64 = 0.5 * std::f64::consts::PI / 180.0;
        self.heading_std.map_or(MARK, |std| std * std::f64::consts::SQRT_2)
    }
}

/// Largest error of gyroscope and heading with which whole turns are still counted, rad: half of the half turn that would
/// miscount one, so that a heading that is wrong is found out.
const COUNTED: f64 = TAU / 4.0;
/// Error of a heading's change that is always granted, in standard deviations.
const GRANTED: f64 = 3.0;
