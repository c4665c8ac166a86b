//! What is known of a turn's rotation about the vertical, and what could be declared.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::turns::{Contradiction, Ends, KnownRotation, Piece, whole_turn};

/// Statement on a turn's rotation about the vertical; angles in rad, counterclockwise seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Declaration {
    Nothing,
    /// The rotation that it was.
    Known(KnownRotation),
    /// A rotation that it was not.
    Contradicted(KnownRotation, Contradiction),
    /// The whole turns of a table that it may have been.
    Possible(f64),
}

impl Declaration {
    /// Statement on a turn of which this is known, or which may be whole turns of a table. `level` is the axis of the body
    /// that is vertical while it is level.
    pub(super) fn of(
        pieces: &[Piece],
        ends: &Ends,
        known: Option<KnownRotation>,
        level: &Vector3<f64>,
        whole_turns: bool,
    ) -> Self {
        match known {
            Some(known) => match known.checked(pieces, ends, level) {
                Ok(known) => Self::Known(known),
                // A body that turns over has no heading on the way, and that is no fault of it.
                Err(Contradiction::Tilted(_)) if known.heading_std.is_some() => Self::Nothing,
                Err(why) => Self::Contradicted(known.wrapped(), why),
            },
            None => match whole_turn(pieces, ends) {
                Some(angle) if whole_turns => Self::Known(KnownRotation::declared(angle)),
                Some(angle) => Self::Possible(angle),
                None => Self::Nothing,
            },
        }
    }

    /// Rotation that the turn was.
    pub(super) fn known(&self) -> Option<KnownRotation> {
        if let Self::Known(known) = self { Some(*known) } else { None }
    }

    /// Text on a turn during these times, s since the first reading, in which `seen` rad about the vertical were seen;
    /// `before` is what else there is to say.
    pub(super) fn explain(&self, before: &str, seen: f64, [start, end]: [f64; 2]) -> String {
        let more = match self {
            Self::Nothing | Self::Known(_) => return before.to_owned(),
            Self::Contradicted(known, why) => {
                let angle = known.angle.to_degrees();
                match known.heading_std {
                    Some(_) => format!("its heading changed by {angle:.1}°, which is not used: {why}"),
                    None => format!("declared as {angle:.1}° about the vertical, and not used as such: {why}"),
                }
            }
            Self::Possible(whole) => {
                let turns = match (whole / TAU).abs().round() {
                    1.0 => "one whole turn".to_owned(),
                    turns => format!("{turns} whole turns"),
                };
                format!(
                    "{:.1}° about the vertical; if it was {turns} of a table, fit.whole_turns = true uses it beside turns from \
                     face to face, or fit.rotations = [{{ begin_s = {start:.1}, end_s = {end:.1}, angle_deg = {:.0} }}] it alone",
                    seen.to_degrees(),
                    whole.to_degrees()
                )
            }
        };
        if before.is_empty() { more } else { format!("{before}; {more}") }
    }
}
