//! Scale of a gyroscope about the vertical: what turns of known rotation show where others are too few to determine all of
//! its sensitivity S, as on a vehicle that never turns over.

use nalgebra::{Matrix3, Vector3};

use super::session::TurnSession;
use super::vertical_equation::{VerticalEquation, WhitenedVertical, whitened};
use crate::fit::calibration::Calibration;
use crate::fit::student_t::{NORMAL_95, student_95};
use crate::turns::{Candidate, Ends, angle_between, level_axis};

/// Scale about one direction, uᵀ S u: a turn about the vertical u reads S u.
#[derive(Clone, Debug, PartialEq)]
pub struct VerticalScale {
    /// Direction of the vertical in the sensor's axes, unit vector.
    pub up: Vector3<f64>,
    /// Scale.
    pub value: f64,
    /// Standard deviation, stretched so that 1.96 of it are half of a 95 % interval.
    pub std: f64,
    /// Number of turns.
    pub turns: usize,
}

/// Largest angle between verticals that count as one, rad.
const ALIKE: f64 = 0.25;
/// Fewest turns, and least rotation of one of them, rad.
const LEAST_TURNS: usize = 3;
const TURNED: f64 = 0.3;
/// Largest half of a 95 % interval that is worth telling: datasheets promise 3 %.
const WORTH: f64 = 0.02;

/// Scales about the verticals of the turns whose rotation is known, one for each pose they were made in, by a linear
/// regression through the origin. `tilt` is the error of the directions of gravity, rad: as the largest entries off the
/// diagonal of S are a few hundredths, it moves the scale by little.
pub fn vertical_scales(session: &TurnSession, accelerometer: &Calibration, tilt: f64) -> Vec<VerticalScale> {
    let ups: Vec<_> = session.turns.iter().map(|turn| session.ups(turn, accelerometer)).collect();
    let is_known = |turn: usize| session.turns.get(turn).is_some_and(|turn| turn.known.is_some());
    let mut left: Vec<usize> = (0..session.turns.len()).filter(|turn| is_known(*turn)).collect();
    let mut scales = Vec::new();
    while let Some([first, _]) = left.first().and_then(|turn| ups.get(*turn)) {
        let up = level_axis(first, left.iter().filter_map(|turn| ups.get(*turn)).map(|[before, _]| *before));
        let is_alike = |turn: &usize| ups.get(*turn).is_some_and(|[before, _]| angle_between(before, &up) <= ALIKE);
        let (mut alike, others): (Vec<_>, Vec<_>) = left.iter().partition(|turn| is_alike(turn));
        if alike.is_empty() {
            alike.extend(left.first());
        }
        left = others.into_iter().filter(|turn| !alike.contains(turn)).collect();
        scales.extend(scale(session, &alike, &ups, up, tilt));
    }
    scales
}

/// Scale about the vertical of these turns.
fn scale(
    session: &TurnSession,
    turns: &[usize],
    ups: &[[Vector3<f64>; 2]],
    up: Vector3<f64>,
    tilt: f64,
) -> Option<VerticalScale> {
    /// Standard deviation of the entries of S off its diagonal, which make a tilt count.
    const ENTRIES: f64 = 0.01;
    let mut equations: Vec<VerticalEquation> = Vec::with_capacity(turns.len());
    for &turn in turns {
        let rates = session.turns.get(turn)?.rests.map(|rest| session.rests.get(rest).map(|rest| rest.rate));
        let rate = rates.map(Option::unwrap_or_default);
        let ends = Ends { up: *ups.get(turn)?, rate, by_up: Matrix3::zeros() };
        equations.extend(VerticalEquation::of(session, turn, &Candidate::default(), &ends, equations.last()));
    }
    let count = equations.iter().filter(|equation| equation.known.abs() >= TURNED).count();
    let white = whitened(&equations, |_| true);
    let information: f64 = white.iter().map(|white| white.known * white.known).sum();
    let moment: f64 = white.iter().map(|white| white.known * white.residual).sum();
    if count < LEAST_TURNS || information <= 0.0 {
        return None;
    }
    let more = moment / information;
    let left = |white: &WhitenedVertical| (white.residual - more * white.known).powi(2);
    let freedom = (white.len() - 1) as f64;
    let scatter = white.iter().map(left).sum::<f64>() / freedom;
    // Errors are believed to be as stated, unless the turns scatter by more than chance.
    let stretch = if scatter > by_chance(freedom) { scatter.sqrt() * student_95(freedom) / NORMAL_95 } else { 1.0 };
    let std = libm::hypot(stretch / information.sqrt(), tilt * ENTRIES);
    (NORMAL_95 * std <= WORTH).then_some(VerticalScale { up, value: 1.0 + more, std, turns: count })
}

/// Largest χ² over its degrees of freedom that chance brings in 95 of 100 cases (Wilson & Hilferty, PNAS 1931).
fn by_chance(freedom: f64) -> f64 {
    const NORMAL_95_ONE_SIDED: f64 = 1.644_85;
    let ninth = 2.0 / (9.0 * freedom);
    (1.0 - ninth + NORMAL_95_ONE_SIDED * ninth.sqrt()).powi(3)
}
