//! Headings of a reference, an odometry for instance, while the sensor rests. [`Rotations`](super::rotations::Rotations) are
//! made of them.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::imu::HeadingConfig;
use crate::still::Rest;
use crate::turns::{KnownRotation, Turn};

/// Headings at the rests, and the readings since the last of them.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Headings {
    /// Readings in the order in which they came: stamp, and heading in rad.
    recent: Vec<(Stamp, f64)>,
    /// Rests by their start, the latest last, and the median heading at each, rad.
    rests: VecDeque<(Stamp, f64)>,
    /// Number of readings.
    readings: u64,
    /// Number of rests during which there were readings enough.
    read: u64,
    /// Number of those in which the heading moved, and the most that it did, rad.
    moved: (u64, f64),
}

/// Most readings that are kept. Of more, every second one goes, which leaves those of a rest numerous enough.
const MOST_READINGS: usize = 1024;
/// Most rests: those between which motion is kept.
const MOST_RESTS: usize = 128;
/// Fewest readings at a rest.
const LEAST: usize = 3;

impl Headings {
    /// Takes a reading, counterclockwise seen from above, rad.
    pub(super) fn push(&mut self, stamp: Stamp, heading: f64) {
        self.readings += 1;
        self.recent.push((stamp, heading));
        if self.recent.len() > MOST_READINGS {
            let mut keep = false;
            self.recent.retain(|_| {
                keep = !keep;
                keep
            });
        }
    }

    /// Takes a finished rest. Readings that come later than it was found do not count for it.
    pub(super) fn rest(&mut self, rest: &Rest, std: f64) {
        let within = self.recent.iter().filter(|(stamp, _)| (rest.start..=rest.end).contains(stamp));
        let within: Vec<f64> = within.map(|(_, heading)| *heading).collect();
        self.recent.retain(|(stamp, _)| *stamp > rest.end);
        if within.len() < LEAST {
            return;
        }
        self.read += 1;
        let drift = drift(&within);
        if drift > std.max(NOISY * drift_noise(&within)) {
            self.moved = (self.moved.0 + 1, self.moved.1.max(drift));
            return;
        }
        if self.rests.len() == MOST_RESTS {
            self.rests.pop_front();
        }
        self.rests.extend(median(&within).map(|heading| (rest.start, heading)));
    }

    /// Change of heading from one rest to another, by their starts, rad.
    pub(super) fn change(&self, turn: &Turn<'_>) -> Option<f64> {
        // After a clock was set back a time may have been met before, and the latest counts.
        let at = |start: Stamp| self.rests.iter().rev().find(|(known, _)| *known == start).map(|(_, heading)| *heading);
        Some(at(turn.to)? - at(turn.from)?)
    }

    /// Whether there was no reading.
    pub(super) fn are_none(&self) -> bool {
        self.readings == 0
    }

    /// Reason why there is no heading at any rest.
    pub(super) fn why_none(&self) -> Option<&'static str> {
        (self.read == 0).then_some(
            "has no three readings during any rest: check its stamps, which must be of the IMU's clock; where topics stand one \
             behind the other in the file, sort it first, with `mcap sort RECORDING -o SORTED`",
        )
    }

    /// Number of rests during which the heading moved, of how many, and the most that it did, rad, if it moved during most.
    pub(super) fn restless(&self) -> Option<(u64, u64, f64)> {
        let (moved, most) = self.moved;
        (2 * moved > self.read).then_some((moved, self.read, most))
    }
}

/// Least change of heading during a rest that is more than noise, in standard deviations of that: beyond its error at a rest,
/// it changes by more than that from rest to rest.
const NOISY: f64 = 4.0;

/// Median of angles that are less than half a turn from the first, rad.
fn median(headings: &[f64]) -> Option<f64> {
    let first = *headings.first()?;
    let mut off: Vec<f64> = headings.iter().map(|heading| wrapped(heading - first)).collect();
    off.sort_by(f64::total_cmp);
    let (upper, lower) = (off.get(off.len() / 2)?, off.get((off.len() - 1) / 2)?);
    Some(first + (upper + lower) / 2.0)
}

/// Change from the first half of a rest to the second, rad.
fn drift(headings: &[f64]) -> f64 {
    let (first, second) = headings.split_at(headings.len() / 2);
    median(first).zip(median(second)).map_or(0.0, |(first, second)| wrapped(second - first).abs())
}

/// Standard deviation of that by the noise of the readings, which shows from one to the next: 1.25 σ √(2 / n) in each median of
/// n, and a mean difference of 2 σ / √π.
fn drift_noise(headings: &[f64]) -> f64 {
    let steps = headings.windows(2).map(|pair| wrapped(pair[1] - pair[0]).abs());
    let mean = steps.sum::<f64>() / (headings.len().max(2) - 1) as f64;
    1.25 * mean * std::f64::consts::PI.sqrt() / (headings.len().max(1) as f64).sqrt()
}

/// The same angle between −π and π.
fn wrapped(angle: f64) -> f64 {
    angle - (angle / TAU).round() * TAU
}

/// Headings of a reference whose changes are believed.
#[derive(Clone, Copy)]
pub(super) struct HeadingChanges<'a> {
    pub(super) headings: &'a Headings,
    /// Standard deviation of the heading at a rest, rad.
    pub(super) std: f64,
}

impl<'a> HeadingChanges<'a> {
    pub(super) fn new(headings: &'a Headings, config: &HeadingConfig) -> Self {
        Self { headings, std: config.std_deg.to_radians() }
    }

    /// Rotation that a turn was by the heading at its ends.
    pub(super) fn of(&self, turn: &Turn<'_>) -> Option<KnownRotation> {
        self.headings.change(turn).map(|change| KnownRotation::of_heading(change, self.std))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_taken_across_the_end_of_the_circle() {
        let near = |headings: &[f64], expected: f64| {
            let off = wrapped(median(headings).unwrap() - expected).abs();
            assert!(off < 1e-12, "{headings:?}: {off}");
        };
        near(&[3.1, -3.1, 3.12, -3.12, 3.13], TAU / 2.0 - 0.011_592_653_589_793);
        near(&[0.1, 0.2, 9.0, 0.3], 0.25);
        assert!(drift(&[3.1, 3.1, -3.1, -3.1]) < 0.09);
        assert!((drift(&[0.0, 0.0, 0.5, 0.5]) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_drift_is_told_from_noise() {
        let noisy: Vec<f64> = (0..200).map(|i| 0.02 * f64::from((i * 37) % 11 - 5)).collect();
        assert!(drift(&noisy) < NOISY * drift_noise(&noisy) && drift_noise(&noisy) > 1e-3);
        let drifting: Vec<f64> = (0..200).map(|i| 1e-3 * f64::from(i)).collect();
        assert!(drift(&drifting) > NOISY * drift_noise(&drifting), "{}", drift_noise(&drifting));
    }

    #[test]
    fn memory_is_bounded() {
        let mut headings = Headings::default();
        (0..100_000).for_each(|i| headings.push(Stamp::from_nanos(i), 0.1));
        assert!(headings.recent.len() <= MOST_READINGS && headings.recent.len() >= MOST_READINGS / 2);
        assert!(headings.recent.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
