//! Declared rotations and headings that are of no use, and why.

use super::declaration::Declaration;
use super::headings::Headings;
use super::turn_verdict::View;
use crate::fit::RotationConfig;
use crate::imu::HeadingConfig;
use crate::messages::turn::Reason;
use crate::turns::{Candidate, Contradiction, Turn, contradiction, motion};

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

    /// Text on headings that are of no use: all of them, or those of some turns. Where there are none, whoever reads the topic
    /// knows why.
    pub(super) fn unused_headings(&self, headings: &Headings, config: &HeadingConfig) -> Option<String> {
        if headings.are_none() {
            return None;
        }
        let why = headings
            .why_none()
            .map(str::to_owned)
            .or_else(|| self.solution.heading_doubt.as_ref().map(|doubt| doubt.text(config)));
        match why {
            Some(why) => Some(format!("fit.heading: {} is not used: it {why}", config.topic)),
            None => self.unused_of_turns().map(|text| format!("fit.heading: {} {text}", config.topic)),
        }
    }

    /// Text on the turns that go without their heading, or on there being none with one.
    fn unused_of_turns(&self) -> Option<String> {
        let believed = self.believed();
        let all: Vec<_> = believed.iter().filter_map(|turn| self.contradicted(turn)).collect();
        if all.is_empty() {
            let unusable = |turn| Some(format!("{}: {}", self.told(turn), turn.unusable(self.range)?));
            return Some(match believed.iter().find_map(unusable) {
                Some(why) => format!("shows no turn that can be used; the first, {why}"),
                None => "shows no turn between two accepted rests: stop for three seconds and longer, turn, and stop \
                         again"
                    .to_owned(),
            });
        }
        let mut wrong = all.iter().flatten();
        let (first, count) = (wrong.next()?, all.iter().flatten().count());
        Some(format!("contradicts {count} of {} turns, which go without it; the first: {first}", all.len()))
    }

    /// Text on a turn whose heading contradicts it, if it has one; empty if it does not.
    fn contradicted(&self, turn: &Turn<'_>) -> Option<Option<String>> {
        let pieces = turn.pieces();
        let ends = self.ends(turn).filter(|_| turn.unusable(None).is_none() && turn.resolves(1.0))?;
        match self.declaration(turn, &pieces, &ends).0 {
            Declaration::Known(known) if known.heading_std.is_some() => Some(None),
            // One that is too long to count its whole turns contradicts nothing.
            Declaration::Contradicted(_, Contradiction::Uncounted(_)) => None,
            Declaration::Contradicted(known, _) if known.heading_std.is_some() => {
                let angle = known.angle.to_degrees();
                Some(Some(format!("{angle:.1}° by its heading from {}", self.told(turn))))
            }
            _ => None,
        }
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
