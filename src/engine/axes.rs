//! How the gyroscope reads: whether its integral from rest to rest explains how gravity turned, or would in another unit or
//! with other axes. What becomes of a sensor that is found out is left to `fault_detection`.
//!
//! A vector that is fixed in the world obeys a′ = −ω × a in the sensor's frame. If the accelerometer reads m = P a and the
//! gyroscope w = Q ω, with axes exchanged and flipped by P and Q, then m′ = −(R w) × m with R = det P · P Qᵀ: of all the ways
//! to get axes wrong, 48 can be told apart. A mirrored R is the gyroscope's doing; one that is not may be either's.

use nalgebra::{Matrix3, Vector3};

use super::rest_history::JudgedRest;
use crate::Stamp;
use crate::fit::guess;
use crate::imu::RateUnit;
use crate::messages::segment::Reason;
use crate::turns::{Ends, Explanation, History, RateScale, SeenTurn, Unusable, angle_between, explain};

/// A rest, as far as it tells how a gyroscope reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stood {
    pub(super) start: Stamp,
    /// What the accelerometer read, in whatever unit.
    pub(super) force: Vector3<f64>,
    /// What the gyroscope read.
    pub(super) rate: Vector3<f64>,
}

/// So many of the latest turns suffice.
const MOST_TURNS: usize = 12;
/// Gravity must have turned by this to say anything, rad.
const TURNED: f64 = 0.45;
/// A longer way says too little, s.
const LONGEST: f64 = 60.0;
/// Standard gravity, m/s².
const G: f64 = 9.80665;

impl Stood {
    /// What a wrong unit or a wrong axis makes of a rest is no reason to do without it.
    pub(super) fn of(entry: &JudgedRest) -> Option<Self> {
        let rest = &entry.rest;
        let stood = matches!(
            entry.verdict.reason,
            Reason::Accepted | Reason::Tilted | Reason::Turning | Reason::Outlier | Reason::SensorFault
        );
        let alive = rest.accelerometer.std().min() > 0.0 || rest.accelerometer.deviation() == 0.0;
        let rate = rest.gyroscope.as_ref()?.mean;
        (stood && alive).then_some(Self { start: rest.start, force: rest.accelerometer.mean, rate })
    }
}

/// What the turns say of a gyroscope whose readings were taken for this unit.
pub(super) fn explanation(history: &History, stood: &[Stood], unit: RateUnit) -> Explanation {
    // Readings in rad/s are what was recorded, times the factor of the unit.
    let scales: Vec<_> = RateScale::all().map(|scale| scale.per_radian() * unit.factor()).collect();
    explain(&seen(history, stood), &scales)
}

/// The turns by which gravity turned.
fn seen(history: &History, stood: &[Stood]) -> Vec<SeenTurn> {
    let at = |start: Stamp| stood.iter().find(|rest| rest.start == start);
    // In whatever unit it reads, in m/s² gravity is what the rests share.
    let scale = typical(stood.iter().map(|rest| rest.force.norm())).map_or(1.0, |gravity| G / gravity);
    let forces: Vec<_> = stood.iter().map(|rest| rest.force * scale).collect();
    let calibration = guess(forces.iter(), G);
    let correct = |force: &Vector3<f64>| calibration.correct(&(force * scale));
    let turns = history.turns(|start| at(start).is_some());
    let seen = turns.into_iter().rev().filter_map(|turn| {
        let why = turn.unusable(None);
        let told = matches!(why, None | Some(Unusable::Clipped | Unusable::TooLong)) && turn.seconds() < LONGEST;
        let [before, after] = [at(turn.from)?, at(turn.to)?];
        let up = |rest: &Stood| correct(&rest.force).try_normalize(f64::MIN_POSITIVE);
        let ends = Ends { up: [up(before)?, up(after)?], rate: [before.rate, after.rate], by_up: Matrix3::zeros() };
        let turned = angle_between(&ends.up[0], &ends.up[1]) > TURNED;
        let force = turn.force().map(|force| correct(&force) / G);
        let clipped = why == Some(Unusable::Clipped);
        let pieces = turn.pieces();
        (told && turned && !pieces.is_empty()).then_some(SeenTurn { pieces, ends, force, clipped })
    });
    seen.take(MOST_TURNS).collect()
}

/// The middle one of several lengths.
pub(super) fn typical(lengths: impl Iterator<Item = f64>) -> Option<f64> {
    let mut lengths: Vec<_> = lengths.filter(|length| *length > 0.0).collect();
    let middle = lengths.len() / 2;
    (!lengths.is_empty()).then(|| *lengths.select_nth_unstable_by(middle, f64::total_cmp).1)
}
