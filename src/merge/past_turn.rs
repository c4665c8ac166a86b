//! Turn of one sensor in one of any number of recordings, with the rests at its ends.
//!
//! The turn that is declared, or else rotated gravity the most, stands for a span of time and for the faces of a cube
//! that were up before and after it.

use std::cmp::Ordering;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::past_rest::PastRest;
use super::thinned_set::{Member, ThinnedSet};
use crate::engine::PastTurn as Motion;

/// Turns of one sensor.
pub type TurnSet = ThinnedSet<PastTurn>;

/// A turn, and the rests of its recording that it lies between.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PastTurn {
    /// The motion.
    pub motion: Motion,
    /// Rests before and after it.
    pub rests: [PastRest; 2],
}

impl PastTurn {
    /// Turn between two of these rests of its recording, which are in order of their starts; `None` if it does not lead
    /// from one to another.
    pub fn between(motion: Motion, rests: &[PastRest]) -> Option<Self> {
        let of = |time| {
            let behind = rests.partition_point(|past| past.rest.start <= time);
            rests.get(behind.checked_sub(1)?).filter(|past| time <= past.rest.end).cloned()
        };
        let ends = [of(motion.start)?, of(motion.end)?];
        (ends[0].rest.end < ends[1].rest.start).then_some(Self { motion, rests: ends })
    }

    /// Cosine of the angle by which gravity turned.
    fn cosine(&self) -> f64 {
        let [before, after] = self.rests.each_ref().map(|past| past.rest.accelerometer.mean);
        before.dot(&after) / (before.norm() * after.norm()).max(f64::MIN_POSITIVE)
    }

    /// Every number of the motion.
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let Motion { pieces, seconds, path, roughness, declared, declared_std, .. } = &self.motion;
        let pieces = pieces.iter().flat_map(|piece| {
            [piece.angle, piece.coning, piece.moment]
                .into_iter()
                .flat_map(Into::<[f64; 3]>::into)
                .chain([piece.seconds])
        });
        let known = [declared, declared_std].map(|number| number.unwrap_or_default());
        [*path, *seconds, *roughness].into_iter().chain(known).chain(pieces)
    }
}

/// Face of a cube that points up most.
fn face(force: &Vector3<f64>) -> [i8; 3] {
    let mut face = [0; 3];
    let axis = force.iamax();
    face[axis] = if force[axis] < 0.0 { -1 } else { 1 };
    face
}

impl Member for PastTurn {
    /// Faces of a cube that were up before and after it: few enough that many spans of time remain.
    type Pose = [[i8; 3]; 2];
    /// As many as a fit needs by far: one of them takes two kilobytes.
    const MOST: usize = 512;

    fn start(&self) -> i64 {
        self.motion.start.nanos()
    }

    fn pose(&self) -> [[i8; 3]; 2] {
        self.rests.each_ref().map(|past| face(&past.rest.accelerometer.mean))
    }

    fn rank(&self, other: &Self) -> Ordering {
        let span = |turn: &Self| (turn.motion.start, turn.motion.end, turn.motion.pieces.len());
        let rests = || self.rests.iter().zip(&other.rests).map(|(mine, theirs)| mine.rank(theirs));
        // A declared one shows what no other does; of two ways, the shorter shows more.
        let is_declared = |turn: &Self| turn.motion.declared.is_some();
        is_declared(self)
            .cmp(&is_declared(other))
            .then_with(|| other.cosine().total_cmp(&self.cosine()))
            .then_with(|| other.motion.path.total_cmp(&self.motion.path))
            .then_with(|| span(self).cmp(&span(other)))
            .then_with(|| {
                self.numbers().zip(other.numbers()).map(|(a, b)| a.total_cmp(&b)).fold(Ordering::Equal, Ordering::then)
            })
            .then_with(|| rests().fold(Ordering::Equal, Ordering::then))
    }
}
