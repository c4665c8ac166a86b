//! Remounts: from one recording on, a sensor that always lay one way at rest, as in a vehicle, always lies another way.

use nalgebra::Vector3;

use super::past_rest::PastRest;
use crate::turns::angle_between;

/// Change of the attitude at rest between two visits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Remount {
    /// Index of the first visit behind it.
    pub(super) at: usize,
    /// Angle by which gravity is seen elsewhere, rad.
    pub(super) angle: f64,
}

/// Fewest visits in a row that lie alike, before and behind: hand-held sensors lie on any face.
const FEWEST: usize = 4;
/// Largest angle between rests of one mounting, rad: vehicles park on slopes.
const ALIKE: f64 = 0.35;
/// Standard deviation of the attitude at rest, rad.
const PARKED: f64 = 0.09;

impl Remount {
    /// Significance, as a normal score.
    pub(super) fn score(&self) -> f64 {
        self.angle / PARKED
    }
}

/// Finds the remounts, in time order.
pub(super) fn remounts(rests: &[&PastRest], visits: &[Vec<usize>]) -> Vec<Remount> {
    let up = |i: &usize| rests.get(*i)?.rest.accelerometer.mean.try_normalize(f64::MIN_POSITIVE);
    // Spans of visits whose rests all lie alike, with the sum of their directions.
    let mut spans: Vec<(std::ops::Range<usize>, Vector3<f64>)> = Vec::new();
    for (at, visit) in visits.iter().enumerate() {
        let ups: Vec<_> = visit.iter().filter_map(up).collect();
        // Rests on opposite faces have no direction in common.
        let Some(way) = ups.iter().sum::<Vector3<f64>>().try_normalize(f64::EPSILON) else { continue };
        if ups.iter().any(|up| angle_between(up, &way) > ALIKE) {
            continue;
        }
        match spans.last_mut() {
            Some((span, all)) if span.end == at && angle_between(all, &way) <= ALIKE => {
                span.end = at + 1;
                *all += way;
            }
            _ => spans.push((at..at + 1, way)),
        }
    }
    let pair = |pair: &[(std::ops::Range<usize>, Vector3<f64>)]| {
        let [(before, from), (behind, to)] = pair else { return None };
        let angle = angle_between(from, to);
        (before.end == behind.start && before.len() >= FEWEST && behind.len() >= FEWEST && angle > 2.0 * ALIKE)
            .then_some(Remount { at: behind.start, angle })
    };
    spans.windows(2).filter_map(pair).collect()
}
