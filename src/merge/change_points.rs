//! Change points: gaps between recordings where parameters jumped rather than walked. At each gap, a likelihood ratio
//! compares the parameters estimated from the recordings before it and after it (Willsky & Jones 1976).

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

use super::random_walk::{Equation, Filtered, Setting, Visit, Walk, span};

/// Normal score of a likelihood ratio beyond which there was a jump. One gap in 30,000 exceeds it by chance: with two
/// triads, less than one in ten sensors with a thousand recordings each.
const BEYOND: f64 = 4.0;

/// The same where another triad jumped: shocks act on both.
const HINTED: f64 = 2.0;

/// A jump of the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jump<const N: usize> {
    /// Index of the first visit behind it.
    pub(super) at: usize,
    /// Size of the jump, and its standard deviation.
    pub(super) by: SVector<f64, N>,
    pub(super) std: SVector<f64, N>,
    /// Normal score of the likelihood ratio.
    pub(super) score: f64,
}

/// Equation of a visit, by its place in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stray {
    pub(super) visit: usize,
    pub(super) equation: usize,
}

/// Jump that strays explain.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Explained {
    /// Index of the first visit behind it.
    at: usize,
    /// Largest score of what may be left of it.
    left: f64,
    pub(super) strays: Vec<Stray>,
}

impl Explained {
    /// Whether a jump is what is left of this one.
    pub(super) fn holds<const N: usize>(&self, jump: &Jump<N>) -> bool {
        jump.at == self.at && jump.score < self.left
    }
}

/// Removes equations of which one alone makes a jump: a placement that is wrong, in a visit that many others check. Each
/// item holds those of which one is wrong: two where two visits contradict each other and no third tells which is right.
pub(super) fn remove_strays<const N: usize>(walk: &Walk<N>, visits: &mut [Visit<N>]) -> Vec<Explained> {
    /// Fewest equations of a visit of which one may be called wrong.
    const MANY: usize = 6;
    /// Most equations of which each is left out in turn.
    const MOST_EQUATIONS: usize = 600;
    /// Share of a jump's score that is left without it: a shock along one axis shows on two faces, so more would be left.
    const HALF: f64 = 0.5;
    /// Most jumps that are explained so.
    const MOST: usize = 8;
    let mut found = Vec::new();
    let mut removed: Vec<Stray> = Vec::new();
    if visits.iter().map(|visit| visit.equations.len()).sum::<usize>() > MOST_EQUATIONS {
        return found;
    }
    while found.len() < MOST {
        let Some(jump) = best(walk, visits, &[]).filter(|jump| jump.score > BEYOND) else { break };
        let left = |stray: &Stray| {
            let mut without = visits.to_vec();
            without[stray.visit].equations.remove(stray.equation);
            best(walk, &without, &[]).map_or(0.0, |jump| jump.score)
        };
        let of_visit = |visit: usize| {
            let equations = &visits[visit].equations;
            let tried = (0..equations.len()).filter(|one| equations.len() >= MANY && is_checked(equations, *one));
            let tried = tried.map(|equation| {
                let stray = Stray { visit, equation };
                (left(&stray), stray)
            });
            tried.min_by(|(a, _), (b, _)| a.total_cmp(b)).filter(|(score, _)| *score < BEYOND.max(HALF * jump.score))
        };
        let wrong: Vec<_> = [jump.at - 1, jump.at].into_iter().filter_map(of_visit).map(|(_, stray)| stray).collect();
        if wrong.is_empty() {
            break;
        }
        let mut named = Vec::new();
        for stray in wrong {
            visits[stray.visit].equations.remove(stray.equation);
            // Its place before others of its visit were removed.
            let mut equation = stray.equation;
            let mut earlier: Vec<_> = removed.iter().filter(|other| other.visit == stray.visit).collect();
            earlier.sort_by_key(|other| other.equation);
            earlier.iter().for_each(|other| equation += usize::from(other.equation <= equation));
            named.push(Stray { equation, ..stray });
        }
        removed.extend(named.iter().copied());
        found.push(Explained { at: jump.at, left: HALF * jump.score, strays: named });
    }
    found
}

/// Whether another equation of a visit tells about the same direction, or the opposite one: a change along it would show
/// there, too.
fn is_checked<const N: usize>(equations: &[Equation<N>], one: usize) -> bool {
    /// Cosine of the largest angle, 30°.
    const NEAR: f64 = 0.866;
    // The biases come first.
    let direction =
        |equation: &Equation<N>| Vector3::from_fn(|axis, _| equation.factors.get(axis).copied().unwrap_or(0.0));
    let Some(own) = equations.get(one).map(direction) else { return false };
    let others = equations.iter().enumerate().filter(|(other, _)| *other != one).map(|(_, other)| direction(other));
    others.into_iter().any(|other| own.dot(&other).abs() > NEAR * own.norm() * other.norm())
}

/// Finds the jumps, the likeliest first; returns them in time order. Where another triad of the sensor jumps, by the first visit
/// behind it, less evidence suffices, and the jump is there and not beside it.
pub(super) fn jumps<const N: usize>(walk: &Walk<N>, visits: &[Visit<N>], hints: &[usize]) -> Vec<Jump<N>> {
    /// Most jumps; a sensor that jumps more often has no meaningful calibration.
    const MOST: usize = 64;
    let is_enough = |jump: &Jump<N>| jump.score > if hints.contains(&jump.at) { HINTED } else { BEYOND };
    let mut resets: Vec<usize> = Vec::new();
    while resets.len() < MOST {
        let beside = |at: usize| hints.iter().any(|hint| hint.abs_diff(at) == 1);
        let further = gaps(walk, visits, &resets).into_iter();
        let further = further.filter(|jump| is_enough(jump) && (hints.contains(&jump.at) || !beside(jump.at)));
        let Some(jump) = further.max_by(|a, b| a.score.total_cmp(&b.score)) else { break };
        resets.push(jump.at);
        resets.sort_unstable();
    }
    // Each jump evaluated beside all the others; what is no longer likely beside them goes.
    loop {
        let each = resets.iter().filter_map(|&at| {
            let others: Vec<_> = resets.iter().copied().filter(|other| *other != at).collect();
            gaps(walk, visits, &others).into_iter().find(|jump| jump.at == at)
        });
        let found: Vec<Jump<N>> = each.collect();
        let weakest = found.iter().filter(|jump| !is_enough(jump)).min_by(|a, b| a.score.total_cmp(&b.score));
        let gone = weakest
            .map(|jump| jump.at)
            .or_else(|| resets.iter().copied().find(|at| found.iter().all(|jump| jump.at != *at)));
        let Some(gone) = gone else { return found };
        resets.retain(|at| *at != gone);
    }
}

/// The likeliest further jump.
fn best<const N: usize>(walk: &Walk<N>, visits: &[Visit<N>], resets: &[usize]) -> Option<Jump<N>> {
    gaps(walk, visits, resets).into_iter().max_by(|a, b| a.score.total_cmp(&b.score))
}

/// Estimates of a jump in each gap that has none yet.
fn gaps<const N: usize>(walk: &Walk<N>, visits: &[Visit<N>], resets: &[usize]) -> Vec<Jump<N>> {
    let runs: Vec<_> = walk
        .settings(span(visits))
        .into_iter()
        .map(|setting| {
            let forward =
                walk.filter(visits.iter().enumerate().map(|(i, visit)| (visit, resets.contains(&i))), setting);
            let backwards = visits.iter().enumerate().rev();
            let mut backward = walk.filter(backwards.map(|(i, visit)| (visit, resets.contains(&(i + 1)))), setting);
            backward.states.reverse();
            (setting, forward, backward)
        })
        .filter(|(_, forward, _)| forward.likelihood.is_finite())
        .collect();
    let likelihood = |(setting, forward, _): &(Setting, Filtered<N>, Filtered<N>)| setting.prior + forward.likelihood;
    let without = runs.iter().map(likelihood).fold(f64::NEG_INFINITY, f64::max);
    let at = |k: usize| {
        let of_run = |run: &(Setting, Filtered<N>, Filtered<N>)| {
            let (setting, forward, backward) = run;
            let (before, after) = (forward.states.get(k - 1)?, backward.states.get(k)?);
            let seconds = visits.get(k)?.time - visits.get(k - 1)?.time;
            let covariance = before.covariance + after.covariance + walk.walked(*setting, seconds);
            let by = after.mean - before.mean;
            // Twice the log likelihood ratio of all equations with this setting.
            let more = 2.0 * (likelihood(run) - without);
            Difference::new(by, covariance, &walk.prior, more)
        };
        let each: Vec<_> = runs.iter().filter_map(of_run).collect();
        let told = |side: &[Visit<N>]| side.iter().map(|visit| visit.equations.len()).sum::<usize>() > 1;
        let (before, after) = visits.split_at_checked(k)?;
        if !(told(before) && told(after)) {
            return None;
        }
        let likeliest = |of: Part| each.iter().map(|one| one.ratio(of)).max_by(|a, b| a.0.total_cmp(&b.0));
        let (all, biases, bias) = (likeliest(Part::All)?, likeliest(Part::Biases)?, likeliest(Part::Bias)?);
        let score = |(ratio, freedom): (f64, f64), tests| of_several(normal(ratio, freedom.max(1.0)), tests);
        let score = score(all, 3.0).max(score(biases, 3.0)).max(score(bias, 9.0));
        (all.1 > 0.5).then(|| {
            let (by, std) = mean(&each);
            Jump { at: k, by, std, score }
        })
    };
    (1..visits.len()).filter(|k| !resets.contains(k)).filter_map(at).collect()
}

/// Parameters behind a gap less those before it, with one setting.
struct Difference<const N: usize> {
    by: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    /// Twice the log likelihood ratio of the setting.
    more: f64,
    /// Logarithm of the determinant of the covariance: what a jump of any size makes less likely than the likeliest one.
    spread: f64,
    /// Twice the log likelihood ratio of a jump beside none, and its degrees of freedom, by [`Part`].
    parts: [(f64, f64); 3],
}

/// Most that a parameter jumps by, in standard deviations of its prior: three of a difference.
const MOST: f64 = 4.2;

/// Parameters that jump; the others stay.
#[derive(Clone, Copy)]
enum Part {
    All,
    Biases,
    /// One of them.
    Bias,
}

impl<const N: usize> Difference<N> {
    fn new(by: SVector<f64, N>, covariance: SMatrix<f64, N, N>, prior: &SVector<f64, N>, more: f64) -> Option<Self> {
        // Where little is known, equations that do not quite fit lead beyond what any sensor is.
        if (0..N).any(|i| by[i].abs() > MOST * prior[i]) {
            return None;
        }
        let information = covariance.try_inverse()?;
        let told = information * by;
        // Of parameters that are not known on both sides no jump is seen.
        let known = |i: usize, variance: f64| (1.0 - variance / (2.0 * prior[i] * prior[i])).clamp(0.0, 1.0);
        let freedom = (0..N).map(|i| known(i, covariance[(i, i)])).sum::<f64>();
        // The biases come first.
        let of_biases = Matrix3::from_fn(|i, j| information[(i, j)]).try_inverse()?;
        let biases = Vector3::from_fn(|i, _| told[i]);
        let bias = (0..3).map(|i| biases[i] * biases[i] / information[(i, i)]).fold(0.0, f64::max);
        let freedom_of_biases = (0..3).map(|i| known(i, of_biases[(i, i)])).sum::<f64>();
        let parts = [(by.dot(&told), freedom), (biases.dot(&(of_biases * biases)), freedom_of_biases), (bias, 1.0)];
        let root = DMatrix::from_fn(N, N, |i, j| covariance[(i, j)]).cholesky()?;
        let spread = 2.0 * root.l_dirty().diagonal().iter().map(|entry| libm::log(*entry)).sum::<f64>();
        Some(Self { by, covariance, more, spread, parts })
    }

    /// Twice the log likelihood ratio of all equations with this jump and setting, and its degrees of freedom.
    fn ratio(&self, part: Part) -> (f64, f64) {
        let (explained, freedom) = self.parts[part as usize];
        (explained + self.more, freedom)
    }

    /// Jump and its variances: where no more than the biases jump, given that the others stay.
    fn jump(&self) -> (SVector<f64, N>, SVector<f64, N>) {
        /// Score beyond which more than the biases jumps.
        const MORE: f64 = 3.0;
        let (mut by, mut variance) = (self.by, self.covariance.diagonal());
        let [(all, freedom), (biases, of_biases), _] = self.parts;
        let others = freedom - of_biases;
        if N > 3
            && (others < 0.5 || normal(all - biases, others.max(1.0)) < MORE)
            && let Some(information) = self.covariance.try_inverse()
            && let Some(inverse) = Matrix3::from_fn(|i, j| information[(i, j)]).try_inverse()
        {
            let told = information * self.by;
            let alone = inverse * Vector3::from_fn(|i, _| told[i]);
            (0..3).for_each(|i| (by[i], variance[i]) = (alone[i], inverse[(i, i)]));
        }
        (by, variance)
    }
}

/// Mean of the differences by their likelihoods, and its standard deviation.
fn mean<const N: usize>(each: &[Difference<N>]) -> (SVector<f64, N>, SVector<f64, N>) {
    let likelihood = |one: &Difference<N>| (one.ratio(Part::All).0 + one.spread) / 2.0;
    let best = each.iter().map(likelihood).fold(f64::NEG_INFINITY, f64::max);
    let jumps: Vec<_> = each.iter().map(|one| (libm::exp(likelihood(one) - best), one.jump())).collect();
    let total: f64 = jumps.iter().map(|(weight, _)| weight).sum();
    let by = jumps.iter().map(|(weight, (by, _))| by * (weight / total)).sum::<SVector<f64, N>>();
    let variance = jumps.iter().map(|(weight, (one, variance))| {
        let off = one - by;
        (variance + off.component_mul(&off)) * (weight / total)
    });
    let variance = variance.sum::<SVector<f64, N>>();
    (by, variance.map(|variance| variance.max(0.0).sqrt()))
}

/// Normal score of the best of several tests: the tail of each is about e^(−z²/2).
fn of_several(score: f64, tests: f64) -> f64 {
    let square = score * score - 2.0 * libm::log(tests);
    if score > 0.0 { square.max(0.0).sqrt() } else { score }
}

/// Normal score with the same tail probability as this χ² (Wilson & Hilferty 1931).
fn normal(square: f64, freedom: f64) -> f64 {
    let v = 2.0 / (9.0 * freedom);
    (libm::cbrt(square.max(0.0) / freedom) - (1.0 - v)) / v.sqrt()
}
