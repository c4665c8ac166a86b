//! Equation of a turn whose rotation about the vertical is known: that by the gyroscope less the known one.

use nalgebra::{SVector, Vector3};

use super::session::TurnSession;
use crate::turns::{Candidate, Ends, vertical};

/// Angle error from a gyroscope's nonlinearity, as a share of the path of a turn.
pub(super) const NONLINEARITY: f64 = 2e-4;

/// Linearised equation of a turn whose rotation about the vertical is known.
#[derive(Clone, Debug)]
pub(super) struct VerticalEquation {
    /// Index of the turn.
    pub(super) turn: usize,
    /// Rotation by the gyroscope less the known one, rad.
    pub(super) residual: f64,
    /// Known rotation, rad.
    pub(super) known: f64,
    /// Derivatives with respect to the entries of the inverse sensitivity, row by row, rad.
    pub(super) by_inverse: SVector<f64, 9>,
    /// Variance of the residual, rad².
    pub(super) variance: f64,
    /// Covariance with the equation of another turn, rad²: a heading at the placement between two turns errs for both, and so
    /// does the mean rate of a rest.
    pub(super) shared: Option<(usize, f64)>,
    /// Derivatives with respect to a rate that is added all along, s.
    by_rate: Vector3<f64>,
}

/// Equation, weighted so that its error is of unit variance and independent of those of the others.
pub(super) struct WhitenedVertical {
    pub(super) turn: usize,
    pub(super) residual: f64,
    pub(super) known: f64,
    pub(super) by_inverse: SVector<f64, 9>,
}

impl VerticalEquation {
    /// Equation of a turn, by its index; `before` is that of a turn before it, if any.
    pub(super) fn of(
        session: &TurnSession,
        turn: usize,
        candidate: &Candidate,
        ends: &Ends,
        before: Option<&Self>,
    ) -> Option<Self> {
        let seen = session.turns.get(turn)?;
        let known = seen.known?;
        let found = vertical(seen.pieces.iter(), candidate, ends);
        let noise = |rest: usize| session.rests.get(rest).map_or(Vector3::zeros(), |rest| rest.rate_noise);
        let of_bias = |other: &Vector3<f64>, noise: Vector3<f64>| {
            // The bias between two rests has half the error of either.
            found.by_rate.component_mul(other).dot(&noise) / 4.0
        };
        let bias = of_bias(&found.by_rate, noise(seen.rests[0]) + noise(seen.rests[1]));
        let variance =
            known.std().powi(2) + bias + session.random_walk * seen.seconds + (NONLINEARITY * seen.path).powi(2);
        let shared = before.zip(known.heading_std).and_then(|(before, std)| {
            let last = session.turns.get(before.turn)?;
            let other = last.known?.heading_std?;
            let meets = session.placement(last.rests[1]) == session.placement(seen.rests[0]);
            let same = last.rests[1] == seen.rests[0];
            let rate = if same { of_bias(&before.by_rate, noise(seen.rests[0])) } else { 0.0 };
            meets.then_some((before.turn, rate - std * other))
        });
        Some(Self {
            turn,
            residual: found.angle - known.angle,
            known: known.angle,
            by_inverse: found.by_inverse,
            variance,
            shared,
            by_rate: found.by_rate,
        })
    }
}

/// Weighs the equations of the turns that count. Errors are shared only with the equation before, so the factor of their
/// covariance is bidiagonal.
pub(super) fn whitened(equations: &[VerticalEquation], counts: impl Fn(usize) -> bool) -> Vec<WhitenedVertical> {
    /// Least share of a variance that is its own.
    const OWN: f64 = 1e-3;
    let mut white: Vec<WhitenedVertical> = Vec::with_capacity(equations.len());
    let mut last_own = 1.0;
    for equation in equations.iter().filter(|equation| counts(equation.turn)) {
        let before = white.last().filter(|before| equation.shared.is_some_and(|(with, _)| with == before.turn));
        let shared = before.and(equation.shared).map_or(0.0, |(_, covariance)| covariance / last_own);
        let own = (equation.variance - shared * shared).max(OWN * equation.variance).sqrt();
        let VerticalEquation { turn, mut residual, mut known, mut by_inverse, .. } = equation.clone();
        if let Some(before) = before {
            residual -= shared * before.residual;
            known -= shared * before.known;
            by_inverse.axpy(-shared, &before.by_inverse, 1.0);
        }
        let (residual, known, by_inverse) = (residual / own, known / own, by_inverse / own);
        white.push(WhitenedVertical { turn, residual, known, by_inverse });
        last_own = own;
    }
    white
}
