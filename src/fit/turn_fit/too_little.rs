//! Reasons why turns do not determine a sensitivity.

use crate::plural::counted;

/// Fewest turns of a fit.
pub(super) const LEAST_TURNS: usize = 8;

/// Largest accepted half-width of a 95 % interval.
pub(super) const PRECISE: f64 = 0.005;

/// Names of the entries of S, row by row.
pub(super) const ENTRIES: [&str; 9] =
    ["the x scale", "x by y", "x by z", "y by x", "the y scale", "y by z", "z by x", "z by y", "the z scale"];

/// Reason why turns do not determine the sensitivity.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TooLittle {
    /// Too few turns between accepted rests.
    #[error(
        "{} by 30° or more between accepted rests, {LEAST_TURNS} are needed: turn it from face to face",
        counted(*turned as u64, "turn")
    )]
    Few {
        /// Turns that rotate gravity by 30° or more.
        turned: usize,
    },
    /// Turns whose residuals have too few degrees of freedom.
    #[error("{} without a check by others yet: turn it on from face to face, about all axes", counted(*turns as u64, "turn"))]
    Unchecked {
        /// Turns in the fit.
        turns: usize,
    },
    /// Rotations about the vertical, which do not turn gravity.
    #[error(
        "the turns are about the vertical ({turned} of {all} tilt it by 30° or more), and such turns show {}: turn the sensor \
         over, {LEAST_TURNS} times or more", if *declared { "one scale alone" } else { "no scale" }
    )]
    AboutVertical {
        /// Turns that tilt the sensor by 30° or more.
        turned: usize,
        /// All turns.
        all: usize,
        /// Whether some of them are declared to be whole turns.
        declared: bool,
    },
    /// Entry that is not precise enough.
    #[error("the turns tell {entry} to ±{:.2} %, and ±{:.1} % would do: more turns, about all axes", 100.0 * half_width, 100.0 * PRECISE)]
    Imprecise {
        /// Entry in words.
        entry: &'static str,
        /// Half-width of its 95 % interval.
        half_width: f64,
    },
    /// Equations without a solution.
    #[error("the turns contradict the rests")]
    Unsolved,
}
