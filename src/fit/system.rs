//! Weighted linear equations about the unknowns of a [`Shape`], solved within bounds. What the equations say is left to
//! whoever writes them: regressions, and the steps of refinements.

use nalgebra::{DMatrix, DVector, Vector3};

use super::lsqlin::{self, Solution, lsqlin};
use super::shape::{Shape, Term, Truth};

/// Lower and upper bounds of the unknowns.
pub type Limits = (DVector<f64>, DVector<f64>);

/// Equations under way.
#[derive(Clone, Debug)]
pub struct System {
    shape: Shape,
    /// Rows of the design, weighted, one after the other.
    design: Vec<f64>,
    /// How the rows would answer to the entries of S that the model has no word for, weighted alike.
    leaks: Vec<f64>,
    targets: Vec<f64>,
}

impl System {
    /// No equations yet.
    pub fn new(shape: Shape) -> Self {
        Self { shape, design: Vec::new(), leaks: Vec::new(), targets: Vec::new() }
    }

    /// Adds `direction · J(truth) · x = target`, J being the derivative of a reading by the unknowns, where the target has
    /// that variance.
    pub fn push(&mut self, direction: &Vector3<f64>, truth: &Truth, target: f64, variance: f64) {
        let weight = 1.0 / variance.sqrt();
        let entry = |axis: usize, regressor: f64| weight * direction[axis] * regressor;
        self.design.extend(self.shape.terms().iter().map(|term| entry(term.axis(), term.regressor(truth))));
        self.leaks.extend(self.shape.unmodelled().map(|term| entry(term.axis(), term.regressor(truth))));
        self.targets.push(target * weight);
    }

    /// The weighted least-squares solution within the limits.
    ///
    /// # Errors
    /// If the equations do not determine the unknowns, the limits contradict each other, or the solver fails.
    pub fn solve(self, (low, high): &Limits) -> Result<Solved, lsqlin::Error> {
        let rows = self.targets.len();
        let design = DMatrix::from_row_iterator(rows, self.shape.unknowns(), self.design);
        let leaks = DMatrix::from_row_iterator(rows, self.shape.unmodelled().count(), self.leaks);
        let solution = lsqlin(&design, &DVector::from_vec(self.targets), low, high)?;
        Ok(Solved { solution, design, leaks })
    }
}

/// A solution with the weighted equations that it came from.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Where it lies.
    pub solution: Solution,
    /// Weighted, equations × unknowns.
    pub design: DMatrix<f64>,
    leaks: DMatrix<f64>,
}

impl Solved {
    /// Covariance of the unknowns by the variances that the equations were weighted with; NaN where there is none.
    pub fn covariance(&self) -> DMatrix<f64> {
        let unknowns = self.design.ncols();
        let information = self.design.tr_mul(&self.design);
        information.try_inverse().unwrap_or_else(|| DMatrix::repeat(unknowns, unknowns, f64::NAN))
    }

    /// What entries of S beyond the model, each of that standard deviation, do to the unknowns. They are the same at every
    /// placement, so no repetition averages them away.
    pub fn leakage(&self, covariance: &DMatrix<f64>, std: f64) -> DMatrix<f64> {
        let by_leak = covariance * self.design.tr_mul(&self.leaks);
        &by_leak * by_leak.transpose() * (std * std)
    }
}

/// The limits that a function of the term says, for every unknown of a shape.
pub fn limits(shape: Shape, of: impl Fn(Term) -> [f64; 2]) -> Limits {
    let side = |side: usize| DVector::from_iterator(shape.unknowns(), shape.terms().iter().map(|&term| of(term)[side]));
    (side(0), side(1))
}
