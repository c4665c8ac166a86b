//! Scatter of placements beyond what noise explains, and its effect on the uncertainty of an estimate.
//!
//! Random effects: a residual is `design · δx + leaks · c + placement + noise`. Placements scatter with an unknown
//! variance τ², noise with a known one. The leaks c (cross-axis sensitivities that the model does not estimate) are
//! constants of the sensor, drawn once from their assumed distribution. The equations are weighted with the τ² at which
//! the weighted sum of squared residuals equals its degrees of freedom (Paule & Mandel 1982).
//!
//! The uncertainty of τ² comes from its posterior, which cannot be negative: where noise dominates, squares that are
//! small by chance do not make noise smaller than it is, and large squares need not come from placements. A priori
//! every order of magnitude of τ is equally likely, and all values far below the assumed one are alike (a prior uniform
//! in ln(1 + τ/c)). An interval is Student's, with the degrees of freedom of a variance with this mean and uncertainty
//! (Satterthwaite 1946): those of the squares where placements dominate, ever more where noise or leaks do.
//!
//! The assumed τ is trusted while the data say nothing about it: without redundancy, or where it would drown in noise.
//! As data come in, the assumption counts as ever fewer degrees of freedom, and as none once they have four; otherwise
//! a scatter of a third of the assumed one would drown in it.

use super::residual_block::{Left, ResidualBlock, typical_noise};
use super::student_t::{NORMAL_95, NORMAL_999, student_95, student_999};

/// Prior assumptions, as standard deviations.
#[derive(Clone, Copy, Debug)]
pub struct Assumed {
    /// Scatter of placements.
    pub placement: f64,
    /// Size of each leak.
    pub leak: f64,
}

/// Knowledge of the variance between placements.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacementScatter {
    /// Variance for the weights.
    typical: f64,
    /// Posterior mean of the variance, and the posterior variance of it.
    mean: f64,
    doubt: f64,
    /// Variance of an estimate like `typical`.
    spread: f64,
    /// Noise variance of a typical equation.
    noise: f64,
    /// Weighted sum of squared residuals at the assumed scatter, and its degrees of freedom.
    squares: f64,
    freedom: f64,
}

/// Degrees of freedom from which on the data alone count.
const ENOUGH: f64 = 4.0;
/// Degrees of freedom that the assumption is worth when the data have half of [`ENOUGH`].
const TRUST: f64 = 20.0;
/// A τ counts as small below this share of the assumed one and of five standard deviations of noise (half of what noise
/// may hide), added in quadrature.
const SMALL: f64 = 0.1;

impl PlacementScatter {
    /// Scatter as assumed, without data.
    pub fn assumed(std: f64) -> Self {
        let variance = std * std;
        Self { typical: variance, mean: variance, doubt: 0.0, spread: 0.0, noise: 0.0, squares: 0.0, freedom: 0.0 }
    }

    /// Learns the scatter from the equations.
    pub fn learn(blocks: &[ResidualBlock], assumed: Assumed) -> Self {
        const ROUNDS: usize = 30;
        /// Relative step of the variance at convergence: a hundredth of its uncertainty, or less.
        const NEAR: f64 = 1e-3;
        let prior = assumed.placement * assumed.placement;
        let left_over = |between: f64| -> Option<Left> {
            let mut sum = Left { squares: 0.0, freedom: 0.0, telling: 0.0 };
            for block in blocks {
                let left = block.left(between, assumed.leak)?;
                sum.squares += left.squares;
                sum.freedom += left.freedom;
                sum.telling += left.telling;
            }
            Some(sum)
        };
        let at_word = Self::assumed(assumed.placement);
        let Some(first) = left_over(prior) else { return at_word };
        // Rounding may leave a tiny fraction of a degree of freedom.
        if first.freedom < 0.01 {
            return at_word;
        }
        // In terms of the variance of a typical equation, which is at least that of noise.
        let noise = typical_noise(blocks);
        let (mut variance, mut left) = (noise + prior, first);
        let mut trusted = 0.0;
        for _ in 0..ROUNDS {
            // Only the degrees of freedom that noise leaves to the placements count.
            let share = (variance - noise).max(prior) / variance.max(noise + prior);
            trusted = trust(left.freedom * share);
            let times = (left.squares + trusted * (noise + prior) / variance) / (left.freedom + trusted);
            let next = (variance * times).max(noise);
            let moved = (next / variance - 1.0).abs();
            if moved.is_nan() || moved < NEAR {
                break;
            }
            let Some(there) = left_over(next - noise) else { return at_word };
            (variance, left) = (next, there);
        }
        if !(variance.is_finite() && left.freedom + trusted > 0.0) {
            return at_word;
        }
        let said = Said {
            squares: left.squares * variance * left.telling / left.freedom + trusted * (noise + prior),
            freedom: left.telling + trusted,
        };
        let (mean, doubt) = said.of_placements(noise, SMALL * libm::hypot(assumed.placement, 5.0 * noise.sqrt()));
        if !(mean.is_finite() && doubt.is_finite()) {
            return at_word;
        }
        let spread = 2.0 * variance * variance / said.freedom;
        Self { typical: variance - noise, mean, doubt, spread, noise, squares: first.squares, freedom: first.freedom }
    }

    /// Variance between placements, for the weights of equations.
    pub fn typical(&self) -> f64 {
        self.typical
    }

    /// Weighted sum of squared residuals at the assumed scatter.
    pub fn squares(&self) -> f64 {
        self.squares
    }

    /// Degrees of freedom of [`squares`](Self::squares); zero without redundancy.
    pub fn freedom(&self) -> f64 {
        self.freedom
    }

    /// Variance of an estimate of the variance between placements.
    pub fn spread(&self) -> f64 {
        self.spread
    }

    /// Standard deviation of an error of variance `gain · τ² + rest`, such that 1.96 of them hold at least 95 % of its
    /// errors and 3.29 of them 99.9 %; `spread` is the variance with which `rest` was estimated.
    pub fn std(&self, gain: f64, rest: f64, spread: f64) -> f64 {
        let (mean, doubt) = (gain * self.mean + rest, gain * gain * self.doubt);
        if !(mean > 0.0 && mean.is_finite()) {
            return mean.max(0.0).sqrt();
        }
        // Degrees of freedom of an inverse χ² with this mean and variance; an error with such a variance is Student's.
        // The inverses of the degrees of freedom add up.
        let fewer = doubt / (4.0 * doubt + 2.0 * mean * mean);
        let variance = mean * (1.0 - 2.0 * fewer);
        let fewer = fewer + spread / (4.0 * spread + 2.0 * variance * variance);
        if fewer <= 0.0 { variance.sqrt() } else { stretch(1.0 / fewer) * variance.sqrt() }
    }

    /// Variance between placements of whose roots 1.96 bound the error of a further one.
    pub fn most(&self) -> f64 {
        (self.std(1.0, self.noise, 0.0).powi(2) - self.noise).max(self.typical)
    }
}

/// Evidence on the variance of a typical equation: the sum of so many independent squares.
struct Said {
    squares: f64,
    freedom: f64,
}

impl Said {
    /// Posterior mean and variance of τ², where noise adds to it; the prior is flat for τ below `small`.
    fn of_placements(&self, noise: f64, small: f64) -> (f64, f64) {
        const LEVELS: usize = 48;
        let Self { squares, freedom } = *self;
        let middle = (squares / freedom).max(noise);
        // Beyond this the posterior is less than e⁻¹² of its maximum, except with very few degrees of freedom.
        let width = (48.0 / freedom).sqrt().min(3.0);
        let tau = |log_variance: f64| (libm::exp(log_variance) - noise).max(0.0).sqrt();
        let level = |tau: f64| libm::log1p(tau / small);
        let log_middle = libm::log(middle);
        let (low, high) = (level(tau(log_middle - width)), level(tau(log_middle + width + 2.0 * width * width / 3.0)));
        let step = (high - low) / (LEVELS - 1) as f64;
        let at = |k: usize| {
            let tau = small * libm::expm1(low + step * k as f64);
            let variance = noise + tau * tau;
            (tau * tau, -0.5 * (freedom * libm::log(variance) + squares / variance))
        };
        let levels: [(f64, f64); LEVELS] = std::array::from_fn(at);
        let most = levels.iter().map(|level| level.1).fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for (between, log) in levels {
            let weight = libm::exp(log - most);
            sum += weight;
            first += weight * between;
            second += weight * between * between;
        }
        let mean = first / sum;
        (mean, (second / sum - mean * mean).max(0.0))
    }
}

/// Factor that stretches a standard deviation, estimated with so many degrees of freedom, until 1.96 of it hold 95 %
/// and 3.29 of it 99.9 % of the errors. With very few degrees the far tail is of no use.
pub(super) fn stretch(freedom: f64) -> f64 {
    const FEW: f64 = 6.0;
    (student_95(freedom) / NORMAL_95).max(student_999(freedom.max(FEW)) / NORMAL_999)
}

/// Degrees of freedom that the assumption is worth beside those of the data.
fn trust(freedom: f64) -> f64 {
    const MOST: f64 = 1e3;
    let over = (ENOUGH / freedom.max(f64::MIN_POSITIVE) - 1.0).max(0.0);
    (TRUST * over.powi(4)).min(MOST)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::*;

    const ASSUMED: Assumed = Assumed { placement: 0.01, leak: 0.0 };

    /// Equations of `count` readings of one number about their mean.
    fn mean_of(readings: &[f64], noise: f64) -> (ResidualBlock, f64) {
        let count = readings.len();
        let mean = readings.iter().sum::<f64>() / count as f64;
        let block = ResidualBlock {
            design: DMatrix::repeat(count, 1, 1.0),
            leaks: DMatrix::zeros(count, 0),
            residuals: DVector::from_iterator(count, readings.iter().map(|reading| reading - mean)),
            noise: DVector::repeat(count, noise * noise),
            gain: DVector::repeat(count, 1.0),
        };
        (block, mean)
    }

    /// Share of 4000 intervals of a mean of zero that hold it, percent.
    fn coverage(count: usize, placement: f64, noise: f64) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(count as u64);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let inside = (0..4000).filter(|_| {
            let readings: Vec<_> = (0..count).map(|_| placement * normal() + noise * normal()).collect();
            let (block, mean) = mean_of(&readings, noise);
            let n = count as f64;
            mean.abs() <= NORMAL_95 * PlacementScatter::learn(&[block], ASSUMED).std(1.0 / n, noise * noise / n, 0.0)
        });
        inside.count() as f64 / 40.0
    }

    #[test]
    fn without_redundancy_the_assumption_rules() {
        let (block, _) = mean_of(&[3.0], 1e-3);
        let scatter = PlacementScatter::learn(&[block], ASSUMED);
        assert_eq!(scatter, PlacementScatter::assumed(0.01));
        assert!((scatter.std(1.0, 1e-6, 0.0) - 1.01e-4_f64.sqrt()).abs() < 1e-12);
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
                assert!((93.0..99.3).contains(&covered), "{count} readings, {placement} and {noise}: {covered} %");
            }
        }
    }

    #[test]
    fn where_placements_dominate_the_quantile_is_students() {
        let readings: Vec<f64> = (0..9).map(|i| f64::from((i * 7) % 9) - 4.0).collect();
        let (block, _) = mean_of(&readings, 1e-4);
        let scatter = PlacementScatter::learn(&[block], ASSUMED);
        // Their variance is 7.5; 5.041 is Student's 99.9 % quantile for eight degrees of freedom.
        let expected = 5.041 * 7.5_f64.sqrt();
        assert!((scatter.std(1.0, 0.0, 0.0) * NORMAL_999 / expected - 1.0).abs() < 0.003, "{expected}");
    }

    #[test]
    fn noise_is_not_counted_as_scatter() {
        let readings: Vec<_> = (0..400).map(|i| if i % 2 == 0 { 0.01 } else { -0.01 }).collect();
        let (block, _) = mean_of(&readings, 0.01);
        assert!(PlacementScatter::learn(&[block], ASSUMED).typical().sqrt() < 0.004);
    }

    #[test]
    fn what_is_the_same_at_every_placement_is_not_counted_as_scatter() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let leaks = DMatrix::from_fn(40, 2, |_, _| normal());
        let noise = DVector::from_fn(40, |_, _| 0.003 * normal());
        let residuals = &leaks * DVector::from_vec(vec![0.1, -0.05]) + noise;
        let mut block = ResidualBlock {
            design: DMatrix::repeat(40, 1, 1.0),
            leaks,
            residuals,
            noise: DVector::repeat(40, 1e-8),
            gain: DVector::repeat(40, 1.0),
        };
        let typical = |block: &ResidualBlock| {
            PlacementScatter::learn(std::slice::from_ref(block), Assumed { leak: 0.1, ..ASSUMED }).typical().sqrt()
        };
        assert!((0.0025..0.0038).contains(&typical(&block)), "{}", typical(&block));
        block.leaks = DMatrix::zeros(40, 0);
        assert!(typical(&block) > 0.05);
    }

    #[test]
    fn what_does_not_come_from_placements_says_nothing_of_their_scatter() {
        let readings: Vec<f64> = (0..9).map(|i| 0.01 * (f64::from((i * 7) % 9) - 4.0)).collect();
        let (alone, _) = mean_of(&readings, 1e-4);
        // Five statements on the mean, each of little weight, that agree with it by themselves.
        let with = ResidualBlock {
            design: DMatrix::repeat(14, 1, 1.0),
            leaks: DMatrix::zeros(14, 0),
            residuals: alone.residuals.clone().resize_vertically(14, 0.0),
            noise: alone.noise.clone().resize_vertically(14, 1.0),
            gain: alone.gain.clone().resize_vertically(14, 0.0),
        };
        let [alone, with] = [alone, with].map(|block| PlacementScatter::learn(&[block], ASSUMED));
        assert!((with.typical() / alone.typical() - 1.0).abs() < 1e-3, "{} {}", with.typical(), alone.typical());
        assert!((with.freedom() - alone.freedom()).abs() < 1e-2, "{} {}", with.freedom(), alone.freedom());
    }
}
