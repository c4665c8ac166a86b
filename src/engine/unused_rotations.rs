//! Rotations that are declared by their times and are of no use, and why.

use super::turn_verdict::View;
use crate::fit::RotationConfig;
use crate::messages::turn::Reason;
use crate::turns::{Candidate, Turn, contradiction, motion};

impl View<'_> {
    /// Texts on the rotations that are declared by their times and are of no use, with what was seen instead.
    pub(super) fn unused_rotations(&self) -> Vec<String> {
        let why_not = |rotation: &RotationConfig| {
            let RotationConfig { begin_s, end_s, angle_deg, .. } = rotation;
            let why = self.why_unused(rotation)?;
            let declared =
                format!("fit.rotations declares {angle_deg}° about the vertical from {begin_s} s to {end_s} s");
            Some(format!("{declared}, which is not used: {why}"))
        };
        self.rotations.declared.iter().filter_map(why_not).collect()
    }

    fn why_unused(&self, rotation: &RotationConfig) -> Option<String> {
        let verdicts = self.verdicts();
        let mut meant = verdicts.values().filter(|(turn, _)| self.rotations.means(rotation, turn));
        let between: Vec<_> = meant.clone().filter(|(_, verdict)| verdict.reason != Reason::Unrest).collect();
        match between.as_slice() {
            [] => Some(match meant.next_back() {
                Some((turn, verdict)) => format!("{}: {}", self.told(turn), verdict.explanation),
                None => match self.rotations.nearest(rotation, verdicts.values().map(|(turn, _)| turn)) {
                    Some(nearest) => {
                        format!("nothing turned between two rests then; nearest is {}", self.told(nearest))
                    }
                    None => "no turn between two rests was found".to_owned(),
                },
            }),
            [(turn, verdict)] => match verdict.reason {
                Reason::Used | Reason::Small | Reason::Unreferenced => {
                    let by = self
                        .ends(turn)
                        .and_then(|ends| contradiction(&turn.pieces(), &ends, rotation.angle_deg.to_radians()));
                    by.map(|by| by.to_string())
                }
                _ => Some(verdict.explanation.clone()),
            },
            [(first, _), .., (last, _)] => Some(format!(
                "it holds {} turns with rests between them, from {} to {}: declare each by itself",
                between.len(),
                self.told(first),
                self.told(last)
            )),
        }
    }

    /// Times of a turn and its rotation about the vertical, as text.
    fn told(&self, turn: &Turn<'_>) -> String {
        let [start, end] = self.rotations.times(turn);
        let pieces = turn.pieces();
        let seen = self.ends(turn).filter(|_| turn.unusable(None).is_none());
        let seen = seen.map(|ends| motion(pieces.iter(), &Candidate::default(), &ends).vertical.to_degrees());
        let seen = seen.map(|seen| format!(" ({seen:.1}° about the vertical)")).unwrap_or_default();
        format!("{start:.1} s to {end:.1} s{seen}")
    }
}
