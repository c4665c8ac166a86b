//! Weighted linear equations about the unknowns of a [`Parameterisation`], solved within bounds. What the equations say is left to
//! whoever writes them: regressions, and the steps of refinements.
//!
//! The entries of S that the model has no word for, the leaks, are constants of the sensor, of which is assumed how large
//! they are. Where the equations tell more of them than that, they are estimated on the way (a mixed model, Henderson 1950):
//! otherwise they would pass for bias and scale wherever opposite faces are not seen equally well.

use nalgebra::{DMatrix, DVector, MatrixXx3, Vector3};

use super::config::Loss;
use super::error::Error;
use super::huber::{huber, weights};
use super::lsqlin::{Solution, lsqlin};
use super::parameterisation::{Parameterisation, Term, Truth};
use super::residual_block::ResidualBlock;

/// Lower and upper bounds of the unknowns.
pub type Limits = (DVector<f64>, DVector<f64>);

/// Where Huber's loss begins to count by distance, in standard deviations: of normal errors it wastes a twentieth (Huber 1964).
const THRESHOLD: f64 = 1.345;

/// Equations under way.
#[derive(Clone, Debug)]
pub struct LinearSystem {
    shape: Parameterisation,
    /// Standard deviation of each leak; zero where they are none.
    leak: f64,
    /// Rows of the design, weighted, one after the other.
    design: Vec<f64>,
    /// How the rows would answer to the entries of S that the model has no word for, weighted alike.
    leaks: Vec<f64>,
    targets: Vec<f64>,
    rows: Vec<Row>,
}

/// How sure an equation is.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Variance of its target by noise alone.
    pub noise: f64,
    /// How the target moves with the mean that it comes from; a placement moves the mean by as much on every axis.
    pub direction: Vector3<f64>,
    /// What it was multiplied with.
    weight: f64,
}

impl Row {
    /// What a unit of variance between placements adds to the variance of the target.
    pub fn gain(&self) -> f64 {
        self.direction.norm_squared()
    }
}

impl LinearSystem {
    /// No equations yet, about a sensor without leaks.
    pub fn new(shape: Parameterisation) -> Self {
        Self::leaking(shape, 0.0)
    }

    /// No equations yet, about a sensor whose leaks have that standard deviation.
    pub fn leaking(shape: Parameterisation, leak: f64) -> Self {
        Self { shape, leak, design: Vec::new(), leaks: Vec::new(), targets: Vec::new(), rows: Vec::new() }
    }

    /// Adds `direction · J(truth) · x = target`, J being the derivative of a reading by the unknowns, where the target has
    /// that variance by noise, and placements scatter with a variance of `between` along the direction.
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

    /// Adds a sum over `terms` of unknowns times factors that equals `target` up to an error of variance `noise`, whatever the
    /// placements.
    pub fn push_known(&mut self, terms: &[(Term, f64)], target: f64, noise: f64) {
        let weight = 1.0 / noise.sqrt();
        let factor =
            |term: Term| terms.iter().filter(|(of, _)| *of == term).map(|(_, factor)| weight * factor).sum::<f64>();
        self.design.extend(self.shape.terms().iter().map(|term| factor(*term)));
        self.leaks.extend(self.shape.unmodelled().map(factor));
        self.targets.push(target * weight);
        self.rows.push(Row { noise, direction: Vector3::zeros(), weight });
    }

    /// The weighted solution within the limits.
    ///
    /// # Errors
    /// If the equations do not determine the unknowns, the limits contradict each other, or the solver fails.
    pub fn solve(mut self, (low, high): &Limits, loss: Loss) -> Result<Solved, Error> {
        let rows = self.targets.len();
        let mut design = DMatrix::from_vec(self.shape.unknowns(), rows, self.design).transpose();
        let mut leaks = DMatrix::from_vec(self.shape.unmodelled().count(), rows, self.leaks).transpose();
        let targets = DVector::from_vec(self.targets);
        // Under Huber's loss what leaks is an error like others.
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
            // An equation beyond the threshold says less of the unknowns.
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

/// A solution with the weighted equations that it came from.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Where it lies.
    pub solution: Solution,
    /// Weighted, equations × unknowns.
    pub design: DMatrix<f64>,
    /// How they answer to the entries of S that the model has no word for, weighted alike.
    pub leaks: DMatrix<f64>,
    /// What the solution left over, weighted; what leaks is still in it.
    pub left: DVector<f64>,
    /// Standard deviation that was assumed of the leaks.
    leak: f64,
    rows: Vec<Row>,
}

/// What equations say of the unknowns where the leaks are free within what is assumed of them.
struct Free {
    information: DMatrix<f64>,
    /// By how much the right side of the normal equations moves with each weighted target.
    answer: DMatrix<f64>,
}

impl Free {
    /// `None` where there are no leaks, or the equations are no numbers.
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
    /// What an equation was multiplied with.
    pub fn weight(&self, equation: usize) -> f64 {
        self.rows.get(equation).map_or(0.0, |row| row.weight)
    }

    /// By how much the unknowns move with each weighted target, unknowns × equations; NaN where they are not determined.
    pub fn gain(&self) -> DMatrix<f64> {
        let unknowns = self.design.ncols();
        let Free { information, answer } = Free::of_leaks(&self.design, &self.leaks, self.leak)
            .unwrap_or_else(|| Free { information: self.design.tr_mul(&self.design), answer: self.design.transpose() });
        information.try_inverse().unwrap_or_else(|| DMatrix::repeat(unknowns, unknowns, f64::NAN)) * answer
    }

    /// Covariance that independent errors of the equations give to the unknowns, which answer to them by `gain`.
    pub fn spread(&self, gain: &DMatrix<f64>, variance: impl Fn(&Row) -> f64) -> DMatrix<f64> {
        let mut scaled = gain.clone();
        for (mut column, row) in scaled.column_iter_mut().zip(&self.rows) {
            column *= row.weight * variance(row).sqrt();
        }
        &scaled * scaled.transpose()
    }

    /// By how much the unknowns move with the mean of each equation: unknowns × 3.
    pub fn influence(&self, gain: &DMatrix<f64>) -> impl Iterator<Item = MatrixXx3<f64>> {
        gain.column_iter().zip(&self.rows).map(|(column, row)| column * row.weight * row.direction.transpose())
    }

    /// The equations before they were weighted: all of them, or those of one axis where each reading gave three in turn.
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

/// The limits that a function of the term says, for every unknown of a shape.
pub fn limits(shape: Parameterisation, of: impl Fn(Term) -> [f64; 2]) -> Limits {
    let side = |side: usize| DVector::from_iterator(shape.unknowns(), shape.terms().iter().map(|&term| of(term)[side]));
    (side(0), side(1))
}
