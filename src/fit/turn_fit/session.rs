//! Rests and turns as the fit takes them.

use nalgebra::{Matrix3, Vector3};

use crate::fit::calibration::Calibration;
use crate::turns::{Ends, Piece, contradiction, whole_turn};

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
    /// Rotation about the vertical that it is declared to be, counterclockwise seen from above, rad.
    pub declared: Option<f64>,
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
    /// Drops declarations that contradict their turns, and with `whole_turns` declares those of the other turns to be such
    /// that look like whole turns of a table.
    pub fn declare(&mut self, accelerometer: &Calibration, whole_turns: bool) {
        for at in 0..self.turns.len() {
            let turn = &self.turns[at];
            let rate = turn.rests.map(|rest| self.rests.get(rest).map_or(Vector3::zeros(), |rest| rest.rate));
            let ends = Ends { up: self.ups(turn, accelerometer), rate, by_up: Matrix3::zeros() };
            let declared = match turn.declared {
                Some(angle) => Some(angle).filter(|angle| contradiction(&turn.pieces, &ends, *angle).is_none()),
                None if whole_turns => whole_turn(&turn.pieces, &ends),
                None => None,
            };
            self.turns[at].declared = declared;
        }
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
