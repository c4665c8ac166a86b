//! Declarations of a turn's rotation about the vertical, and those that could be made.

use std::f64::consts::TAU;

use crate::turns::{Contradiction, Ends, Piece, contradiction, whole_turn};

/// Statement on a turn's rotation about the vertical; angles in rad, counterclockwise seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Declaration {
    Nothing,
    /// The rotation that it was.
    Declared(f64),
    /// A rotation that it was not.
    Contradicted(f64, Contradiction),
    /// The whole turns of a table that it may have been.
    Possible(f64),
}

impl Declaration {
    /// Declaration of a turn by its time, or as whole turns of a table.
    pub(super) fn of(pieces: &[Piece], ends: &Ends, by_time: Option<f64>, whole_turns: bool) -> Self {
        match by_time {
            Some(angle) => {
                contradiction(pieces, ends, angle).map_or(Self::Declared(angle), |why| Self::Contradicted(angle, why))
            }
            None => match whole_turn(pieces, ends) {
                Some(angle) if whole_turns => Self::Declared(angle),
                Some(angle) => Self::Possible(angle),
                None => Self::Nothing,
            },
        }
    }

    /// Rotation that the turn was, rad.
    pub(super) fn angle(&self) -> Option<f64> {
        if let Self::Declared(angle) = self { Some(*angle) } else { None }
    }

    /// Text on a turn during these times, s since the first reading, in which `seen` rad about the vertical were seen;
    /// `before` is what else there is to say.
    pub(super) fn explain(&self, before: &str, seen: f64, [start, end]: [f64; 2]) -> String {
        let more = match self {
            Self::Nothing | Self::Declared(_) => return before.to_owned(),
            Self::Contradicted(angle, why) => {
                format!("declared as {:.1}° about the vertical, and not used as such: {why}", angle.to_degrees())
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
