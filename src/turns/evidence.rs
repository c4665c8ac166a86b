//! Evidence of turns on how a gyroscope reads: its integral between two rests against the angle between their gravities.
//! Nothing is concluded from how large the readings are.
//!
//! Each turn weighs a reading by its likelihood over that of a gyroscope that says nothing: where gravity is afterwards,
//! against where the integral puts it (a normal error on the sphere, with a part of strays), and what specific force was on
//! the way, against the mean of where gravity was meanwhile.

use nalgebra::Vector3;

use super::piece::{Candidate, Piece};
use super::prediction::{Ends, follow};
use super::reading::AxisOrder;

/// A turn by which gravity turned, too.
#[derive(Clone, Debug)]
pub struct SeenTurn {
    /// What the gyroscope read.
    pub pieces: Vec<Piece>,
    /// What is known of the rests at both ends, rates as they were read.
    pub ends: Ends,
    /// Mean specific force on the way, in g.
    pub force: Option<Vector3<f64>>,
    /// Whether readings may have stopped at an end of the range.
    pub clipped: bool,
}

/// What turns say of a gyroscope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Explanation {
    /// Too little.
    Unknown,
    /// Its rates, as they are, explain how gravity turned.
    Agrees,
    /// They would if they were read like this.
    Otherwise {
        /// Readings a rad/s.
        per_radian: f64,
        /// Another number of them that is nearly as likely.
        or: Option<f64>,
        /// How its axes stand.
        axes: AxisOrder,
    },
    /// They do not, by so many radians (root mean square).
    Disagrees(f64),
}

/// A reading that is tried.
#[derive(Clone, Copy, Debug)]
struct Hypothesis {
    per_radian: f64,
    axes: AxisOrder,
}

/// Natural logarithm of the odds from which on something is said.
const SURE: f64 = 4.0;
/// Of each turn, where an agreement needs no comparison.
const EVIDENT: f64 = 4.0;
/// What rates that are right never miss gravity by, rad.
const REFUTED: f64 = 0.6;
/// Turns before anything is said of axes, or that nothing explains them.
const LEAST_TURNS: usize = 3;

impl Hypothesis {
    const AS_IT_IS: Self = Self { per_radian: 1.0, axes: AxisOrder::RIGHT };

    fn candidate(self) -> Candidate {
        Candidate::of_inverse(self.axes.matrix() / self.per_radian)
    }

    /// Logarithm of how seldom it is met, beside readings that are right.
    fn rarity(self) -> f64 {
        let unit: f64 = if self.per_radian == 1.0 { 0.0 } else { 4.0 };
        let axes = match (self.axes == AxisOrder::RIGHT, self.axes.is_in_order()) {
            (true, _) => 0.0,
            // One in a thousand: a right sensor, one of whose turns was not followed well, must not look like it.
            (false, true) => 7.0,
            (false, false) => 9.0,
        };
        unit + axes
    }

    /// Logarithm of its odds, by all turns.
    fn odds(self, turns: &[SeenTurn]) -> f64 {
        turns.iter().map(|turn| turn.weight(self)).sum::<f64>() - self.rarity()
    }
}

impl SeenTurn {
    /// Logarithm of the likelihood of a reading over that of one that says nothing.
    fn weight(&self, reading: Hypothesis) -> f64 {
        /// Error of a direction at rest, and of what turns unseen, rad.
        const DIRECTION: f64 = 0.06;
        /// Of the sensitivity of a gyroscope that is not calibrated.
        const SCALE: f64 = 0.03;
        /// So long may a piece be, rad.
        const LONGEST_PIECE: f64 = 0.5;
        /// Beyond that error the turn says nothing, rad.
        const LOST: f64 = 0.7;
        /// Of mean specific force on the way, in g.
        const ON_THE_WAY: f64 = 0.15;
        let mut path = 0.0;
        let bias = (self.ends.rate[0] + self.ends.rate[1]) / 2.0;
        for piece in &self.pieces {
            let angle = (piece.angle - bias * piece.seconds).norm() / reading.per_radian;
            if angle > LONGEST_PIECE {
                return 0.0;
            }
            path += angle;
        }
        let variance = DIRECTION * DIRECTION + (SCALE * path).powi(2);
        if variance > LOST * LOST {
            return 0.0;
        }
        let stray: f64 = if self.clipped { 0.5 } else { 0.02 };
        let end = follow(self.pieces.iter(), &reading.candidate(), &self.ends);
        let miss = angle_between(&end.up, &self.ends.up[1]);
        // Densities over those of a direction, and of a vector within the unit ball, of which nothing is known.
        let there = 2.0 / variance * libm::exp(-miss * miss / (2.0 * variance));
        let meanwhile = self.force.map_or(1.0, |force| {
            let variance = ON_THE_WAY * ON_THE_WAY;
            let norm = 4.0 / 3.0 * std::f64::consts::PI / (2.0 * std::f64::consts::PI * variance).powi(3).sqrt();
            norm * libm::exp(-(force - end.mean).norm_squared() / (2.0 * variance))
        });
        libm::log(stray + (1.0 - stray) * there * meanwhile)
    }

    /// By how much a reading misses the direction after, rad.
    fn miss(&self, reading: Hypothesis) -> f64 {
        angle_between(&follow(self.pieces.iter(), &reading.candidate(), &self.ends).up, &self.ends.up[1])
    }
}

/// Explains turns of a gyroscope whose readings were taken for rad/s, and may be in one of these: readings a rad/s.
pub fn explain(turns: &[SeenTurn], scales: &[f64]) -> Explanation {
    let as_it_is = Hypothesis::AS_IT_IS.odds(turns);
    if turns.is_empty() {
        return Explanation::Unknown;
    }
    if turns.iter().all(|turn| turn.weight(Hypothesis::AS_IT_IS) >= EVIDENT) {
        return Explanation::Agrees;
    }
    let scales = || std::iter::once(1.0).chain(scales.iter().copied().filter(|scale| (scale - 1.0).abs() > 0.05));
    let mut tried: Vec<(f64, Hypothesis)> = Vec::new();
    let orders = if turns.len() >= LEAST_TURNS { 48 } else { 1 };
    for axes in AxisOrder::all().take(orders) {
        for per_radian in scales() {
            let hypothesis = Hypothesis { per_radian, axes };
            if axes != AxisOrder::RIGHT && !is_possible(turns, hypothesis) {
                continue;
            }
            tried.push((hypothesis.odds(turns), hypothesis));
        }
    }
    tried.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    let Some(&(best, reading)) = tried.first() else { return Explanation::Unknown };
    // Of neighbouring units it is the likelier one.
    let is_other = |other: &Hypothesis| {
        other.axes != reading.axes || !(0.8..1.25).contains(&(other.per_radian / reading.per_radian))
    };
    let second = tried.iter().find(|(_, other)| is_other(other)).map_or(0.0, |(odds, _)| *odds);
    let sure = best - second.max(0.0) >= SURE;
    let is_right = reading.axes == AxisOrder::RIGHT && (0.8..1.25).contains(&reading.per_radian);
    match (sure, is_right) {
        (true, true) => Explanation::Agrees,
        (true, false) => {
            let near = tried.iter().skip(1).find(|(odds, other)| !is_other(other) && best - odds < SURE);
            Explanation::Otherwise {
                per_radian: reading.per_radian,
                or: near.map(|(_, other)| other.per_radian),
                axes: reading.axes,
            }
        }
        (false, _) if turns.len() >= LEAST_TURNS && as_it_is < -SURE && best < SURE => {
            let squares: f64 = turns.iter().map(|turn| turn.miss(Hypothesis::AS_IT_IS).powi(2)).sum();
            let miss = (squares / turns.len() as f64).sqrt();
            if miss > REFUTED { Explanation::Disagrees(miss) } else { Explanation::Unknown }
        }
        (false, _) => Explanation::Unknown,
    }
}

/// Whether the first turns leave it possible at all.
fn is_possible(turns: &[SeenTurn], hypothesis: Hypothesis) -> bool {
    let first = turns.iter().take(LEAST_TURNS).map(|turn| turn.weight(hypothesis));
    first.sum::<f64>() > 0.0
}

/// Angle between two vectors, rad.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}
