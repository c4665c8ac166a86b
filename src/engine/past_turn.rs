//! Turn as it was published, read back to be fitted again.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::messages::{self, turn::Reason};
use crate::turns::{KnownRotation, Piece};

/// Turn between two rests that were found before, in any recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PastTurn {
    /// Start of the motion, within the rest before it.
    pub start: Stamp,
    /// End of the motion, within the rest after it.
    pub end: Stamp,
    /// Pieces of the preintegrated raw rates.
    pub pieces: Vec<Piece>,
    /// Duration, s.
    pub seconds: f64,
    /// Angular path ∫ ‖ω‖ dt, rad.
    pub path: f64,
    /// Variance of its angle about an axis from motion faster than the samples, rad².
    pub roughness: f64,
    /// Rotation about the vertical that it was known to be, counterclockwise seen from above, rad.
    #[serde(default)]
    pub declared: Option<f64>,
    /// Standard deviation of that, if a heading reference showed it, rad.
    #[serde(default)]
    pub declared_std: Option<f64>,
}

impl PastTurn {
    /// Rotation about the vertical that it was known to be.
    pub fn known(&self) -> Option<KnownRotation> {
        let angle = self.declared?;
        Some(match self.declared_std {
            // It holds the errors of the heading at both rests.
            Some(std) => KnownRotation::of_heading(angle, std / std::f64::consts::SQRT_2),
            None => KnownRotation::declared(angle),
        })
    }
}

/// Turn of a message; `None` if the gyroscope did not follow it whole, or its values are no integrals of rates. Whether
/// the rests at its ends are accepted is judged anew.
pub fn turn_of(turn: &messages::Turn) -> Option<PastTurn> {
    /// Numbers of a piece, and most pieces of a turn.
    const NUMBERS: usize = 10;
    const MOST: usize = 1024;
    /// Longest piece for which the second order suffices, rad.
    const LONGEST: f64 = 0.5;
    /// Longest turn over which a bias keeps, s; and most that any number of a turn comes to.
    const LASTING: f64 = 20.0;
    const LARGEST: f64 = 1e6;
    /// Least error of a heading that anybody states, rad.
    const SMALLEST: f64 = 1e-6;
    let followed = match turn.reason() {
        Reason::Interrupted | Reason::Clipped | Reason::Prolonged | Reason::Jittery => false,
        Reason::Used | Reason::Small | Reason::Unrest | Reason::Outlier | Reason::Unreferenced => true,
    };
    let whole = turn.integrals.chunks_exact(NUMBERS);
    if !followed || whole.len() == 0 || whole.len() > MOST || !whole.remainder().is_empty() {
        return None;
    }
    let piece = |numbers: &[f64]| {
        let &[ax, ay, az, cx, cy, cz, mx, my, mz, seconds] = numbers else { return None };
        let sound = numbers.iter().all(|number| number.abs() <= LARGEST) && seconds > 0.0;
        let piece = Piece {
            angle: Vector3::new(ax, ay, az),
            coning: Vector3::new(cx, cy, cz),
            moment: Vector3::new(mx, my, mz),
            seconds,
        };
        (sound && piece.angle.norm() <= LONGEST).then_some(piece)
    };
    let pieces = whole.map(piece).collect::<Option<Vec<_>>>()?;
    let (start, end) = (super::refit::stamp(&turn.start)?, super::refit::stamp(&turn.end)?);
    let (seconds, path, roughness) = (turn.seconds, turn.path, turn.roughness);
    let sound = start < end
        && (0.0..=LASTING).contains(&seconds)
        && [path, roughness].iter().all(|value| (0.0..=LARGEST).contains(value));
    let declared = turn.declared.filter(|declared| declared.abs() <= LARGEST);
    let declared_std = turn.declared_std.filter(|std| (SMALLEST..=LARGEST).contains(std));
    // A number that is no deviation makes no declaration.
    let declared = declared.filter(|_| turn.declared_std.is_none() || declared_std.is_some());
    sound.then_some(PastTurn { start, end, pieces, seconds, path, roughness, declared, declared_std })
}
