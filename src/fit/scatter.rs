//! How far placements scatter beyond what noise explains, and what that leaves of any estimate's certainty. Which
//! equations tell of it is left to the fits, and what these leave over to [`Block`].
//!
//! Random effects: what an equation leaves over is `design · δx + leaks · c + placement + noise`. Placements scatter with
//! a variance τ² that nobody knows, noise with one that is known, and the leaks c (the cross-axis sensitivities that the
//! model has no word for) are constants of the sensor, drawn once from what is assumed of them. τ² is such that the
//! weighted squares that are left over are as many as their degrees of freedom (Paule & Mandel 1982).
//!
//! An interval is Student's, with the degrees of freedom that the sum of a variance that was estimated and of others that
//! are known has (Satterthwaite 1946): where placements dominate those of the squares, where noise or leaks do ever more.
//!
//! What is assumed of τ is taken at its word while the data say nothing of it: without redundancy, and where it would
//! drown in noise. As they come to speak, the assumption counts as ever fewer degrees of freedom, and is forgotten once
//! they have four: a scatter of a third of what was assumed would otherwise drown in it.

use super::block::{Block, Left, typical_noise};
use super::student::{NORMAL_95, student_95};

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
    /// The variance.
    between: f64,
    /// What noise adds to it in a typical equation.
    noise: f64,
    /// Degrees of freedom that the sum of both is known with; infinite where it is taken at its word.
    known: f64,
    /// Weighted sum of squares of what is left over, at what was assumed, and the degrees of freedom of that.
    squares: f64,
    freedom: f64,
}

/// From so many degrees of freedom on the data speak alone.
const ENOUGH: f64 = 4.0;
/// What is assumed is worth as many beside half of that.
const TRUST: f64 = 20.0;

impl Scatter {
    /// What is assumed, and nothing else.
    pub fn assumed(std: f64) -> Self {
        Self { between: std * std, noise: 0.0, known: f64::INFINITY, squares: 0.0, freedom: 0.0 }
    }

    /// What the equations tell of it.
    pub fn learn(blocks: &[Block], assumed: Assumed) -> Self {
        const ROUNDS: usize = 30;
        /// Of the variance: a hundredth of its uncertainty, or less.
        const NEAR: f64 = 1e-3;
        let prior = assumed.placement * assumed.placement;
        let left_over = |between: f64| -> Option<Left> {
            let mut sum = Left { squares: 0.0, freedom: 0.0 };
            for block in blocks {
                let left = block.left(between, assumed.leak)?;
                sum.squares += left.squares;
                sum.freedom += left.freedom;
            }
            Some(sum)
        };
        let at_word = Self::assumed(assumed.placement);
        let Some(first) = left_over(prior) else { return at_word };
        // Rounding may leave a crumb of a degree.
        if first.freedom < 0.01 {
            return at_word;
        }
        // Everything is thought of in terms of the variance of a typical equation, of which noise is the least.
        let noise = typical_noise(blocks);
        let (mut variance, mut left) = (noise + prior, first);
        let mut known = first.freedom;
        for _ in 0..ROUNDS {
            // Of the degrees of freedom those count that noise leaves to the placements.
            let share = (variance - noise).max(prior) / variance.max(noise + prior);
            let trust = trust(left.freedom * share);
            known = left.freedom + trust;
            let times = (left.squares + trust * (noise + prior) / variance) / known;
            let next = (variance * times).max(noise);
            let moved = (next / variance - 1.0).abs();
            variance = next;
            if moved.is_nan() || moved < NEAR {
                break;
            }
            let Some(there) = left_over(variance - noise) else { return at_word };
            left = there;
        }
        if !(variance.is_finite() && known > 0.0) {
            return at_word;
        }
        Self { between: variance - noise, noise, known, squares: first.squares, freedom: first.freedom }
    }

    /// The variance between placements, to weight equations with.
    pub fn typical(&self) -> f64 {
        self.between
    }

    /// Weighted sum of squares of what the equations left over, at what was assumed of the scatter.
    pub fn squares(&self) -> f64 {
        self.squares
    }

    /// The degrees of freedom of that; zero without redundancy.
    pub fn freedom(&self) -> f64 {
        self.freedom
    }

    /// Standard deviation of an error of variance `gain · τ² + rest`, such that 1.96 of them are half of its 95 % interval.
    pub fn std(&self, gain: f64, rest: f64) -> f64 {
        let variance = gain * self.between + rest;
        let estimated = gain * (self.between + self.noise);
        if !(variance > 0.0 && variance.is_finite()) {
            return variance.max(0.0).sqrt();
        }
        // Where what counts as noise in the equations cancels in the error, less is left than was estimated, and that is
        // the less certain.
        let certainty = (variance / estimated).max(0.5);
        student_95(self.known * certainty * certainty) / NORMAL_95 * variance.sqrt()
    }

    /// The variance between placements such that 1.96 of its roots bound what a further one is off by.
    pub fn most(&self) -> f64 {
        (self.std(1.0, self.noise).powi(2) - self.noise).max(self.between)
    }
}

/// How many degrees of freedom what is assumed is worth beside so many of the data.
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
        assert!((scatter.std(1.0, 0.0) * NORMAL_95 / expected - 1.0).abs() < 0.003, "{expected}");
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
