//! Judged rests as observations to fit: those of one placement pooled, since they share what a placement adds. Fitting
//! them is left to `solve`.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::book::Entry;
use super::judge::Poses;
use crate::Stamp;
use crate::fit::accelerometer::Observation;
use crate::fit::secondary::Pair;
use crate::fit::{Calibration, Fixture, Reading, Truth};
use crate::still::TriadMean;

/// What the primary accelerometer read on one placement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    /// The face that it is nearest to.
    pub(super) face: usize,
    /// When it began.
    pub(super) start: Stamp,
    pub(super) observation: Observation,
}

/// The accepted rests, those of one placement as one observation. `step` is the accelerometer's quantisation step.
pub(super) fn placements(entries: &[Entry], fixture: &Fixture, poses: Poses, step: Option<f64>) -> Vec<Placed> {
    let mut groups: BTreeMap<_, (usize, Stamp, Vec<&TriadMean>)> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_accepted()) {
        let Some(face) = entry.verdict.face() else { continue };
        // Of a placement that hesitates between two faces, each face has its part.
        let part = if poses == Poses::OnFaces { face } else { 0 };
        let group = groups.entry((entry.rest.placement, part));
        let (_, _, means) = group.or_insert((face, entry.rest.start, Vec::new()));
        means.push(&entry.rest.accelerometer);
    }
    groups
        .into_iter()
        .filter_map(|((placement, _), (face, start, means))| {
            let normal = fixture.faces().get(face)?.normal;
            let (mean, noise) = pooled(&means);
            // However long a rest, what rounding does to its mean stays.
            let noise = noise + rounding(means.first()?, step);
            Some(Placed { face, start, observation: Observation { placement, mean, noise, normal } })
        })
        .collect()
}

/// What the primary and a secondary accelerometer read on each placement, tilted ones included.
pub(super) fn pairs(entries: &[Entry], secondary: usize) -> Vec<Pair> {
    let mut groups: BTreeMap<u32, (Vec<&TriadMean>, Vec<&TriadMean>)> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_at_rest()) {
        let second = entry.rest.secondary.get(secondary).and_then(Option::as_ref);
        if let Some(second) = second.filter(|mean| mean.clipped == 0) {
            let (primary, secondary) = groups.entry(entry.rest.placement).or_default();
            primary.push(&entry.rest.accelerometer);
            secondary.push(second);
        }
    }
    let pair = |(placement, (first, second)): (u32, (Vec<&TriadMean>, Vec<&TriadMean>))| {
        let ((primary, primary_noise), (secondary, secondary_noise)) = (pooled(&first), pooled(&second));
        Pair { placement, primary, secondary, primary_noise, secondary_noise }
    };
    groups.into_iter().map(pair).collect()
}

/// What the gyroscope read during each placement that is no turn, beside the specific force as far as it is known.
pub(super) fn rates(entries: &[Entry], accelerometer: Option<&Calibration>) -> Vec<Reading> {
    let mut groups: BTreeMap<u32, (Vec<&TriadMean>, Vec<&TriadMean>)> = BTreeMap::new();
    for entry in entries.iter().filter(|entry| entry.verdict.is_at_rest()) {
        if let Some(gyroscope) = &entry.rest.gyroscope {
            let (rates, forces) = groups.entry(entry.rest.placement).or_default();
            rates.push(gyroscope);
            forces.push(&entry.rest.accelerometer);
        }
    }
    let reading = |(rates, forces): (Vec<&TriadMean>, Vec<&TriadMean>)| {
        let ((mean, noise), (force, _)) = (pooled(&rates), pooled(&forces));
        let other = accelerometer.map_or(Vector3::zeros(), |calibration| calibration.correct(&force));
        Reading { mean, noise, truth: Truth { other, ..Truth::default() }, truth_noise: Matrix3::zeros() }
    };
    groups.into_values().map(reading).collect()
}

/// Whether rounding to a step biases the mean of an accepted rest.
pub(super) fn is_coarse(entries: &[Entry], step: f64) -> bool {
    let used = entries.iter().filter(|entry| entry.verdict.is_accepted());
    used.map(|entry| rounding(&entry.rest.accelerometer, Some(step))).any(|variance| variance.max() > 0.0)
}

/// Variance that rounding to a step leaves in a mean, per axis: that of a uniform error where the noise is too small to
/// average it out (below half a step), else none.
fn rounding(mean: &TriadMean, step: Option<f64>) -> Vector3<f64> {
    let step = step.unwrap_or(0.0);
    mean.std().map(|std| if std < step / 2.0 { step * step / 12.0 } else { 0.0 })
}

/// Mean of several means of one placement, by their effective samples, and its noise variance.
fn pooled(means: &[&TriadMean]) -> (Vector3<f64>, Vector3<f64>) {
    let total: f64 = means.iter().map(|mean| mean.effective).sum();
    let share = |mean: &TriadMean| mean.effective / total.max(f64::MIN_POSITIVE);
    let mean = means.iter().map(|mean| mean.mean * share(mean)).sum();
    let noise = means.iter().map(|mean| mean.mean_variance() * share(mean) * share(mean)).sum();
    (mean, noise)
}
