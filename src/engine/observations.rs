//! Observations for fits from judged rests: those of one placement are pooled, since they share its placement error.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use crate::Stamp;
use crate::fit::accelerometer::Observation;
use crate::fit::secondary::Pair;
use crate::fit::{self, Calibration, Reading, Truth};
use crate::imu::Sensor;
use crate::still::{Segmenter, TriadMean};

/// Observation of the primary accelerometer on one placement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// Face nearest to the reading.
    pub(super) face: usize,
    /// Start of the placement.
    pub(super) start: Stamp,
    pub(super) observation: Observation,
}

/// Ageing of rests: the variance of a rest doubles with each half-life.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ageing {
    latest: Stamp,
    /// Half-life, s; without it nothing ages.
    half_life: Option<f64>,
}

impl Ageing {
    pub(super) fn new(entries: &[JudgedRest], half_life: Option<f64>) -> Self {
        let latest = entries.iter().map(|entry| entry.rest.end).max().unwrap_or_default();
        Self { latest, half_life }
    }

    /// Noise variance of the mean of a placement that ended at `end`, where placements scatter by `std`.
    fn of(&self, noise: Vector3<f64>, end: Stamp, std: f64) -> Vector3<f64> {
        let Some(half_life) = self.half_life else { return noise };
        let factor = libm::exp2(self.latest.seconds_since(end) / half_life);
        noise.map(|noise| noise * factor + std * std * (factor - 1.0))
    }
}

/// Accepted rests, those of one placement as one observation. `step` is the accelerometer's quantisation step, m/s².
pub(super) fn placements(entries: &[JudgedRest], judge: &Judge<'_>, poses: Poses, step: Option<f64>) -> Vec<Placed> {
    let ageing = Ageing::new(entries, judge.fit.half_life_s);
    let mut groups: BTreeMap<_, (usize, (Stamp, Stamp), Vec<&TriadMean>)> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_accepted()) {
        let Some(face) = entry.verdict.face() else { continue };
        // A placement that lies between two faces gives one observation on each.
        let part = if poses == Poses::OnFaces { face } else { 0 };
        let group = groups.entry((entry.rest.placement, part));
        let (_, span, means) = group.or_insert((face, (entry.rest.start, entry.rest.end), Vec::new()));
        span.1 = entry.rest.end.max(span.1);
        means.push(&entry.rest.accelerometer);
    }
    groups
        .into_iter()
        .filter_map(|((placement, _), (face, (start, end), means))| {
            let normal = judge.fixture.faces().get(face)?.normal;
            let (mean, noise) = pooled(&alike(&means));
            // The rounding error of the mean of a rest stays, however long the rest.
            let noise = ageing.of(noise + rounding(means.first()?, step), end, judge.fit.placement_std);
            Some(Placed { face, start, observation: Observation { placement, mean, noise, normal } })
        })
        .collect()
}

/// Means of two triads on one placement, and its end.
type Both<'a> = (Vec<&'a TriadMean>, Vec<&'a TriadMean>, Stamp);

/// Pairs of means of the primary and a secondary accelerometer on each placement, tilted ones included.
pub(super) fn pairs(entries: &[JudgedRest], config: &fit::Config, secondary: usize) -> Vec<Pair> {
    let ageing = Ageing::new(entries, config.half_life_s);
    let mut groups: BTreeMap<u32, Both> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_at_rest()) {
        let second = entry.rest.secondary.get(secondary).and_then(Option::as_ref);
        if let Some(second) = second.filter(|mean| mean.clipped == 0) {
            let (primary, secondary, end) = groups.entry(entry.rest.placement).or_default();
            primary.push(&entry.rest.accelerometer);
            secondary.push(second);
            *end = entry.rest.end.max(*end);
        }
    }
    let pair = |(placement, (first, second, end)): (u32, Both)| {
        let ((primary, primary_noise), (secondary, secondary_noise)) = (pooled(&first), pooled(&second));
        let secondary_noise = ageing.of(secondary_noise, end, config.placement_std);
        Pair { placement, primary, secondary, primary_noise, secondary_noise }
    };
    groups.into_iter().map(pair).collect()
}

/// Whether a rest shows the gyroscope's readings at rest.
pub(super) fn tells_of_rates(entry: &JudgedRest, noise: f64) -> bool {
    entry.verdict.is_at_rest() && entry.rest.gyroscope.is_some() && relaxed(entry, noise).is_none()
}

/// Mean rates at the ends of a rest in which the gyroscope went to zero, rad/s: a motion ended slowly, or an estimator
/// in the driver removes its bias. The readings in between are neither.
pub(super) fn relaxed(entry: &JudgedRest, noise: f64) -> Option<(f64, f64)> {
    /// Least rate that is a bias worth an estimator, rad/s.
    const LEAST: f64 = 1e-3;
    /// Fewest samples in a window.
    const WINDOW: f64 = 20.0;
    let least = LEAST.max(6.0 * noise * (3.0 / WINDOW).sqrt());
    let [first, last] = entry.rest.gyroscope.as_ref()?.ends.map(|mean| mean.norm());
    (first - last > least && last < 0.35 * first).then_some((first, last))
}

/// Noise of one sample of an axis, rad/s; zero before it is known.
pub(super) fn gyroscope_noise(segmenter: &Segmenter) -> f64 {
    segmenter.signal(Sensor::Gyroscope).and_then(|signal| signal.noise).unwrap_or(0.0)
}

/// Readings of the gyroscope during each placement that shows them, beside the specific force as far as it is known.
/// `noise` is that of its axes.
pub(super) fn rates(
    entries: &[JudgedRest],
    noise: f64,
    config: &fit::Config,
    accelerometer: Option<&Calibration>,
) -> Vec<Reading> {
    let ageing = Ageing::new(entries, config.half_life_s);
    let mut groups: BTreeMap<u32, Both> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| tells_of_rates(entry, noise)) {
        if let Some(gyroscope) = &entry.rest.gyroscope {
            let (rates, forces, end) = groups.entry(entry.rest.placement).or_default();
            rates.push(gyroscope);
            forces.push(&entry.rest.accelerometer);
            *end = entry.rest.end.max(*end);
        }
    }
    let reading = |(rates, forces, end): Both| {
        let ((mean, noise), (force, _)) = (pooled(&rates), pooled(&forces));
        let noise = ageing.of(noise, end, config.rate_std);
        let other = accelerometer.map_or(Vector3::zeros(), |calibration| calibration.correct(&force));
        Reading { mean, noise, truth: Truth { other, ..Truth::default() }, truth_noise: Matrix3::zeros() }
    };
    groups.into_values().map(reading).collect()
}

/// Whether rounding to a quantisation step biases the mean of an accepted rest.
pub(super) fn is_coarse(entries: &[JudgedRest], step: f64) -> bool {
    let used = entries.iter().filter(|entry| entry.verdict.is_accepted());
    used.map(|entry| rounding(&entry.rest.accelerometer, Some(step))).any(|variance| variance.max() > 0.0)
}

/// Error of the gyroscope's bias from rounding to a step, per axis, rad/s: half a step if the noise is too small to average
/// it out. It is the same at every rest.
pub(super) fn rate_rounding(entries: &[JudgedRest], step: f64) -> Vector3<f64> {
    let means = entries.iter().filter(|entry| entry.verdict.is_at_rest()).filter_map(|e| e.rest.gyroscope.as_ref());
    let off =
        means.map(|mean| rounding(mean, Some(step)).map(|variance| if variance > 0.0 { step / 2.0 } else { 0.0 }));
    off.fold(Vector3::zeros(), |most, off| most.sup(&off))
}

/// Variance of a mean from rounding to a step, per axis: that of a uniform error if the noise is too small to average
/// it out (below half a step), else none.
fn rounding(mean: &TriadMean, step: Option<f64>) -> Vector3<f64> {
    let step = step.unwrap_or(0.0);
    mean.std().map(|std| if std < step / 2.0 { step * step / 12.0 } else { 0.0 })
}

/// Selects the rests of a placement that read like the longest: a knock may have tilted it, and the mean of different
/// directions is shorter than either.
fn alike<'a>(means: &[&'a TriadMean]) -> Vec<&'a TriadMean> {
    /// Largest difference, m/s²: it shortens the mean by a ten thousandth of g at most.
    const APART: f64 = 0.25;
    let longest = means.iter().max_by(|a, b| a.effective.total_cmp(&b.effective));
    let near = |mean: &&TriadMean| longest.is_some_and(|longest| (mean.mean - longest.mean).norm() <= APART);
    means.iter().copied().filter(|mean| near(mean)).collect()
}

/// Mean of several means of one placement, weighted by their effective samples, and its noise variance.
fn pooled(means: &[&TriadMean]) -> (Vector3<f64>, Vector3<f64>) {
    let total: f64 = means.iter().map(|mean| mean.effective).sum();
    let share = |mean: &TriadMean| mean.effective / total.max(f64::MIN_POSITIVE);
    let mean = means.iter().map(|mean| mean.mean * share(mean)).sum();
    let noise = means.iter().map(|mean| mean.mean_variance() * share(mean) * share(mean)).sum();
    (mean, noise)
}
