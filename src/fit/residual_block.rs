//! Equations with their residuals, and the part of these that unknowns and leaks can take up.
//! [`PlacementScatter`](super::PlacementScatter) derives the scatter between placements from them.

use nalgebra::{DMatrix, DVector};

/// Equations with unknowns of their own; several blocks may share a scatter.
#[derive(Clone, Debug)]
pub struct ResidualBlock {
    /// Design of the unknowns, not weighted: equations × unknowns.
    pub design: DMatrix<f64>,
    /// Design of the leaks, which the model does not estimate: equations × leaks.
    pub leaks: DMatrix<f64>,
    /// Residuals of a fit.
    pub residuals: DVector<f64>,
    /// Variances of the equations from noise alone.
    pub noise: DVector<f64>,
    /// Variances that a unit of variance between placements adds to the equations.
    pub gain: DVector<f64>,
}

/// Estimate of the leaks.
#[derive(Clone, Debug)]
pub struct Leaking {
    /// Residuals without the leaks.
    pub left: DVector<f64>,
    /// Likeliest value of each leak, and its variance.
    pub leaks: Vec<(f64, f64)>,
}

/// Residuals once unknowns and leaks are fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Left {
    /// Weighted sum of squares.
    pub(super) squares: f64,
    /// Degrees of freedom, the expectation of that sum.
    pub(super) freedom: f64,
    /// Effective number of squares for the scatter: an equation that leaks may explain still counts in part.
    pub(super) telling: f64,
}

impl ResidualBlock {
    /// Estimates the leaks, and the residuals without them; `None` if there are none.
    pub fn leaking(&self, between: f64, leak: f64) -> Option<Leaking> {
        let unknowns = self.design.ncols();
        let leaks = self.leaks.ncols();
        if leaks == 0 || leak <= 0.0 {
            return None;
        }
        let all = DMatrix::from_fn(self.residuals.len(), unknowns + leaks, |r, c| {
            if c < unknowns { self.design[(r, c)] } else { self.leaks[(r, c - unknowns)] }
        });
        let weights = DVector::from_fn(all.nrows(), |r, _| 1.0 / (self.gain[r] * between + self.noise[r]));
        let mut weighted = all.clone();
        weighted.row_iter_mut().zip(&weights).for_each(|(mut row, weight)| row *= *weight);
        let mut information = weighted.tr_mul(&all);
        for k in unknowns..unknowns + leaks {
            information[(k, k)] += 1.0 / (leak * leak);
        }
        let factor = information.cholesky()?;
        let likeliest = factor.solve(&weighted.tr_mul(&self.residuals)).rows(unknowns, leaks).into_owned();
        let variances = factor.inverse().diagonal();
        // The unknowns stay unchanged, because a bound may hold them.
        let left = &self.residuals - &self.leaks * &likeliest;
        Some(Leaking { left, leaks: likeliest.iter().copied().zip(variances.iter().skip(unknowns).copied()).collect() })
    }

    /// Residuals at a level of scatter; `None` if they are not determined.
    pub(super) fn left(&self, between: f64, leak: f64) -> Option<Left> {
        let unknowns = self.design.ncols();
        let leaks = if leak > 0.0 { self.leaks.ncols() } else { 0 };
        let size = unknowns + leaks;
        let entry = |r: usize, k: usize| if k < unknowns { self.design[(r, k)] } else { self.leaks[(r, k - unknowns)] };
        // Lower triangle of the information, row by row: a refit spends its time here.
        let mut lower = vec![0.0; size * (size + 1) / 2];
        let mut answer = DVector::<f64>::zeros(size);
        let mut row = vec![0.0; size];
        for r in 0..self.residuals.len() {
            let variance = self.gain[r] * between + self.noise[r];
            if variance.is_nan() || variance <= 0.0 {
                return None;
            }
            row.iter_mut().enumerate().for_each(|(k, x)| *x = entry(r, k));
            let mut entries = lower.iter_mut();
            for (k, x) in row.iter().enumerate() {
                let weighted = x / variance;
                answer[k] += weighted * self.residuals[r];
                row[..=k].iter().zip(&mut entries).for_each(|(y, entry)| *entry += weighted * y);
            }
        }
        let sum = |i: usize, j: usize| lower[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
        let prior = |k: usize| if k < unknowns { 0.0 } else { 1.0 / (leak * leak) };
        // Columns may differ by orders of magnitude.
        let scale = DVector::from_fn(size, |k, _| (sum(k, k) + prior(k)).sqrt());
        let scaled = DMatrix::from_fn(size, size, |i, j| {
            let prior = if i == j { prior(i) } else { 0.0 };
            (sum(i, j) + prior) / (scale[i] * scale[j])
        });
        let factor = scaled.cholesky()?;
        let fitted = factor.solve(&answer.component_div(&scale)).component_div(&scale);
        // An equation that does not depend on placements says nothing of their scatter; like a prior, it only saves the
        // others a part of an unknown.
        let (of_placements, known): (Vec<_>, Vec<_>) = (0..self.residuals.len()).partition(|&r| self.gain[r] > 0.0);
        let squares = of_placements.iter().map(|&r| {
            let left = self.residuals[r] - (0..size).map(|k| entry(r, k) * fitted[k]).sum::<f64>();
            left * left / (self.gain[r] * between + self.noise[r])
        });
        let squares = squares.sum();
        let saved = known.iter().map(|&r| {
            let row = DVector::from_fn(size, |k, _| entry(r, k) / scale[k]);
            row.dot(&factor.solve(&row)) / self.noise[r]
        });
        // Every unknown takes a degree of freedom, a leak as much of one as the data determine it.
        let whole = of_placements.len() as f64 - (unknowns as f64 - saved.sum::<f64>());
        let (mut freedom, mut parts) = (whole, whole);
        if leaks > 0 {
            let inverse = factor.inverse();
            let unsaid = |k: usize| inverse[(k, k)] / (scale[k] * scale[k] * leak * leak);
            freedom -= (unknowns..size).map(|k| 1.0 - unsaid(k)).sum::<f64>();
            parts -= (unknowns..size).map(|k| 1.0 - unsaid(k).powi(2)).sum::<f64>();
        }
        // A sum of squares that count in part varies less (Satterthwaite 1946).
        let telling = if freedom > 0.0 { (freedom * freedom / parts).clamp(freedom, whole.max(freedom)) } else { 0.0 };
        Some(Left { squares, freedom, telling })
    }
}

/// Harmonic mean of the noise variances over the gains.
pub(super) fn typical_noise(blocks: &[ResidualBlock]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for block in blocks {
        for (noise, gain) in block.noise.iter().zip(&block.gain).filter(|(_, gain)| **gain > 0.0) {
            sum += gain / noise.max(1e-30);
            count += 1.0;
        }
    }
    count / sum
}
