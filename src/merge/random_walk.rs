//! Random walk of parameters from recording to recording: a Kalman filter and its smoother (Rauch, Tung & Striebel
//! 1965).
//!
//! Where the parameters may have jumped, the filter begins anew. The scatter of placements (τ) and the speed of the
//! walk are unknown: everything is computed for a grid of both, and averaged with their posterior probabilities as
//! weights. The prior on the distance walked is half-Cauchy (Gelman, "Prior distributions for variance parameters in
//! hierarchical models", 2006): flat near zero, so that a slow walk that the recordings hardly show is allowed for.

use nalgebra::{SMatrix, SVector};

/// A linear equation in the parameters: `value = factors · parameters`, with an error of variance `noise + gain · τ²`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation<const N: usize> {
    pub(super) factors: SVector<f64, N>,
    pub(super) value: f64,
    pub(super) noise: f64,
    pub(super) gain: f64,
}

/// Equations of one recording.
#[derive(Clone, Debug)]
pub(super) struct Visit<const N: usize> {
    /// Time since the first visit, in seconds.
    pub(super) time: f64,
    pub(super) equations: Vec<Equation<N>>,
}

/// Model of the walk.
#[derive(Clone, Debug)]
pub(super) struct Walk<const N: usize> {
    /// Prior mean of the parameters.
    pub(super) start: SVector<f64, N>,
    /// Prior standard deviation.
    pub(super) prior: SVector<f64, N>,
    /// Relative pace of each parameter's walk.
    pub(super) pace: SVector<f64, N>,
    /// Scatters of placements to try (τ).
    pub(super) scatters: Vec<f64>,
    /// Distances walked over the whole time to try, as standard deviations, at equal ratios; the first is zero.
    pub(super) distances: Vec<f64>,
    /// Scale of the prior on the distance.
    pub(super) usual: f64,
}

/// Parameters with their covariance.
#[derive(Clone, Copy, Debug)]
pub(super) struct State<const N: usize> {
    pub(super) mean: SVector<f64, N>,
    pub(super) covariance: SMatrix<f64, N, N>,
}

/// States after each visit, and the log likelihood of the equations.
#[derive(Clone, Debug)]
pub(super) struct Filtered<const N: usize> {
    pub(super) states: Vec<State<N>>,
    pub(super) likelihood: f64,
}

/// States given all visits, over all settings.
#[derive(Clone, Debug)]
pub(super) struct Averaged<const N: usize> {
    pub(super) states: Vec<State<N>>,
    /// Twice the log likelihood ratio of walking against constant parameters.
    pub(super) ratio: f64,
    /// Mean variance of the walk per second, of a parameter with a pace of one.
    pub(super) speed: f64,
}

/// Scatter of placements, and variance of the walk per second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    pub(super) scatter: f64,
    pub(super) speed: f64,
    /// Logarithm of its prior probability, up to a constant.
    pub(super) prior: f64,
}

impl<const N: usize> Walk<N> {
    /// Prior state.
    pub(super) fn unknown(&self) -> State<N> {
        let covariance = SMatrix::from_diagonal(&self.prior.component_mul(&self.prior));
        State { mean: self.start, covariance }
    }

    /// All settings to try over so many seconds.
    pub(super) fn settings(&self, seconds: f64) -> Vec<Setting> {
        let of = |&distance: &f64| {
            let speed = if seconds > 0.0 { distance * distance / seconds } else { 0.0 };
            let prior = self.prior_of(distance);
            self.scatters.iter().map(move |&scatter| Setting { scatter, speed, prior })
        };
        let distances = self.distances.iter().filter(|distance| **distance == 0.0 || seconds > 0.0);
        distances.flat_map(of).collect()
    }

    /// Logarithm of the prior probability of a distance: zero stands for all below the least.
    fn prior_of(&self, distance: f64) -> f64 {
        let (least, next) = (self.distances.get(1), self.distances.get(2));
        let Some((&least, &next)) = least.zip(next) else { return 0.0 };
        let step = libm::log(next / least);
        let far = distance / self.usual;
        match distance > 0.0 {
            true => libm::log(far * step) - libm::log1p(far * far),
            false => libm::log(least / self.usual),
        }
    }

    /// Covariance that the walk adds in so many seconds.
    pub(super) fn walked(&self, setting: Setting, seconds: f64) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal(&self.pace.component_mul(&self.pace)) * (setting.speed * seconds.abs())
    }

    /// Filters the visits in this order, anew from each one that is marked.
    pub(super) fn filter<'v>(
        &self,
        visits: impl Iterator<Item = (&'v Visit<N>, bool)>,
        setting: Setting,
    ) -> Filtered<N> {
        let mut state = self.unknown();
        let (mut states, mut likelihood, mut before) = (Vec::new(), 0.0, None);
        for (visit, anew) in visits {
            if anew {
                state = self.unknown();
            } else if let Some(before) = before {
                state.covariance += self.walked(setting, visit.time - before);
            }
            before = Some(visit.time);
            for equation in &visit.equations {
                likelihood += state.learn(equation, setting.scatter);
            }
            states.push(state);
        }
        Filtered { states, likelihood }
    }

    /// Smooths: the states given all visits before and after, from those filtered forwards.
    pub(super) fn smooth(&self, visits: &[Visit<N>], resets: &[usize], setting: Setting) -> Filtered<N> {
        let forward = self.filter(visits.iter().enumerate().map(|(i, visit)| (visit, resets.contains(&i))), setting);
        let mut states = forward.states.clone();
        for k in (0..states.len().saturating_sub(1)).rev() {
            if resets.contains(&(k + 1)) {
                continue;
            }
            let (here, next) = (forward.states[k], states[k + 1]);
            let predicted = here.covariance + self.walked(setting, visits[k + 1].time - visits[k].time);
            let Some(inverse) = predicted.try_inverse() else { continue };
            let gain = here.covariance * inverse;
            let covariance = here.covariance + gain * (next.covariance - predicted) * gain.transpose();
            states[k] = State {
                mean: here.mean + gain * (next.mean - here.mean),
                covariance: (covariance + covariance.transpose()) * 0.5,
            };
        }
        Filtered { states, likelihood: forward.likelihood }
    }

    /// The states given all visits, averaged over the settings with their likelihoods as weights.
    pub(super) fn average(&self, visits: &[Visit<N>], resets: &[usize]) -> Averaged<N> {
        let seconds = span(visits);
        let smoothed =
            self.settings(seconds).into_iter().map(|setting| (setting, self.smooth(visits, resets, setting)));
        let smoothed: Vec<_> = smoothed.filter(|(_, smoothed)| smoothed.likelihood.is_finite()).collect();
        let best = |walks: bool| {
            let of = smoothed.iter().filter(|(setting, _)| (setting.speed > 0.0) == walks);
            of.map(|(_, smoothed)| smoothed.likelihood).fold(f64::NEG_INFINITY, f64::max)
        };
        let (still, walking) = (best(false), best(true));
        let posterior = |(setting, smoothed): &(Setting, Filtered<N>)| setting.prior + smoothed.likelihood;
        let top = smoothed.iter().map(posterior).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<_> = smoothed.iter().map(|one| libm::exp(posterior(one) - top)).collect();
        let total: f64 = weights.iter().sum();
        let of_visit = |k: usize| {
            let states = || {
                smoothed
                    .iter()
                    .zip(&weights)
                    .filter_map(|((_, all), weight)| Some((all.states.get(k)?, weight / total)))
            };
            let mean = states().map(|(state, share)| state.mean * share).sum::<SVector<f64, N>>();
            let covariance = states().map(|(state, share)| {
                let off = state.mean - mean;
                (state.covariance + off * off.transpose()) * share
            });
            State { mean, covariance: covariance.sum() }
        };
        let states = if smoothed.is_empty() {
            vec![self.unknown(); visits.len()]
        } else {
            (0..visits.len()).map(of_visit).collect()
        };
        let speeds = smoothed.iter().zip(&weights).map(|((setting, _), weight)| setting.speed * weight / total);
        let speed = if smoothed.is_empty() { 0.0 } else { speeds.sum() };
        Averaged { states, ratio: if walking.is_finite() { 2.0 * (walking - still) } else { 0.0 }, speed }
    }
}

impl<const N: usize> State<N> {
    /// Point near a common one to linearise at: the mean as far as it is known, the common point where it is not. `within`
    /// is how far from that it may well be, `prior` the prior state.
    pub(super) fn settled(&self, common: &SVector<f64, N>, within: &SVector<f64, N>, prior: &Self) -> SVector<f64, N> {
        let inverse = |matrix: &SMatrix<f64, N, N>| matrix.try_inverse();
        let near = SMatrix::from_diagonal(&within.map(|std| std.powi(-2)));
        let settled = || {
            let (own, before) = (inverse(&self.covariance)?, inverse(&prior.covariance)?);
            let known = inverse(&(own - before + near))?;
            Some(known * (own * self.mean - before * prior.mean + near * common))
        };
        settled().filter(|point| point.iter().all(|entry| entry.is_finite())).unwrap_or(*common)
    }

    /// Updates the state with an equation; returns its log likelihood, up to a constant.
    fn learn(&mut self, equation: &Equation<N>, scatter: f64) -> f64 {
        let Equation { factors, value, noise, gain } = equation;
        let along = self.covariance * factors;
        let variance = factors.dot(&along) + noise + gain * scatter * scatter;
        if !(variance > 0.0 && variance.is_finite()) {
            return 0.0;
        }
        let off = value - factors.dot(&self.mean);
        self.mean += along * (off / variance);
        self.covariance -= along * along.transpose() / variance;
        -0.5 * (libm::log(variance) + off * off / variance)
    }
}

/// Time from the first visit to the last, in seconds.
pub(super) fn span<const N: usize>(visits: &[Visit<N>]) -> f64 {
    visits.last().map_or(0.0, |last| last.time) - visits.first().map_or(0.0, |first| first.time)
}
