//! Rests and turns as the fit takes them.

use nalgebra::{Matrix3, Vector3};

use crate::fit::calibration::Calibration;
use crate::turns::{Ends, KnownRotation, Piece, level_axis, whole_turn};

/// Readings of the sensors at a rest.
#[derive(Clone, Debug)]
pub struct RestSeen {
    /// Raw specific force at the start and at the end of the rest, m/s².
    pub force: [Vector3<f64>; 2],
    /// Variance of the force from noise, per axis, (m/s²)².
    pub force_noise: Vector3<f64>,
    /// Raw mean rate, rad/s.
    pub rate: Vector3<f64>,
    /// Part of it that is the change of the bias with temperature, rad/s.
    pub rate_taken_off: Vector3<f64>,
    /// Variance of the rate from noise, per axis, (rad/s)².
    pub rate_noise: Vector3<f64>,
    /// Time of the rest, s.
    pub time: f64,
    /// Its placement: rests of one show one heading.
    pub placement: u32,
}

/// Turn between two rests.
#[derive(Clone, Debug)]
pub struct TurnSeen {
    /// Rests before and after, as indices.
    pub rests: [usize; 2],
    /// Pieces of the preintegrated raw rates.
    pub pieces: Vec<Piece>,
    /// Duration, s.
    pub seconds: f64,
    /// Angular path ∫ ‖ω‖ dt, rad.
    pub path: f64,
    /// Variance of its angle about an axis from motion faster than the samples, rad².
    pub roughness: f64,
    /// Rotation about the vertical that it is known to be.
    pub known: Option<KnownRotation>,
}

/// Rests and the turns between them, both in order of time.
#[derive(Clone, Debug, Default)]
pub struct TurnSession {
    /// Rests in order.
    pub rests: Vec<RestSeen>,
    /// Turns in order.
    pub turns: Vec<TurnSeen>,
    /// Square of the gyroscope's angle random walk, rad²/s.
    pub random_walk: f64,
}

impl TurnSession {
    /// Drops known rotations that contradict their turns, counts the whole turns of headings, and with `whole_turns` declares
    /// those of the other turns to be such that look like whole turns of a table.
    pub fn declare(&mut self, accelerometer: &Calibration, whole_turns: bool) {
        for at in 0..self.turns.len() {
            let turn = &self.turns[at];
            let rate = turn.rests.map(|rest| self.rests.get(rest).map_or(Vector3::zeros(), |rest| rest.rate));
            let ends = Ends { up: self.ups(turn, accelerometer), rate, by_up: Matrix3::zeros() };
            let stays = || self.placement(turn.rests[0]) == self.placement(turn.rests[1]);
            let known = match turn.known {
                // Between rests of one placement nothing is told, and both headings err alike.
                Some(known) if known.heading_std.is_some() && stays() => None,
                Some(known) => {
                    let level = self.level(&ends.up[0], accelerometer);
                    let checked = known.checked(&turn.pieces, &ends, &level).ok();
                    checked.map(|known| known.about_vertical(&turn.pieces, &ends, &level))
                }
                None if whole_turns => whole_turn(&turn.pieces, &ends).map(KnownRotation::declared),
                None => None,
            };
            self.turns[at].known = known;
        }
    }

    /// Placement of a rest.
    pub(super) fn placement(&self, rest: usize) -> Option<u32> {
        self.rests.get(rest).map(|rest| rest.placement)
    }

    /// Axis of the body that is vertical while it is level, in poses like this one.
    fn level(&self, near: &Vector3<f64>, accelerometer: &Calibration) -> Vector3<f64> {
        let up = |force: &Vector3<f64>| accelerometer.correct(force).try_normalize(f64::MIN_POSITIVE);
        level_axis(near, self.rests.iter().filter_map(|rest| up(&rest.force[0])))
    }

    /// Directions of specific force before and after a turn.
    pub(super) fn ups(&self, turn: &TurnSeen, calibration: &Calibration) -> [Vector3<f64>; 2] {
        let at = |end: usize| {
            let force = self.rests.get(turn.rests[end]).map_or(Vector3::zeros(), |rest| rest.force[1 - end]);
            calibration.correct(&force).try_normalize(f64::MIN_POSITIVE).unwrap_or(Vector3::z())
        };
        [at(0), at(1)]
    }
}
