//! Change points: gaps between recordings where parameters jumped rather than walked. At each gap, a likelihood ratio
//! compares the parameters estimated from the recordings before it and after it (Willsky & Jones 1976).

use nalgebra::{SVector, Vector3};

use super::random_walk::{Equation, Filtered, Setting, Visit, Walk, span};

/// Normal score of a likelihood ratio beyond which there was a jump. One gap in 30,000 exceeds it by chance: with two
/// triads, less than one in ten sensors with a thousand recordings each.
const BEYOND: f64 = 4.0;

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

/// Finds the jumps, the likeliest first; returns them in time order.
pub(super) fn jumps<const N: usize>(walk: &Walk<N>, visits: &[Visit<N>]) -> Vec<Jump<N>> {
    /// Most jumps; a sensor that jumps more often has no meaningful calibration.
    const MOST: usize = 64;
    let mut resets = Vec::new();
    while resets.len() < MOST {
        let Some(at) = best(walk, visits, &resets).filter(|jump| jump.score > BEYOND).map(|jump| jump.at) else {
            break;
        };
        resets.push(at);
        resets.sort_unstable();
    }
    // Each jump evaluated beside all the others.
    let each = resets.iter().filter_map(|&at| {
        let others: Vec<_> = resets.iter().copied().filter(|other| *other != at).collect();
        gaps(walk, visits, &others).into_iter().find(|jump| jump.at == at)
    });
    each.collect()
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
            let square = by.dot(&(covariance.try_inverse()? * by));
            let known = (0..N).map(|i| {
                let prior = walk.prior[i] * walk.prior[i];
                (1.0 - before.covariance[(i, i)].max(after.covariance[(i, i)]) / prior).max(0.0)
            });
            let freedom = known.sum::<f64>();
            let std = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
            // Twice the log likelihood ratio of all equations with this jump and setting.
            let ratio = square + 2.0 * (likelihood(run) - without);
            Some((ratio, freedom, by, std))
        };
        let best = runs.iter().filter_map(of_run).max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (ratio, freedom, by, std) = best;
        let told = |side: &[Visit<N>]| side.iter().map(|visit| visit.equations.len()).sum::<usize>() > 1;
        let (before, after) = visits.split_at_checked(k)?;
        (freedom > 0.5 && told(before) && told(after)).then(|| Jump {
            at: k,
            by,
            std,
            score: normal(ratio, freedom.max(1.0)),
        })
    };
    (1..visits.len()).filter(|k| !resets.contains(k)).filter_map(at).collect()
}

/// Normal score with the same tail probability as this χ² (Wilson & Hilferty 1931).
fn normal(square: f64, freedom: f64) -> f64 {
    let v = 2.0 / (9.0 * freedom);
    (libm::cbrt(square.max(0.0) / freedom) - (1.0 - v)) / v.sqrt()
}
