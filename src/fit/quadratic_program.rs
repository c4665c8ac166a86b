//! Quadratic programs with linear inequalities, by the interior-point solver clarabel. It reports a singular problem as
//! solved and invents its values, so its results are only starting points that the callers check.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};
use nalgebra::DVector;

use super::error::Error;

/// Quadratic program: minimise ½ xᵀ Q x + cᵀ x with A x ≤ b.
pub(super) struct QuadraticProgram {
    quadratic: Vec<Vec<f64>>,
    linear: Vec<f64>,
    constraint: Vec<Vec<f64>>,
    limit: Vec<f64>,
}

impl QuadraticProgram {
    /// Creates a program without inequalities.
    pub(super) fn new(quadratic: Vec<Vec<f64>>, linear: Vec<f64>) -> Self {
        Self { quadratic, linear, constraint: Vec::new(), limit: Vec::new() }
    }

    /// Adds `row · x ≤ limit`.
    pub(super) fn push(&mut self, row: Vec<f64>, limit: f64) {
        self.constraint.push(row);
        self.limit.push(limit);
    }

    /// Bounds the first unknowns, as many as there are bounds; a bound is ignored from a distance of `far` from zero
    /// on.
    pub(super) fn bound(&mut self, low: &DVector<f64>, high: &DVector<f64>, far: f64) {
        for (i, (low, high)) in low.iter().zip(high).enumerate() {
            for (sign, bound) in [(1.0, *high), (-1.0, -low)] {
                if bound.abs() < far {
                    let mut row = vec![0.0; self.linear.len()];
                    row[i] = sign;
                    self.push(row, bound);
                }
            }
        }
    }

    /// Returns the approximate minimiser.
    ///
    /// # Errors
    /// If the inequalities contradict each other, or the solver gives up.
    pub(super) fn minimise(self) -> Result<DVector<f64>, Error> {
        let Self { quadratic, linear, constraint, limit } = self;
        let quadratic = CscMatrix::from(&quadratic).to_triu();
        let constraint =
            if constraint.is_empty() { CscMatrix::zeros((0, linear.len())) } else { CscMatrix::from(&constraint) };
        let cones = [NonnegativeConeT(limit.len())];
        let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
        let mut solver = DefaultSolver::new(&quadratic, &linear, &constraint, &limit, &cones, settings)
            .map_err(|_| Error::Invalid)?;
        solver.solve();
        match solver.solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Ok(DVector::from_vec(solver.solution.x.clone())),
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Err(Error::Invalid),
            _ => Err(Error::NotConverged),
        }
    }
}
