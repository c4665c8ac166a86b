//! Noise densities of a triad from its Allan sums: white noise N, and the random walk K of its bias or an upper bound
//! of it.
//!
//! The model σ²(τ) = N²/τ + K²τ/3 is fitted by likelihood: a sum of squares over its expectation is χ², with the
//! degrees of freedom that the hypothesis itself implies. Neighbouring octaves of an overlapping estimator are partly
//! redundant, so these are divided by 1.5 for white noise and by 2.5 for a random walk.

use crate::still::{AllanSums, Octaves};

/// Noise of one axis, with 95 % intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseDensity {
    /// White noise N, in the unit of the triad per √Hz.
    pub density: f64,
    /// Interval of the white noise.
    pub interval: [f64; 2],
    /// Random walk K of the bias, per s√Hz, and the lower end of its interval; only if the rests are able to show one
    /// and do.
    pub random_walk: Option<(f64, f64)>,
    /// Upper end of the interval of the random walk; absent if the rests are too short to bound it.
    pub random_walk_high: Option<f64>,
}

/// Shortest τ that is used, s: shorter octaves show the sensor's filter rather than its noise.
const LEAST_TAU: f64 = 0.2;
/// Divisors of the degrees of freedom of overlapping octaves: white noise, random walk.
const OVERLAP: [f64; 2] = [1.5, 2.5];
/// Half of the 95 % quantile of χ² with one degree of freedom.
const PROFILE: f64 = 1.92;
/// A random walk can show if the shortest rest is at least this multiple of τx = √3 N/K …
const LEAST_REST: f64 = 1.5;
/// … and all rests together are at least this one.
const LEAST_TOTAL: f64 = 16.0;
/// Hypotheses K²/N² range from 1e-9 to 1e3 /s², with this many in a decade.
const PER_DECADE: usize = 24;
const LOWEST: f64 = -9.0;
const DECADES: usize = 12;

/// Noise of the three axes; `None` until a rest is long enough for one octave.
pub fn noise_densities(sums: &AllanSums) -> Option<[NoiseDensity; 3]> {
    let period = sums.period()?;
    let all = Hypotheses::of(&sums.all, period)?;
    let lasting = Hypotheses::of(&sums.lasting, period);
    let mut axes = Vec::with_capacity(3);
    for axis in 0..3 {
        let of_all = all.fit(axis)?;
        let of_lasting = lasting.as_ref().and_then(|lasting| lasting.fit(axis));
        axes.push(match of_lasting {
            None => NoiseDensity { random_walk: None, ..of_all },
            Some(fit) => NoiseDensity {
                random_walk: fit.random_walk.filter(|_| {
                    fit.random_walk_high.is_some_and(|walk| can_show(&sums.lasting, period, fit.density, walk))
                }),
                random_walk_high: fit.random_walk_high.or(of_all.random_walk_high),
                // All rests together say more about the white noise.
                ..of_all
            },
        });
    }
    axes.try_into().ok()
}

/// Whether such rests can show a random walk K beside a density N; to be asked with the largest likely K.
fn can_show(rests: &Octaves, period: f64, density: f64, walk: f64) -> bool {
    let crossing = 3_f64.sqrt() * density / walk;
    rests.shortest >= LEAST_REST * crossing && rests.samples as f64 * period >= LEAST_TOTAL * crossing
}

/// Octaves, and what each hypothesis κ = K²/N² expects of them.
struct Hypotheses {
    ratios: Vec<f64>,
    /// Expectations by hypothesis and octave: variance over N², its logarithm, degrees of freedom.
    expected: Vec<Vec<(f64, f64, f64)>>,
    /// Allan variances by octave.
    variances: Vec<[f64; 3]>,
    /// Degrees of freedom of the octaves if all noise is white.
    white: Vec<f64>,
}

impl Hypotheses {
    fn of(octaves: &Octaves, period: f64) -> Option<Self> {
        let tau = |level: usize| 4.0 * period * (1_u64 << level) as f64;
        let told = octaves.octaves.iter().enumerate().filter(|(_, octave)| octave.count > 0);
        let told: Vec<_> = told.map(|(level, octave)| (tau(level), octave)).collect();
        let skipped = told.partition_point(|(tau, _)| *tau < LEAST_TAU).min(told.len().checked_sub(1)?);
        let told = told.get(skipped..)?;
        let grid = 0..=DECADES * PER_DECADE;
        let grid = grid.map(|step| libm::exp10(LOWEST + step as f64 / PER_DECADE as f64));
        let ratios: Vec<f64> = std::iter::once(0.0).chain(grid).collect();
        let expect = |ratio: &f64| {
            let octave = |(tau, octave): &(f64, &crate::still::Octave)| {
                let variance = 1.0 / tau + ratio * tau / 3.0;
                let share = 1.0 / tau / variance;
                let [white, walk] = octave.freedom;
                let freedom = share * white / OVERLAP[0] + (1.0 - share) * walk / OVERLAP[1];
                (variance, libm::log(variance), freedom)
            };
            told.iter().map(octave).collect()
        };
        Some(Self {
            expected: ratios.iter().map(expect).collect(),
            ratios,
            variances: told
                .iter()
                .map(|(_, octave)| [0, 1, 2].map(|axis| octave.squares[axis] / (2.0 * octave.count as f64)))
                .collect(),
            white: told.iter().map(|(_, octave)| octave.freedom[0] / OVERLAP[0]).collect(),
        })
    }

    /// Fits the most likely hypothesis and the interval of nearly as likely ones; `None` if an axis shows no noise.
    fn fit(&self, axis: usize) -> Option<NoiseDensity> {
        /// Strides through the hypotheses: a rough one is enough for the degrees of freedom.
        const STRIDES: [usize; 3] = [8, 8, 1];
        let mut freedom = self.white.clone();
        let (mut scores, mut densities, mut best) = (Vec::new(), Vec::new(), 0);
        // The degrees of freedom depend on the best hypothesis, which depends on them in turn.
        for stride in STRIDES {
            let total: f64 = freedom.iter().sum();
            (scores, densities) = self
                .expected
                .iter()
                .step_by(stride)
                .map(|expected| {
                    let octaves = || expected.iter().zip(&self.variances).zip(&freedom);
                    let squares =
                        octaves().map(|(((s, ..), seen), freedom)| freedom * seen[axis] / s).sum::<f64>() / total;
                    let logs: f64 = octaves().map(|(((_, log, _), _), freedom)| freedom * log).sum();
                    (0.5 * (total * (libm::log(squares) + 1.0) + logs), squares)
                })
                .unzip();
            best = (0..scores.len()).min_by(|a, b| f64::total_cmp(&scores[*a], &scores[*b]))?;
            freedom = self.expected.get(best * stride)?.iter().map(|(.., freedom)| *freedom).collect();
        }
        let least = *scores.get(best)?;
        let likely = || (0..scores.len()).filter(|i| scores[*i] - least < PROFILE);
        let walk = |i: usize| (self.ratios[i] * densities[i]).sqrt();
        let (first, last) = (likely().next()?, likely().next_back()?);
        let density = densities[best].sqrt();
        if !(density > 0.0 && density.is_finite()) {
            return None;
        }
        // Besides the ratio of the two, their common level has an error of its own.
        let relative = 1.96 / (2.0 * freedom.iter().sum::<f64>()).sqrt();
        let lowest = likely().map(|i| densities[i]).fold(f64::INFINITY, f64::min).sqrt();
        let highest = likely().map(|i| densities[i]).fold(0.0, f64::max).sqrt();
        Some(NoiseDensity {
            density,
            interval: [lowest * (1.0 - relative).max(0.0), highest * (1.0 + relative)],
            random_walk: (first > 0).then(|| (walk(best), likely().map(walk).fold(f64::INFINITY, f64::min))),
            random_walk_high: (last + 1 < scores.len()).then(|| likely().map(walk).fold(0.0, f64::max)),
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Gyroscope noise at 10 Hz, in rests of `seconds`: N = 8.7e-5 rad/s/√Hz and a random walk.
    fn rests(seed: u64, seconds: f64, count: usize, walk: f64) -> AllanSums {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut sums = AllanSums::default();
        for _ in 0..count {
            let mut bias = nalgebra::Vector3::zeros();
            let values: Vec<_> = (0..(seconds * RATE) as usize)
                .map(|_| {
                    bias += nalgebra::Vector3::new(normal(), normal(), normal()) * walk / RATE.sqrt();
                    bias + nalgebra::Vector3::new(normal(), normal(), normal()) * DENSITY * RATE.sqrt()
                })
                .collect();
            sums.add(&AllanSums::of_rest(&values, 1.0 / RATE, 0, 45.0).unwrap());
        }
        sums
    }

    const RATE: f64 = 10.0;
    const DENSITY: f64 = 8.7e-5;
    const WALK: f64 = 4e-6;

    /// Shares of axes that report a random walk, whose N is inside its interval, and whose K is below its bound.
    fn shares(seeds: std::ops::Range<u64>, seconds: f64, count: usize, walk: f64) -> [f64; 3] {
        let (mut claimed, mut inside, mut below, mut all) = (0, 0, 0, 0);
        for seed in seeds {
            for axis in noise_densities(&rests(seed, seconds, count, walk)).unwrap() {
                all += 1;
                claimed += usize::from(axis.random_walk.is_some());
                inside += usize::from(axis.interval[0] <= DENSITY && DENSITY <= axis.interval[1]);
                below += usize::from(axis.random_walk_high.is_none_or(|high| walk <= high));
            }
        }
        [claimed, inside, below].map(|count| f64::from(u32::try_from(count).unwrap()) / all as f64)
    }

    #[test]
    fn a_random_walk_is_claimed_where_the_rests_show_it() {
        for (seconds, count, seeds, least) in
            [(600.0, 1, 0..40, 0.85), (1800.0, 1, 40..60, 0.9), (60.0, 180, 60..66, 0.9)]
        {
            let [claimed, inside, below] = shares(seeds, seconds, count, WALK);
            assert!(claimed >= least && inside >= 0.85 && below >= 0.85, "{seconds}: {claimed} {inside} {below}");
        }
    }

    #[test]
    fn no_random_walk_is_claimed_where_there_is_none_or_time_is_short() {
        for (seconds, count, walk) in
            [(120.0, 1, 0.0), (600.0, 1, 0.0), (60.0, 40, 0.0), (120.0, 1, WALK), (5.0, 40, WALK)]
        {
            let [claimed, inside, below] = shares(100..140, seconds, count, walk);
            // An existing random walk shows in one axis in ten after 120 s.
            let most = if walk > 0.0 { 0.15 } else { 0.03 };
            assert!(claimed <= most && inside >= 0.85 && below >= 0.9, "{seconds} {walk}: {claimed} {inside} {below}");
        }
    }

    #[test]
    fn what_does_not_vary_has_no_density() {
        let still = vec![nalgebra::Vector3::new(1.0, 2.0, 3.0); 100];
        assert_eq!(noise_densities(&AllanSums::of_rest(&still, 0.01, 0, 45.0).unwrap()), None);
        assert_eq!(noise_densities(&AllanSums::default()), None);
    }
}
