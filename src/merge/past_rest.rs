//! Rest of one sensor in one of any number of recordings.
//!
//! The rest with the most samples stands for a span of time and a cell of poses of about 11°, like the merging of near
//! rests in an engine, which counts them as one placement.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::thinned_set::{Member, ThinnedSet};
use crate::still::{Rest, TriadMean};

/// Most rests that are kept of one sensor.
pub const MOST_RESTS: usize = 2048;

/// Cells per unit of the direction vector.
const CELLS: f64 = 5.0;

/// Rests of one sensor.
pub type RestSet = ThinnedSet<PastRest>;

/// A rest and the recording that it was found in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PastRest {
    /// Start of the first rest of its recording, ns.
    pub recording: i64,
    /// The rest without its secondary accelerometers.
    pub rest: Rest,
    /// Readings of the secondary accelerometers, by their names.
    pub secondary: BTreeMap<String, TriadMean>,
    /// Mean temperature over the rest, °C.
    pub temperature: Option<f64>,
}

impl Member for PastRest {
    type Pose = [i8; 3];
    const MOST: usize = MOST_RESTS;

    fn start(&self) -> i64 {
        self.rest.start.nanos()
    }

    fn pose(&self) -> [i8; 3] {
        pose(&self.rest.accelerometer.mean, CELLS)
    }

    /// Order of rests by which the greater one stands for both: by samples of the accelerometer, then by all other
    /// fields.
    fn rank(&self, other: &Self) -> Ordering {
        let means = |rest: &Self| {
            let of = |mean: &TriadMean| {
                let numbers = mean.mean.iter().chain(&mean.covariance).copied().chain([mean.effective]);
                (mean.samples, numbers.collect::<Vec<_>>())
            };
            let Rest { accelerometer, gyroscope, .. } = &rest.rest;
            [accelerometer].into_iter().chain(gyroscope).chain(rest.secondary.values()).map(of).collect::<Vec<_>>()
        };
        let one_by_one = || {
            let (mine, theirs) = (means(self), means(other));
            let pairs = mine.iter().zip(&theirs).map(|((samples, numbers), (others, theirs))| {
                let numbers = numbers.iter().zip(theirs).map(|(a, b)| a.total_cmp(b));
                samples.cmp(others).then_with(|| numbers.fold(Ordering::Equal, Ordering::then))
            });
            pairs.fold(mine.len().cmp(&theirs.len()), Ordering::then)
        };
        let key = |rest: &Self| (rest.rest.accelerometer.samples, rest.rest.start, rest.rest.end);
        let place = |rest: &Self| (rest.rest.placement, rest.recording);
        let temperature = |rest: &Self| rest.temperature.unwrap_or(f64::NEG_INFINITY);
        key(self)
            .cmp(&key(other))
            .then_with(one_by_one)
            .then_with(|| place(self).cmp(&place(other)))
            .then_with(|| temperature(self).total_cmp(&temperature(other)))
            .then_with(|| self.secondary.keys().cmp(other.secondary.keys()))
    }
}

/// Cell of the direction of a specific force.
pub(super) fn pose(force: &Vector3<f64>, cells: f64) -> [i8; 3] {
    let up = force / force.norm().max(f64::MIN_POSITIVE);
    [0, 1, 2].map(|axis| libm::round(up[axis] * cells) as i8)
}
