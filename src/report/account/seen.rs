//! Placements of a recording, from the rests that it tells of.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::messages::segment::Reason;
use crate::messages::{Segment, TriadMean};
use crate::report::{Findings, matrix, vector};

/// Readings of one placement.
pub(super) struct Seen {
    /// Start of its first rest, ns.
    pub(super) start: i64,
    pub(super) face: String,
    /// Mean of the accelerometer, and its variance from noise.
    pub(super) force: Option<(Vector3<f64>, Vector3<f64>)>,
    /// Mean of the gyroscope, and its variance from noise.
    pub(super) rate: Option<(Vector3<f64>, Vector3<f64>)>,
    /// Mean temperature, °C.
    pub(super) temperature: Option<f64>,
}

/// Placements in which the IMU was at rest, on a face or not, in the order of their numbers.
pub(super) fn seen(findings: &Findings) -> Vec<Seen> {
    let mut placements: BTreeMap<u32, Vec<(i64, &Segment)>> = BTreeMap::new();
    for (start, rest) in &findings.rests {
        if matches!(rest.reason(), Reason::Accepted | Reason::Tilted) {
            placements.entry(rest.placement).or_default().push((*start, rest));
        }
    }
    let placement = |rests: Vec<(i64, &Segment)>| {
        let (start, first) = rests.first()?;
        let temperatures: Vec<f64> = rests.iter().filter_map(|(_, rest)| rest.temperature).collect();
        let of = |sensor: &str| pooled(rests.iter().filter_map(|(_, rest)| mean(rest, sensor)).collect());
        Some(Seen {
            start: *start,
            face: first.face.clone(),
            force: of("accelerometer"),
            rate: of("gyroscope"),
            temperature: (!temperatures.is_empty())
                .then(|| temperatures.iter().sum::<f64>() / temperatures.len() as f64),
        })
    };
    placements.into_values().filter_map(placement).collect()
}

/// Mean of a triad over a rest, and its effective samples.
struct Mean {
    value: Vector3<f64>,
    variance: Vector3<f64>,
    effective: f64,
}

fn mean(rest: &Segment, sensor: &str) -> Option<Mean> {
    let mean = rest.means.iter().find(|mean| mean.sensor == sensor)?;
    let TriadMean { effective_samples: effective, std, covariance, .. } = mean;
    let value = vector(mean.mean.as_ref()?);
    let of_sample = match matrix(covariance) {
        Some(covariance) => covariance.diagonal(),
        None => vector(std.as_ref()?).map(|std| std * std),
    };
    let variance = of_sample / *effective;
    let sound = value.iter().chain(&variance).all(|x| x.is_finite()) && *effective > 0.0;
    sound.then_some(Mean { value, variance, effective: *effective })
}

/// Mean of those of one placement that read like the longest: a knock may have tilted it.
fn pooled(means: Vec<Mean>) -> Option<(Vector3<f64>, Vector3<f64>)> {
    /// Largest difference: of an accelerometer it shortens the mean by a ten thousandth of g at most.
    const APART: f64 = 0.25;
    let longest = means.iter().max_by(|a, b| a.effective.total_cmp(&b.effective))?.value;
    let alike: Vec<_> = means.into_iter().filter(|mean| (mean.value - longest).norm() <= APART).collect();
    let total: f64 = alike.iter().map(|mean| mean.effective).sum();
    let share = |mean: &Mean| mean.effective / total;
    let value = alike.iter().map(|mean| mean.value * share(mean)).sum();
    let variance = alike.iter().map(|mean| mean.variance * share(mean).powi(2)).sum();
    Some((value, variance))
}
