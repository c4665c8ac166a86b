//! Weighted linear equations about the unknowns of a [`Parameterisation`], solved within bounds: for regressions and
//! for the steps of refinements.
//!
//! Leaks are the entries of S that the model does not estimate: constants of the sensor, with an assumed standard
//! deviation. Where the equations say more about them than that, they are estimated along the way (a mixed model,
//! Henderson 1950); otherwise they would appear as bias and scale wherever opposite faces are not seen equally well.

use nalgebra::{DMatrix, DVector, MatrixXx3, Vector3};

use super::config::Loss;
use super::error::Error;
use super::huber::{huber, weights};
use super::lsqlin::{Solution, lsqlin};
use super::parameterisation::{Parameterisation, Term, Truth};
use super::residual_block::ResidualBlock;

/// Lower and upper bounds of the unknowns.
pub type Limits = (DVector<f64>, DVector<f64>);

/// Threshold of Huber's loss, in standard deviations: 95 % efficient for normal errors (Huber 1964).
const THRESHOLD: f64 = 1.345;

/// Equations about the unknowns, collected one by one.
#[derive(Clone, Debug)]
pub struct LinearSystem {
    shape: Parameterisation,
    /// Standard deviation of each leak; zero if there are none.
    leak: f64,
    /// Weighted rows of the design, one after the other.
    design: Vec<f64>,
    /// Rows of the design for the leaks, weighted alike.
    leaks: Vec<f64>,
    targets: Vec<f64>,
    rows: Vec<Row>,
}

/// Uncertainty of one equation.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Variance of its target from noise alone.
    pub noise: f64,
    /// Derivative of the target with respect to the mean it comes from; a placement moves the mean equally on every
    /// axis.
    pub direction: Vector3<f64>,
    /// Factor by which the equation was multiplied.
    weight: f64,
}

impl Row {
    /// Variance that a unit of variance between placements adds to the target.
    pub fn gain(&self) -> f64 {
        self.direction.norm_squared()
    }
}

impl LinearSystem {
    /// Creates an empty system for a sensor without leaks.
    pub fn new(shape: Parameterisation) -> Self {
        Self::leaking(shape, 0.0)
    }

    /// Creates an empty system for a sensor whose leaks have a standard deviation of `leak`.
    pub fn leaking(shape: Parameterisation, leak: f64) -> Self {
        Self { shape, leak, design: Vec::new(), leaks: Vec::new(), targets: Vec::new(), rows: Vec::new() }
    }

    /// Adds `direction · J(truth) · x = target`, where J is the derivative of a reading with respect to the unknowns.
    /// The target has a variance of `noise` from noise, and placements scatter with a variance of `between` along the
    /// direction.
    pub fn push(&mut self, direction: &Vector3<f64>, truth: &Truth, target: f64, noise: f64, between: f64) {
        let mut row = Row { noise, direction: *direction, weight: 1.0 };
        row.weight = 1.0 / (noise + row.gain() * between).sqrt();
        let weight = row.weight;
        let entry = |axis: usize, regressor: f64| weight * direction[axis] * regressor;
        self.design.extend(self.shape.terms().iter().map(|term| entry(term.axis(), term.regressor(truth))));
        self.leaks.extend(self.shape.unmodelled().map(|term| entry(term.axis(), term.regressor(truth))));
        self.targets.push(target * weight);
        self.rows.push(row);
    }

    /// Adds an equation that does not depend on placements: the sum over `terms` of unknowns times factors is `target`,
    /// up to an error of variance `noise`.
    pub fn push_known(&mut self, terms: &[(Term, f64)], target: f64, noise: f64) {
        let weight = 1.0 / noise.sqrt();
        let factor =
            |term: Term| terms.iter().filter(|(of, _)| *of == term).map(|(_, factor)| weight * factor).sum::<f64>();
        self.design.extend(self.shape.terms().iter().map(|term| factor(*term)));
        self.leaks.extend(self.shape.unmodelled().map(factor));
        self.targets.push(target * weight);
        self.rows.push(Row { noise, direction: Vector3::zeros(), weight });
    }

    /// Solves for the weighted solution within the limits.
    ///
    /// # Errors
    /// If the equations do not determine the unknowns, the limits contradict each other, or the solver fails.
    pub fn solve(mut self, (low, high): &Limits, loss: Loss) -> Result<Solved, Error> {
        let rows = self.targets.len();
        let mut design = DMatrix::from_vec(self.shape.unknowns(), rows, self.design).transpose();
        let mut leaks = DMatrix::from_vec(self.shape.unmodelled().count(), rows, self.leaks).transpose();
        let targets = DVector::from_vec(self.targets);
        // Under Huber's loss a leak counts as an error like others.
        let leak = if loss == Loss::Huber { 0.0 } else { self.leak };
        let solution = match (loss, Free::of_leaks(&design, &leaks, leak)) {
            (Loss::Huber, _) => huber(&design, &targets, low, high, THRESHOLD)?,
            (Loss::Square, None) => lsqlin(&design, &targets, low, high)?,
            (Loss::Square, Some(free)) => {
                let triangle = free.information.cholesky().ok_or(Error::Singular(f64::INFINITY))?.l();
                let said = free.answer * &targets;
                let target = triangle.solve_lower_triangular(&said).ok_or(Error::Singular(f64::INFINITY))?;
                lsqlin(&triangle.transpose(), &target, low, high)?
            }
        };
        let mut left = &targets - &design * &solution.x;
        if loss == Loss::Huber {
            // An equation beyond the threshold says less about the unknowns.
            for (i, weight) in weights(&left, THRESHOLD).map(f64::sqrt).iter().enumerate() {
                design.row_mut(i).scale_mut(*weight);
                leaks.row_mut(i).scale_mut(*weight);
                left[i] *= weight;
                self.rows[i].weight *= weight;
            }
        }
        Ok(Solved { solution, leak, design, leaks, left, rows: self.rows })
    }
}

/// Solution with the weighted equations that it came from.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Minimiser within the limits.
    pub solution: Solution,
    /// Weighted design, equations × unknowns.
    pub design: DMatrix<f64>,
    /// Weighted design of the leaks, equations × leaks.
    pub leaks: DMatrix<f64>,
    /// Weighted residuals; they still contain the leaks.
    pub left: DVector<f64>,
    /// Assumed standard deviation of the leaks.
    leak: f64,
    rows: Vec<Row>,
}

/// Normal equations of the unknowns, with the leaks free within their assumed scatter.
struct Free {
    information: DMatrix<f64>,
    /// Derivative of the right-hand side of the normal equations with respect to each weighted target.
    answer: DMatrix<f64>,
}

impl Free {
    /// Eliminates the leaks; `None` if there are none, or the equations are not finite.
    fn of_leaks(design: &DMatrix<f64>, leaks: &DMatrix<f64>, leak: f64) -> Option<Self> {
        if leaks.ncols() == 0 || leak <= 0.0 {
            return None;
        }
        let mut known = leaks.tr_mul(leaks);
        (0..leaks.ncols()).for_each(|k| known[(k, k)] += 1.0 / (leak * leak));
        let passed = known.cholesky()?.solve(&leaks.tr_mul(design));
        let answer = (design - leaks * passed).transpose();
        Some(Self { information: &answer * design, answer })
    }
}

impl Solved {
    /// Factor by which an equation was multiplied.
    pub fn weight(&self, equation: usize) -> f64 {
        self.rows.get(equation).map_or(0.0, |row| row.weight)
    }

    /// Whether an equation depends on a placement.
    pub fn is_of_placement(&self, equation: usize) -> bool {
        self.rows.get(equation).is_some_and(|row| row.gain() > 0.0)
    }

    /// Derivative of the unknowns with respect to each weighted target, unknowns × equations; NaN if they are not
    /// determined.
    pub fn gain(&self) -> DMatrix<f64> {
        let unknowns = self.design.ncols();
        let Free { information, answer } = Free::of_leaks(&self.design, &self.leaks, self.leak)
            .unwrap_or_else(|| Free { information: self.design.tr_mul(&self.design), answer: self.design.transpose() });
        information.try_inverse().unwrap_or_else(|| DMatrix::repeat(unknowns, unknowns, f64::NAN)) * answer
    }

    /// Covariance of the unknowns from independent errors of the equations, by their `gain`.
    pub fn spread(&self, gain: &DMatrix<f64>, variance: impl Fn(&Row) -> f64) -> DMatrix<f64> {
        let mut scaled = gain.clone();
        for (mut column, row) in scaled.column_iter_mut().zip(&self.rows) {
            column *= row.weight * variance(row).sqrt();
        }
        &scaled * scaled.transpose()
    }

    /// Derivative of the unknowns with respect to the mean of each equation: unknowns × 3.
    pub fn influence(&self, gain: &DMatrix<f64>) -> impl Iterator<Item = MatrixXx3<f64>> {
        gain.column_iter().zip(&self.rows).map(|(column, row)| column * row.weight * row.direction.transpose())
    }

    /// Equations without their weights: all of them, or those of one axis where each reading gave three in turn.
    pub fn block(&self, shape: Parameterisation, axis: Option<usize>) -> ResidualBlock {
        let of_axis = |term: Term| axis.is_none_or(|axis| term.axis() == axis);
        let rows: Vec<_> = (0..self.rows.len()).filter(|r| axis.is_none_or(|axis| r % 3 == axis)).collect();
        let terms: Vec<_> =
            shape.terms().iter().enumerate().filter(|(_, term)| of_axis(**term)).map(|(k, _)| k).collect();
        let leaks: Vec<_> = shape.unmodelled().enumerate().filter(|(_, term)| of_axis(*term)).map(|(k, _)| k).collect();
        let plain = |matrix: &DMatrix<f64>, columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |r, c| {
                matrix[(rows[r], columns[c])] / self.rows[rows[r]].weight
            })
        };
        ResidualBlock {
            design: plain(&self.design, &terms),
            leaks: plain(&self.leaks, &leaks),
            residuals: DVector::from_iterator(rows.len(), rows.iter().map(|&r| self.left[r] / self.rows[r].weight)),
            noise: DVector::from_iterator(rows.len(), rows.iter().map(|&r| self.rows[r].noise)),
            gain: DVector::from_iterator(rows.len(), rows.iter().map(|&r| self.rows[r].gain())),
        }
    }
}

/// Limits of every unknown of a shape, from a function of its term.
pub fn limits(shape: Parameterisation, of: impl Fn(Term) -> [f64; 2]) -> Limits {
    let side = |side: usize| DVector::from_iterator(shape.unknowns(), shape.terms().iter().map(|&term| of(term)[side]));
    (side(0), side(1))
}
