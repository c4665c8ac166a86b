//! Rotations about the vertical that are declared, against what the gyroscope saw.

use super::piece::{Candidate, Piece};
use super::prediction::{Ends, furthest, motion};
use super::whole_turn::TILTED;

/// Largest error of the rotation by a gyroscope that is not calibrated, as a share of its path.
const OFF: f64 = 0.08;
/// Error that is always granted, rad: three times that of a mark.
const MARKS: f64 = 0.026;

/// Reason why a turn was not the rotation about the vertical that it is declared to be.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Contradiction {
    /// Another rotation was seen, rad.
    #[error("{:.1}° were seen (counterclockwise from above is positive)", .0.to_degrees())]
    Otherwise(f64),
    /// More was turned than the gyroscope counts whole turns of, which a heading does not show, rad.
    #[error("{:.0}° were seen, too many to count whole turns by", .0.to_degrees())]
    Uncounted(f64),
    /// It was tilted, so that its rotation about the vertical depends on the way, rad.
    #[error("it was tilted by {:.0}° on the way: turn it on a table", .0.to_degrees())]
    Tilted(f64),
}

/// Reason why a turn was not the rotation about the vertical by `declared`, rad, counterclockwise seen from above; `None`
/// if it may have been.
pub fn contradiction(pieces: &[Piece], ends: &Ends, declared: f64) -> Option<Contradiction> {
    contradiction_beyond(pieces, ends, declared, 0.0)
}

/// The same for a rotation that is itself known to within `error`, rad.
pub(super) fn contradiction_beyond(pieces: &[Piece], ends: &Ends, declared: f64, error: f64) -> Option<Contradiction> {
    let perfect = Candidate::default();
    let tilt = furthest(pieces.iter(), &perfect, ends);
    if tilt > TILTED {
        return Some(Contradiction::Tilted(tilt));
    }
    let seen = motion(pieces.iter(), &perfect, ends).vertical;
    let near = (seen - declared).abs() <= seen_to_within(pieces, declared) + error;
    (!near).then_some(Contradiction::Otherwise(seen))
}

/// Largest error of the rotation about the vertical that is seen of a turn by so much, rad.
pub(super) fn seen_to_within(pieces: &[Piece], angle: f64) -> f64 {
    let path: f64 = pieces.iter().map(|piece| piece.angle.norm()).sum();
    OFF * path.max(angle.abs()) + MARKS
}
