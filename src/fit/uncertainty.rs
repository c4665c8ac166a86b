//! Uncertainty of the unknowns of a fit: placements, noise, leaks and the other causes, in one covariance.

use nalgebra::{DMatrix, DVector};

use super::linear_system::{Row, Solved};
use super::parameterisation::{Parameterisation, Term};
use super::placement_scatter::{Assumed, PlacementScatter};

/// Sharing of a scatter between equations and unknowns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sharing {
    /// One scatter for all: each placement gives one equation.
    All,
    /// One scatter for each axis: a placement gives one equation of each axis in turn, and axes differ.
    ByAxis,
    /// One scatter for the three axes, which placements move alike, though each axis has unknowns of its own.
    Common,
}

/// Errors of a fit, learned from its equations.
#[derive(Clone, Debug)]
pub struct Uncertainty {
    sharing: Sharing,
    scatter: Vec<PlacementScatter>,
    /// Root mean square of the residuals without the leaks, as far as these are credible; not weighted.
    pub left_rms: f64,
    /// Root mean square of the leaks, from assumption and equations.
    pub leak_rms: f64,
}

/// Uncertainty that does not come from the equations.
#[derive(Clone, Debug)]
pub struct Other {
    /// Covariance of the unknowns.
    pub covariance: DMatrix<f64>,
    /// Variance with which each variance on its diagonal was estimated.
    pub spread: DVector<f64>,
}

impl From<DMatrix<f64>> for Other {
    /// Converts a covariance of which nothing was estimated.
    fn from(covariance: DMatrix<f64>) -> Self {
        Self { spread: DVector::zeros(covariance.nrows()), covariance }
    }
}

/// Largest credible leak, in standard deviations: beyond it the model is wrong. Six entries as assumed exceed it in one
/// sensor in three hundred thousand.
const CREDIBLE: f64 = 5.0;

impl Uncertainty {
    /// Learns the errors from a solution; its weights do not matter.
    pub fn learn(shape: Parameterisation, solved: &Solved, sharing: Sharing, assumed: Assumed) -> Self {
        let blocks: Vec<_> = match sharing {
            Sharing::All => vec![solved.block(shape, None)],
            Sharing::ByAxis | Sharing::Common => (0..3).map(|axis| solved.block(shape, Some(axis))).collect(),
        };
        let scatter: Vec<_> = match sharing {
            Sharing::ByAxis => {
                blocks.iter().map(|block| PlacementScatter::learn(std::slice::from_ref(block), assumed)).collect()
            }
            Sharing::All | Sharing::Common => vec![PlacementScatter::learn(&blocks, assumed)],
        };
        let of_block = |i: usize| scatter.get(i).or(scatter.first());
        let (mut squares, mut count) = (0.0, 0);
        let mut leaks = Vec::new();
        for (i, block) in blocks.iter().enumerate() {
            let between = of_block(i).map_or(0.0, PlacementScatter::typical);
            let leaking = block.leaking(between, assumed.leak);
            let credible = leaking.filter(|of| of.leaks.iter().all(|(leak, _)| leak.abs() <= CREDIBLE * assumed.leak));
            squares += credible.as_ref().map_or(&block.residuals, |leaking| &leaking.left).norm_squared();
            count += block.residuals.len();
            leaks.extend(credible.into_iter().flat_map(|leaking| leaking.leaks));
        }
        let left_rms = (squares / count.max(1) as f64).sqrt();
        let leak_rms = match leaks.len() {
            0 => assumed.leak,
            leaking => {
                (leaks.iter().map(|(leak, variance)| leak * leak + variance).sum::<f64>() / leaking as f64).sqrt()
            }
        };
        Self { sharing, scatter, left_rms, leak_rms }
    }

    /// Variance between placements, for the weights of an axis.
    pub fn between(&self, axis: usize) -> f64 {
        self.of_axis(axis).typical()
    }

    /// Weighted sum of squares over its degrees of freedom, at the assumed scatter; `None` without redundancy.
    pub fn chi2_per_dof(&self) -> Option<f64> {
        let freedom = self.freedom();
        let squares: f64 = self.scatter.iter().map(PlacementScatter::squares).sum();
        (freedom >= 0.5).then(|| squares / freedom)
    }

    /// Degrees of freedom of [`chi2_per_dof`](Self::chi2_per_dof).
    pub fn freedom(&self) -> f64 {
        self.scatter.iter().map(PlacementScatter::freedom).sum()
    }

    /// Standard deviations between placements: one for all axes, or one for each.
    pub fn placement_std(&self) -> Vec<f64> {
        self.scatter.iter().map(|scatter| scatter.typical().sqrt()).collect()
    }

    /// Variance between placements: the likeliest; one of whose roots 1.96 bound 95 %; and the variance of an estimate
    /// of it.
    pub fn between_placements(&self) -> [f64; 3] {
        let scatter = self.of_axis(0);
        [scatter.typical(), scatter.most(), scatter.spread()]
    }

    /// Covariance of the unknowns from leaks, which are the same at every placement and do not average out.
    pub fn leakage(&self, solved: &Solved, gain: &DMatrix<f64>) -> DMatrix<f64> {
        let by_leak = gain * &solved.leaks * self.leak_rms;
        &by_leak * by_leak.transpose()
    }

    /// Covariance of the unknowns of a solution, such that each is within 1.96 standard deviations with a probability
    /// of 95 %: it includes Student's quantile. `other` does not come from the equations.
    pub fn covariance(
        &self,
        shape: Parameterisation,
        solved: &Solved,
        gain: &DMatrix<f64>,
        other: &Other,
    ) -> DMatrix<f64> {
        let known = solved.spread(gain, |row| row.noise) + self.leakage(solved, gain) + &other.covariance;
        let placements = solved.spread(gain, Row::gain);
        let mut covariance = known.clone();
        let mut stretch = Vec::new();
        for (i, term) in shape.terms().iter().enumerate() {
            let scatter = self.of(*term);
            for (j, second) in shape.terms().iter().enumerate() {
                let typical = (scatter.typical() * self.of(*second).typical()).sqrt();
                covariance[(i, j)] += typical * placements[(i, j)];
            }
            let std = scatter.std(placements[(i, i)], known[(i, i)], other.spread[i]);
            stretch.push(if covariance[(i, i)] > 0.0 { std / covariance[(i, i)].sqrt() } else { 1.0 });
        }
        DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| covariance[(i, j)] * stretch[i] * stretch[j])
    }

    fn of(&self, term: Term) -> &PlacementScatter {
        self.of_axis(term.axis())
    }

    fn of_axis(&self, axis: usize) -> &PlacementScatter {
        match self.sharing {
            Sharing::All | Sharing::Common => &self.scatter[0],
            Sharing::ByAxis => &self.scatter[axis],
        }
    }
}
