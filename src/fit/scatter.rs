//! How far placements scatter beyond what noise explains, and what that leaves of any estimate's certainty. Which
//! equations tell of it is left to the fits.
//!
//! Random effects: what an equation leaves over is `design · δx + leaks · c + placement + noise`. Placements scatter with
//! a variance τ² that nobody knows, noise with one that is known, and the leaks c (the cross-axis sensitivities that the
//! model has no word for) are constants of the sensor, drawn once from what is assumed of them. The posterior of τ² comes
//! from the restricted likelihood (Patterson & Thompson 1971), over a grid of levels; an interval then is that of a
//! mixture of normal errors, one a level. Where placements dominate and there are no leaks, this is Student's t.
//!
//! What is assumed of τ is taken at its word while there is no redundancy, since then there is nothing else. With it,
//! the assumption counts as ever fewer degrees of freedom, and is forgotten once the data have four: a scatter of a third
//! of what was assumed would otherwise drown in it.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Equations with unknowns of their own; several blocks may share a scatter.
#[derive(Clone, Debug)]
pub struct Block {
    /// By the unknowns, not weighted: equations × unknowns.
    pub design: DMatrix<f64>,
    /// By what the model has no word for: equations × leaks.
    pub leaks: DMatrix<f64>,
    /// What a fit left over.
    pub residuals: DVector<f64>,
    /// Variances of the equations by noise alone.
    pub noise: DVector<f64>,
    /// What a unit of variance between placements adds to those.
    pub gain: DVector<f64>,
}

/// What is assumed before the data speak, as standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Assumed {
    /// Of placements.
    pub placement: f64,
    /// Of each leak.
    pub leak: f64,
}

/// What is known of the variance between placements.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// Variances with their probabilities.
    levels: Vec<(f64, f64)>,
    /// The variance to weight with.
    typical: f64,
    /// Weighted sum of squares of what is left over, at what was assumed, and the degrees of freedom of that.
    squares: f64,
    freedom: f64,
}

/// What the equations tell of the leaks.
#[derive(Clone, Debug)]
pub struct Leaking {
    /// What is left over without them.
    pub left: DVector<f64>,
    /// The likeliest value of each, and its variance.
    pub leaks: Vec<(f64, f64)>,
}

/// From so many degrees of freedom on the data speak alone.
const ENOUGH: f64 = 4.0;
/// So many is what is assumed worth beside the first crumb of redundancy.
const TRUST: f64 = 12.0;
/// Levels of the grid.
const LEVELS: usize = 20;
/// Half width of a normal error's 95 % interval over its standard deviation.
const NORMAL_95: f64 = 1.959_963_984_540_054;

impl Scatter {
    /// What is assumed, and nothing else.
    pub fn assumed(std: f64) -> Self {
        Self { levels: vec![(std * std, 1.0)], typical: std * std, squares: 0.0, freedom: 0.0 }
    }

    /// What the equations tell of it.
    pub fn learn(blocks: &[Block], assumed: Assumed) -> Self {
        let prior = assumed.placement * assumed.placement;
        let products: Vec<_> = blocks.iter().map(|block| Products::of(block, assumed.leak)).collect();
        let at_prior = products.iter().map(|products| products.likelihood(prior));
        let Some(at_prior) = at_prior.collect::<Option<Vec<_>>>() else { return Self::assumed(assumed.placement) };
        let freedom: f64 = products.iter().zip(&at_prior).map(|(products, at)| products.freedom(at)).sum();
        // Rounding may leave a crumb of a degree.
        if freedom < 0.01 {
            return Self::assumed(assumed.placement);
        }
        let squares: f64 = at_prior.iter().map(|at| at.squares).sum();
        // Everything is thought of in terms of the variance of a typical equation, of which noise is the least.
        let noise = typical_noise(blocks);
        let trust = trust(freedom);
        let total = freedom + trust;
        let centre = (noise + prior) * (squares + trust) / total;
        // Wide enough that what lies beyond is improbable by e⁻¹⁴.
        let width = (56.0 / total).sqrt();
        let below = libm::log(1.0 + 28.0 / total + width);
        let above = width.max(1.0 + 28.0 / total);
        let low = libm::log(noise.max(centre * libm::exp(-below)));
        let high = libm::log(noise.max(centre)) + above;
        let step = (high - low) / (LEVELS - 1) as f64;
        let mut levels = Vec::with_capacity(LEVELS);
        for k in 0..LEVELS {
            let log = low + step * k as f64;
            let variance = libm::exp(log);
            let between = (variance - noise).max(0.0);
            let of_blocks = products.iter().map(|products| products.likelihood(between).map(|at| at.log));
            let Some(likelihood) = of_blocks.sum::<Option<f64>>() else { continue };
            // Scaled inverse χ² of `trust` degrees of freedom, uniform in the logarithm without.
            let density = likelihood - 0.5 * trust * (log + (noise + prior) / variance);
            let end = if k == 0 || k == LEVELS - 1 { 0.5 } else { 1.0 };
            levels.push((between, density, end));
        }
        let most = levels.iter().map(|level| level.1).fold(f64::NEG_INFINITY, f64::max);
        let mut levels: Vec<_> =
            levels.into_iter().map(|(between, density, end)| (between, end * libm::exp(density - most))).collect();
        let sum: f64 = levels.iter().map(|level| level.1).sum();
        if sum.is_nan() || sum <= 0.0 {
            return Self::assumed(assumed.placement);
        }
        levels.iter_mut().for_each(|level| level.1 /= sum);
        // What is improbable costs time and changes nothing.
        levels.retain(|level| level.1 > 1e-9);
        let mean_log: f64 = levels.iter().map(|(between, weight)| weight * libm::log(between + noise)).sum();
        Self { typical: (libm::exp(mean_log) - noise).max(0.0), levels, squares, freedom }
    }

    /// The variance between placements to weight equations with: the geometric mean.
    pub fn typical(&self) -> f64 {
        self.typical
    }

    /// Weighted sum of squares of what the equations left over, at what was assumed of the scatter.
    pub fn squares(&self) -> f64 {
        self.squares
    }

    /// The degrees of freedom of that; zero without redundancy.
    pub fn freedom(&self) -> f64 {
        self.freedom
    }

    /// Standard deviation of an error of variance `gain · τ² + rest`, such that 1.96 of them are half of its 95 %
    /// interval, whatever the shape of its distribution.
    pub fn std(&self, gain: f64, rest: f64) -> f64 {
        self.quantile(gain, rest, 0.95) / NORMAL_95
    }

    /// The length that such an error keeps to with this probability.
    pub fn quantile(&self, gain: f64, rest: f64, probability: f64) -> f64 {
        let variances = || self.levels.iter().map(|(between, weight)| (gain * between + rest, *weight));
        let mean: f64 = variances().map(|(variance, weight)| variance * weight).sum();
        if !(mean > 0.0 && mean.is_finite()) {
            return mean.max(0.0).sqrt();
        }
        // The distribution is concave: Newton's steps come from the left, once they are there.
        let mut length = NORMAL_95 * mean.sqrt();
        for _ in 0..60 {
            let (mut inside, mut density) = (0.0, 0.0);
            for (variance, weight) in variances() {
                let z = length / (2.0 * variance.max(f64::MIN_POSITIVE)).sqrt();
                inside += weight * libm::erf(z);
                density += weight * libm::exp(-z * z) / variance.max(f64::MIN_POSITIVE).sqrt();
            }
            let step = (inside - probability) / (density * (2.0 / std::f64::consts::PI).sqrt());
            let next = if step < length { length - step } else { length / 2.0 };
            if !next.is_finite() {
                return length;
            }
            if (next - length).abs() <= 1e-12 * length {
                return next;
            }
            length = next;
        }
        length
    }
}

/// How many degrees of freedom what is assumed is worth beside so many of the data.
pub fn trust(freedom: f64) -> f64 {
    TRUST * (1.0 - freedom / ENOUGH).max(0.0).powi(2)
}

/// What a block says of one level of scatter.
struct Likelihood {
    /// Logarithm of the restricted likelihood.
    log: f64,
    /// Weighted sum of squares of what is left over.
    squares: f64,
    /// Of the information matrix, its columns scaled.
    factor: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
}

impl Block {
    /// What is left over once the likeliest leaks are taken out, and those; `None` where there are none.
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
        // The unknowns stay where they are: a bound may hold them there.
        let left = &self.residuals - &self.leaks * &likeliest;
        Some(Leaking { left, leaks: likeliest.iter().copied().zip(variances.iter().skip(unknowns).copied()).collect() })
    }
}

/// A block as its likelihood wants it: of every equation the products of what stands in it, which each level of scatter
/// weights anew. Here is where a refit spends its time.
struct Products<'a> {
    block: &'a Block,
    leak: f64,
    /// Unknowns and leaks.
    size: usize,
    /// Of one equation after the other the lower triangle of its share in the information, row by row, its answer to each
    /// unknown and leak, and its square.
    all: Vec<f64>,
}

impl<'a> Products<'a> {
    fn of(block: &'a Block, leak: f64) -> Self {
        let unknowns = block.design.ncols();
        let size = unknowns + if leak > 0.0 { block.leaks.ncols() } else { 0 };
        let mut all = Vec::with_capacity(block.residuals.len() * Self::width(size));
        for (r, residual) in block.residuals.iter().enumerate() {
            let entry = |k: usize| if k < unknowns { block.design[(r, k)] } else { block.leaks[(r, k - unknowns)] };
            all.extend((0..size).flat_map(|i| (0..=i).map(move |j| entry(i) * entry(j))));
            all.extend((0..size).map(|k| entry(k) * residual));
            all.push(residual * residual);
        }
        Self { block, leak, size, all }
    }

    /// How many products an equation has.
    fn width(size: usize) -> usize {
        size * (size + 1) / 2 + size + 1
    }

    fn likelihood(&self, between: f64) -> Option<Likelihood> {
        let Self { block, leak, size, .. } = *self;
        let mut sums = vec![0.0; Self::width(size)];
        let (mut log, mut product) = (0.0, 1.0);
        let variances = block.gain.iter().zip(&block.noise).map(|(gain, noise)| gain * between + noise);
        for (products, variance) in self.all.chunks_exact(sums.len()).zip(variances) {
            if variance.is_nan() || variance <= 0.0 {
                return None;
            }
            // One logarithm for many variances.
            product *= variance;
            if !(1e-200..1e200).contains(&product) {
                log += libm::log(product);
                product = 1.0;
            }
            let weight = 1.0 / variance;
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += weight * product);
        }
        log += libm::log(product);
        let (lower, answer) = sums.split_at(size * (size + 1) / 2);
        let (squares, answer) = answer.split_last()?;
        let entry = |i: usize, j: usize| lower[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
        let prior = |k: usize| if k < block.design.ncols() { 0.0 } else { 1.0 / (leak * leak) };
        // Columns may differ by orders of magnitude.
        let scale = DVector::from_fn(size, |k, _| (entry(k, k) + prior(k)).sqrt());
        let scaled = DMatrix::from_fn(size, size, |i, j| {
            let prior = if i == j { prior(i) } else { 0.0 };
            (entry(i, j) + prior) / (scale[i] * scale[j])
        });
        let factor = scaled.cholesky()?;
        let determinant: f64 =
            factor.l_dirty().diagonal().iter().zip(&scale).map(|(d, s)| 2.0 * libm::log(d * s)).sum();
        let answer = DVector::from_column_slice(answer).component_div(&scale);
        let left = (squares - factor.solve(&answer).dot(&answer)).max(0.0);
        Some(Likelihood { log: -0.5 * (log + determinant + left), squares: left, factor, scale })
    }

    /// Degrees of freedom of what is left over.
    fn freedom(&self, at: &Likelihood) -> f64 {
        // Every unknown takes one; a leak as much of one as the data tell of it.
        let inverse = at.factor.inverse();
        let unknowns = self.block.design.ncols();
        let unsaid = |k: usize| inverse[(k, k)] / (at.scale[k] * at.scale[k] * self.leak * self.leak);
        let by_leaks: f64 = (unknowns..at.scale.len()).map(|k| 1.0 - unsaid(k)).sum();
        self.block.residuals.len() as f64 - unknowns as f64 - by_leaks
    }
}

/// Harmonic mean of the noise variances over the gains.
fn typical_noise(blocks: &[Block]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for block in blocks {
        for (noise, gain) in block.noise.iter().zip(&block.gain) {
            sum += gain / noise.max(1e-30);
            count += 1.0;
        }
    }
    count / sum
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    const ASSUMED: Assumed = Assumed { placement: 0.01, leak: 0.0 };

    /// `count` readings of one number about their mean.
    fn mean_of(readings: &[f64], noise: f64) -> (Block, f64) {
        let count = readings.len();
        let mean = readings.iter().sum::<f64>() / count as f64;
        let block = Block {
            design: DMatrix::repeat(count, 1, 1.0),
            leaks: DMatrix::zeros(count, 0),
            residuals: DVector::from_iterator(count, readings.iter().map(|reading| reading - mean)),
            noise: DVector::repeat(count, noise * noise),
            gain: DVector::repeat(count, 1.0),
        };
        (block, mean)
    }

    /// How many of 4000 intervals of a mean of zero hold it, in percent.
    fn coverage(count: usize, placement: f64, noise: f64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(count as u64);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let inside = (0..4000).filter(|_| {
            let readings: Vec<_> = (0..count).map(|_| placement * normal() + noise * normal()).collect();
            let (block, mean) = mean_of(&readings, noise);
            let n = count as f64;
            mean.abs() <= NORMAL_95 * Scatter::learn(&[block], ASSUMED).std(1.0 / n, noise * noise / n)
        });
        inside.count() as f64 / 40.0
    }

    #[test]
    fn without_redundancy_the_assumption_rules() {
        let (block, _) = mean_of(&[3.0], 1e-3);
        let scatter = Scatter::learn(&[block], ASSUMED);
        assert_eq!(scatter, Scatter::assumed(0.01));
        assert!((scatter.std(1.0, 1e-6) - 1.01e-4_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn intervals_hold_as_often_as_they_say_when_the_assumption_is_right() {
        let covered = coverage(1, 0.01, 0.002);
        assert!((94.0..96.0).contains(&covered), "{covered} %");
    }

    #[test]
    fn intervals_hold_as_often_as_they_say_when_the_assumption_is_wrong() {
        for count in [7, 13, 40] {
            for (placement, noise) in [(0.03, 0.002), (0.003, 0.0005), (0.003, 0.002), (0.01, 0.01)] {
                let covered = coverage(count, placement, noise);
                assert!((93.0..97.5).contains(&covered), "{count} readings, {placement} and {noise}: {covered} %");
            }
        }
    }

    #[test]
    fn where_placements_dominate_the_quantile_is_students() {
        let readings: Vec<f64> = (0..9).map(|i| f64::from((i * 7) % 9) - 4.0).collect();
        let (block, _) = mean_of(&readings, 1e-4);
        let scatter = Scatter::learn(&[block], ASSUMED);
        // Their variance is 7.5; 2.306 is Student's quantile for eight degrees of freedom.
        let expected = 2.306 * 7.5_f64.sqrt();
        assert!((scatter.quantile(1.0, 0.0, 0.95) / expected - 1.0).abs() < 0.003, "{expected}");
    }

    #[test]
    fn noise_is_not_counted_as_scatter() {
        let readings: Vec<_> = (0..400).map(|i| if i % 2 == 0 { 0.01 } else { -0.01 }).collect();
        let (block, _) = mean_of(&readings, 0.01);
        assert!(Scatter::learn(&[block], ASSUMED).typical().sqrt() < 0.004);
    }

    #[test]
    fn what_is_the_same_at_every_placement_is_not_counted_as_scatter() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let leaks = DMatrix::from_fn(40, 2, |_, _| normal());
        let noise = DVector::from_fn(40, |_, _| 0.003 * normal());
        let residuals = &leaks * DVector::from_vec(vec![0.1, -0.05]) + noise;
        let mut block = Block {
            design: DMatrix::repeat(40, 1, 1.0),
            leaks,
            residuals,
            noise: DVector::repeat(40, 1e-8),
            gain: DVector::repeat(40, 1.0),
        };
        let typical = |block: &Block| {
            Scatter::learn(std::slice::from_ref(block), Assumed { leak: 0.1, ..ASSUMED }).typical().sqrt()
        };
        assert!((0.0025..0.0038).contains(&typical(&block)), "{}", typical(&block));
        block.leaks = DMatrix::zeros(40, 0);
        assert!(typical(&block) > 0.05);
    }
}
