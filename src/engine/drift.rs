//! Whether the accelerometer drifts: what it reads on a face at the last visit against the first. Following a drift is
//! left to the configuration.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3};

use super::observations::Placed;
use crate::fit::{Calibration, Fixture};

/// A bias that grew, by at least two faces that say so.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drift {
    /// m/s² in an hour.
    per_hour: Vector3<f64>,
    /// What each face read more at its last visit than at its first, m/s², and how many seconds later that was.
    faces: Vec<(String, f64, f64)>,
}

/// Looks for a drift in placements on faces that repeat within `placement_std`, m/s².
pub(super) fn drift(
    seen: &[Placed],
    fixture: &Fixture,
    calibration: &Calibration,
    placement_std: f64,
) -> Option<Drift> {
    let mut visits: BTreeMap<usize, Vec<&Placed>> = BTreeMap::new();
    for placed in seen {
        visits.entry(placed.face).or_default().push(placed);
    }
    // Of each face the change of length, which no tilt touches: it is that of the bias along the face.
    let mut rows = Vec::new();
    let mut changes = Vec::new();
    let mut faces = Vec::new();
    for (face, visits) in visits {
        let (Some(first), Some(last), Some(face)) = (visits.first(), visits.last(), fixture.faces().get(face)) else {
            continue;
        };
        let seconds = last.start.seconds_since(first.start);
        if seconds <= 0.0 {
            continue;
        }
        let length = |placed: &Placed| calibration.correct(&placed.observation.mean).norm();
        let change = length(last) - length(first);
        let noise = (first.observation.noise + last.observation.noise).max();
        // Four standard deviations of two placements.
        let excused = 4.0 * (2.0 * placement_std * placement_std + noise).sqrt();
        if change.abs() > excused {
            rows.push(face.normal.transpose() * (seconds / 3600.0));
            changes.push(change);
            faces.push((face.name.clone(), change, seconds));
        }
    }
    if faces.len() < 2 {
        return None;
    }
    // One rate of each axis must explain most of what every face says: a single bad rest does not drift.
    let design = DMatrix::from_fn(rows.len(), 3, |r, c| rows[r][c]);
    let changes = DVector::from_vec(changes);
    let rate = design.clone().svd(true, true).solve(&changes, 1e-9).ok()?;
    let left = &changes - &design * &rate;
    let explained = left.iter().zip(&changes).all(|(left, change)| left.abs() < 0.5 * change.abs());
    let per_hour: Vector3<f64> = rate.fixed_rows::<3>(0).into_owned();
    // An axis that only one face tells of may as well have had one bad rest.
    let told_twice = (0..3).any(|axis| rows.iter().filter(|row| row[axis].abs() > 0.5 * row.norm()).count() > 1);
    (explained && told_twice).then_some(Drift { per_hour, faces })
}

impl Drift {
    /// What was seen and what to do.
    pub(super) fn explanation(&self) -> String {
        let faces = self.faces.iter().map(|(name, change, seconds)| {
            format!("{name} by {change:+.3} m/s² in {:.0} min", (seconds / 60.0).max(1.0))
        });
        let faces: Vec<_> = faces.collect();
        let span = self.faces.iter().map(|(_, _, seconds)| *seconds).fold(0.0, f64::max);
        format!(
            "the readings drift: from its first visit to its last changed {} (bias {:+.2} {:+.2} {:+.2} m/s² an hour). Let the \
             sensor warm up, or let the fit forget with fit.half_life_s = {:.0}",
            faces.join(", "),
            self.per_hour.x,
            self.per_hour.y,
            self.per_hour.z,
            (span / 2.0).max(1.0)
        )
    }
}
