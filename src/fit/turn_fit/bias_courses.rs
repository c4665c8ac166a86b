//! Equations of turns on an accelerometer's bias that changes from rest to rest.

use nalgebra::{DMatrix, DVector, Matrix2x3, MatrixXx3, SVector, Vector3};

use super::equations::{DATASHEET, UNKNOWNS};
use super::session::TurnSession;
use super::solution::{AS_ASSUMED, Factor, TurnSolution};
use crate::fit::parameterisation::Parameterisation;

/// Linearised equations of turns, weighted so that their errors are independent and of unit variance:
/// `design · δ + Σ by_rest · change ≈ targets`, with the unknowns less those at which they are linearised.
#[derive(Clone, Debug)]
pub struct BiasCourses {
    /// Unknowns about which the equations are linearised: entries of the gyroscope's C less I, then the accelerometer's
    /// parameters in the order of [`Parameterisation::TRIANGULAR`](crate::fit::Parameterisation::TRIANGULAR).
    pub(in crate::fit) at: SVector<f64, UNKNOWNS>,
    pub(in crate::fit) targets: DVector<f64>,
    pub(in crate::fit) design: DMatrix<f64>,
    /// Bias during each rest.
    pub(in crate::fit) rests: Vec<BiasAtRest>,
}

/// Part of the equations that depends on the bias during a rest.
#[derive(Clone, Debug)]
pub(in crate::fit) struct BiasAtRest {
    /// Time of the rest, s.
    pub(in crate::fit) time: f64,
    /// Direction of true specific force.
    pub(in crate::fit) up: Vector3<f64>,
    /// First equation that depends on it.
    pub(in crate::fit) first: usize,
    /// Derivatives of the equations from there on: equations × 3.
    pub(in crate::fit) by_bias: MatrixXx3<f64>,
}

impl BiasCourses {
    /// Number of unknowns before those of the accelerometer.
    pub(in crate::fit) const BEFORE: usize = 9;

    /// Prior standard deviation of an entry of an inverse sensitivity.
    pub(in crate::fit) const PRIOR: f64 = DATASHEET;

    /// Equations of fitted turns; `None` if the gyroscope does not follow them.
    pub(super) fn of(solution: &TurnSolution<'_>, session: &TurnSession) -> Option<Self> {
        /// Largest added error of turns that are followed, rad: no bias at rest moves by so much of gravity.
        const FOLLOWED: f64 = 0.02;
        if solution.level.added.sqrt() > FOLLOWED {
            return None;
        }
        // An added error may come from the very change that is looked for.
        let factors = solution.factors(AS_ASSUMED, None)?;
        let white = solution.whitened(AS_ASSUMED, None)?;
        let rows = 2 * white.len();
        let ends: Option<Vec<_>> = factors.iter().map(|factor| Some(session.turns.get(factor.turn)?.rests)).collect();
        let ends = ends?;
        let by_rest = |rest: usize| {
            let first = ends.iter().position(|ends| ends.contains(&rest)).unwrap_or(ends.len());
            let mut by_bias = MatrixXx3::zeros(rows - 2 * first);
            let mut before = Matrix2x3::zeros();
            for (k, (Factor { turn, shared, triangle }, [from, to])) in
                factors.iter().zip(&ends).enumerate().skip(first)
            {
                let mut own = shared.map_or(Matrix2x3::zeros(), |shared| -shared * before);
                let ends = [to, from].into_iter().zip(&solution.equations[*turn].by_bias);
                ends.filter(|(end, _)| **end == rest).for_each(|(_, by_bias)| own += by_bias);
                triangle.solve_lower_triangular_mut(&mut own);
                by_bias.fixed_rows_mut::<2>(2 * (k - first)).copy_from(&own);
                before = own;
            }
            (2 * first, by_bias)
        };
        let parameters =
            DVector::from_iterator(UNKNOWNS - Self::BEFORE, solution.at.iter().skip(Self::BEFORE).copied());
        let accelerometer = Parameterisation::TRIANGULAR.calibration(&parameters);
        let rests = session.rests.iter().enumerate().map(|(k, rest)| {
            let up = accelerometer.correct(&rest.force[0]).try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
            let (first, by_bias) = by_rest(k);
            BiasAtRest { time: rest.time, up, first, by_bias }
        });
        Some(Self {
            at: solution.at,
            targets: DVector::from_iterator(rows, white.iter().flat_map(|(residual, _)| [-residual.x, -residual.y])),
            design: DMatrix::from_fn(rows, UNKNOWNS, |row, column| white[row / 2].1[(row % 2, column)]),
            rests: rests.collect(),
        })
    }

    /// Moves the zero of time by so many seconds into the past.
    pub fn later(mut self, seconds: f64) -> Self {
        self.rests.iter_mut().for_each(|rest| rest.time += seconds);
        self
    }
}
