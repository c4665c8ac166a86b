//! Evidence of turns on unit and axes of a gyroscope: its integral between two rests, compared with the angle between
//! their directions of gravity. The size of the readings is not used.
//!
//! Each turn weights a hypothesis by its likelihood, relative to that of a gyroscope without information. It compares
//! the direction of gravity after the turn with that from the integral (a normal error on the sphere, with a share of
//! strays), and the mean specific force during the turn with the mean direction of gravity meanwhile.

use nalgebra::Vector3;

use super::piece::{Candidate, Piece};
use super::prediction::{Ends, follow};
use super::reading::AxisOrder;

/// Turn that also rotated gravity.
#[derive(Clone, Debug)]
pub struct SeenTurn {
    /// Preintegrated rates as they were read.
    pub pieces: Vec<Piece>,
    /// Rests at both ends, with rates as they were read.
    pub ends: Ends,
    /// Mean specific force during the turn, in g.
    pub force: Option<Vector3<f64>>,
    /// Whether readings may have been clipped.
    pub clipped: bool,
}

/// Explanation of turns by the readings of a gyroscope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Explanation {
    /// Too little evidence.
    Unknown,
    /// The rates, as they are, explain how gravity turned.
    Agrees,
    /// The rates explain it in another unit or axis order.
    Otherwise {
        /// Readings per rad/s.
        per_radian: f64,
        /// Another such number that is nearly as likely.
        or: Option<f64>,
        /// Order and signs of the axes.
        axes: AxisOrder,
    },
    /// The rates do not explain it; error in radians (root mean square).
    Disagrees(f64),
}

/// Hypothesis on the unit and axes of the readings.
#[derive(Clone, Copy, Debug)]
struct Hypothesis {
    per_radian: f64,
    axes: AxisOrder,
}

/// Least log odds (natural) for a conclusion.
const SURE: f64 = 4.0;
/// Least log-likelihood ratio of every turn at which agreement needs no comparison.
const EVIDENT: f64 = 4.0;
/// Error of gravity that correct rates never have, rad.
const REFUTED: f64 = 0.6;
/// Units of about the size of rad/s, in readings per rad/s.
const ALIKE: std::ops::Range<f64> = 0.025..40.0;
/// Fewest turns for a conclusion on axes, on a unit like rad/s, or that nothing explains the turns.
const LEAST_TURNS: usize = 3;

impl Hypothesis {
    const AS_IT_IS: Self = Self { per_radian: 1.0, axes: AxisOrder::RIGHT };

    fn candidate(self) -> Candidate {
        Candidate::of_inverse(self.axes.matrix() / self.per_radian)
    }

    /// Negative log prior, relative to readings that are right.
    fn rarity(self) -> f64 {
        let unit: f64 = match self.per_radian {
            1.0 => 0.0,
            // Three turns of many revolutions, which are not followed, may agree with a smaller unit by chance.
            alike if ALIKE.contains(&alike) => 16.0,
            _ => 4.0,
        };
        let axes = match (self.axes == AxisOrder::RIGHT, self.axes.is_in_order()) {
            (true, _) => 0.0,
            // One in a thousand: a correct sensor with one badly followed turn must not look like it.
            (false, true) => 7.0,
            (false, false) => 9.0,
        };
        unit + axes
    }

    /// Log odds of the hypothesis over all turns.
    fn odds(self, turns: &[SeenTurn]) -> f64 {
        turns.iter().map(|turn| turn.weight(self)).sum::<f64>() - self.rarity()
    }
}

impl SeenTurn {
    /// Log-likelihood ratio of a hypothesis over a gyroscope without information.
    fn weight(&self, reading: Hypothesis) -> f64 {
        /// Error of a direction at rest and of unobserved rotation, rad.
        const DIRECTION: f64 = 0.06;
        /// Relative error of the sensitivity of an uncalibrated gyroscope.
        const SCALE: f64 = 0.03;
        /// Longest usable piece, rad: a quarter of a second, if the rates were read in a unit that makes them small.
        const LONGEST_PIECE: f64 = 1.2;
        /// Error of a piece over the cube of its angle, from the third order that is left out (Magnus 1954).
        const THIRD_ORDER: f64 = 1.0 / 12.0;
        /// Largest error at which a turn still says anything, rad.
        const LOST: f64 = 0.7;
        /// Error of the mean specific force during the turn, in g.
        const ON_THE_WAY: f64 = 0.15;
        let (mut path, mut left_out) = (0.0, 0.0);
        let bias = (self.ends.rate[0] + self.ends.rate[1]) / 2.0;
        for piece in &self.pieces {
            let angle = (piece.angle - bias * piece.seconds).norm() / reading.per_radian;
            if angle > LONGEST_PIECE {
                return 0.0;
            }
            path += angle;
            left_out += (THIRD_ORDER * angle * angle * angle).powi(2);
        }
        let variance = DIRECTION * DIRECTION + (SCALE * path).powi(2) + left_out;
        if variance > LOST * LOST {
            return 0.0;
        }
        let stray: f64 = if self.clipped { 0.5 } else { 0.02 };
        let end = follow(self.pieces.iter(), &reading.candidate(), &self.ends);
        let miss = angle_between(&end.up, &self.ends.up[1]);
        // Densities relative to those of a direction, and of a vector in the unit ball, that are unknown.
        let there = 2.0 / variance * libm::exp(-miss * miss / (2.0 * variance));
        let meanwhile = self.force.map_or(1.0, |force| {
            let variance = ON_THE_WAY * ON_THE_WAY;
            let norm = 4.0 / 3.0 * std::f64::consts::PI / (2.0 * std::f64::consts::PI * variance).powi(3).sqrt();
            norm * libm::exp(-(force - end.mean).norm_squared() / (2.0 * variance))
        });
        libm::log(stray + (1.0 - stray) * there * meanwhile)
    }

    /// Error of the direction after the turn, rad.
    fn miss(&self, reading: Hypothesis) -> f64 {
        angle_between(&follow(self.pieces.iter(), &reading.candidate(), &self.ends).up, &self.ends.up[1])
    }
}

/// Explains the turns of a gyroscope whose readings were taken for rad/s; `scales` are the other units to try, in
/// readings per rad/s.
pub fn explain(turns: &[SeenTurn], scales: &[f64]) -> Explanation {
    let as_it_is = Hypothesis::AS_IT_IS.odds(turns);
    if turns.is_empty() {
        return Explanation::Unknown;
    }
    if turns.iter().all(|turn| turn.weight(Hypothesis::AS_IT_IS) >= EVIDENT) {
        return Explanation::Agrees;
    }
    // A turn of many revolutions that is not followed may seem one of a few, in a unit of about the same size.
    let few = turns.len() < LEAST_TURNS;
    let is_tried = |scale: &f64| (scale - 1.0).abs() > 0.05 && !(few && ALIKE.contains(scale));
    let scales = || std::iter::once(1.0).chain(scales.iter().copied().filter(is_tried));
    let mut tried: Vec<(f64, Hypothesis)> = Vec::new();
    let orders = if few { 1 } else { 48 };
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
    // Of neighbouring units the likeliest counts.
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
        (false, _) if let Some(per_radian) = unknown_unit(turns) => {
            Explanation::Otherwise { per_radian, or: None, axes: AxisOrder::RIGHT }
        }
        (false, _) if turns.len() >= LEAST_TURNS && as_it_is < -SURE && best < SURE => {
            let squares: f64 = turns.iter().map(|turn| turn.miss(Hypothesis::AS_IT_IS).powi(2)).sum();
            let miss = (squares / turns.len() as f64).sqrt();
            if miss > REFUTED { Explanation::Disagrees(miss) } else { Explanation::Unknown }
        }
        (false, _) => Explanation::Unknown,
    }
}

/// Readings per rad/s if they are of no known unit, as where a driver assumes another full-scale range.
fn unknown_unit(turns: &[SeenTurn]) -> Option<f64> {
    /// Steps between the tried units, as a logarithm, and their number to either side of rad/s.
    const STEP: f64 = 0.1;
    const STEPS: i32 = 70;
    /// Fewest turns: with a unit free to choose, a few that were not followed may agree by chance.
    const MANY: usize = 6;
    /// Negative log prior of such a unit beside one that is known.
    const UNHEARD_OF: f64 = 3.0;
    // A rate that stops at the end of its range seems too small.
    let whole: Vec<_> = turns.iter().filter(|turn| !turn.clipped).cloned().collect();
    if whole.len() < MANY {
        return None;
    }
    let tried = (-STEPS..=STEPS).map(|step| libm::exp(f64::from(step) * STEP));
    let tried = tried.map(|per_radian| {
        let hypothesis = Hypothesis { per_radian, axes: AxisOrder::RIGHT };
        (hypothesis.odds(&whole) - UNHEARD_OF, per_radian)
    });
    let tried: Vec<_> = tried.collect();
    let &(best, per_radian) = tried.iter().max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    let near = 0.8..1.25;
    let others = tried.iter().filter(|(_, other)| !near.contains(&(other / per_radian)));
    let second = others.map(|(odds, _)| *odds).fold(0.0, f64::max);
    (best - second >= SURE && !near.contains(&per_radian)).then_some(per_radian)
}

/// Whether the first turns favour a hypothesis over a gyroscope without information.
fn is_possible(turns: &[SeenTurn], hypothesis: Hypothesis) -> bool {
    let first = turns.iter().take(LEAST_TURNS).map(|turn| turn.weight(hypothesis));
    first.sum::<f64>() > 0.0
}

/// Angle between two vectors, rad.
pub fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::atan2(a.cross(b).norm(), a.dot(b))
}
