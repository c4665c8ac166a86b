//! Rotations about the vertical that are known, declared by their times or by a heading reference: which turn each means.

use super::headings::HeadingChanges;
use crate::Stamp;
use crate::fit::RotationConfig;
use crate::turns::{KnownRotation, Turn};

/// Known rotations.
#[derive(Clone, Copy)]
pub(super) struct Rotations<'a> {
    pub(super) declared: &'a [RotationConfig],
    /// First reading, which their times count from.
    pub(super) first: Stamp,
    /// Heading reference, if there is one that is believed.
    pub(super) heading: Option<HeadingChanges<'a>>,
}

impl Rotations<'_> {
    /// Rotation that a turn is known to be; `all` are the turns between neighbouring accepted rests. A declaration counts
    /// more than a heading.
    pub(super) fn of<'t, T: AsRef<[Turn<'t>]>>(
        &self,
        turn: &Turn<'t>,
        all: impl FnOnce() -> T,
    ) -> Option<KnownRotation> {
        // All turns are gone through only where one is meant: there are messages of thousands.
        let is_meant = self.declared.iter().any(|rotation| self.means(rotation, turn));
        let declared = is_meant.then(|| self.declared_of(turn, all().as_ref())).flatten();
        declared.map(KnownRotation::declared).or_else(|| self.heading?.of(turn))
    }

    /// Rotation that a turn is declared to be, rad.
    fn declared_of(&self, turn: &Turn<'_>, all: &[Turn<'_>]) -> Option<f64> {
        let mut meant = self.declared.iter().filter(|rotation| self.means(rotation, turn));
        let rotation = meant.next()?;
        let alone = all.iter().filter(|other| self.means(rotation, other)).count() == 1;
        alone.then(|| rotation.angle_deg.to_radians())
    }

    /// Whether the middle of a turn lies in the span: where motion begins and ends is seen less clearly by a person.
    pub(super) fn means(&self, rotation: &RotationConfig, turn: &Turn<'_>) -> bool {
        let [start, end] = self.times(turn);
        (rotation.begin_s..=rotation.end_s).contains(&((start + end) / 2.0))
    }

    /// Start and end of a turn, s since the first reading.
    pub(super) fn times(&self, turn: &Turn<'_>) -> [f64; 2] {
        let (start, end) = turn.span();
        [start, end].map(|stamp| stamp.seconds_since(self.first))
    }

    /// The turn that is nearest to a rotation in time.
    pub(super) fn nearest<'t, 'a>(
        &self,
        rotation: &RotationConfig,
        turns: impl Iterator<Item = &'t Turn<'a>>,
    ) -> Option<&'t Turn<'a>>
    where
        'a: 't,
    {
        let middle = (rotation.begin_s + rotation.end_s) / 2.0;
        let off = |turn: &Turn<'_>| (self.times(turn).iter().sum::<f64>() / 2.0 - middle).abs();
        turns.min_by(|one, other| off(one).total_cmp(&off(other)))
    }
}
