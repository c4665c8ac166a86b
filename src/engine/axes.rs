//! Test of the gyroscope's unit and axes: whether its integral from rest to rest explains how gravity turned, or would
//! in another unit or with other axes.
//!
//! A vector fixed in the world obeys a′ = −ω × a in the sensor's frame. If the accelerometer reads m = P a and the
//! gyroscope w = Q ω, with axes exchanged and flipped by P and Q, then m′ = −(R w) × m with R = det P · P Qᵀ: of all
//! wrong axis orders, 48 can be distinguished. A mirrored R is a fault of the gyroscope; any other may be a fault of
//! either.

use nalgebra::{Matrix3, Vector3};

use super::rest_history::JudgedRest;
use crate::Stamp;
use crate::fit::guess;
use crate::fit::turn_fit::TurnSeen;
use crate::imu::RateUnit;
use crate::messages::segment::Reason;
use crate::turns::{Ends, Explanation, History, RateScale, SeenTurn, Unusable, angle_between, explain};

/// Rest, as evidence on how a gyroscope reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stood {
    pub(super) start: Stamp,
    /// Mean reading of the accelerometer, in whatever unit.
    pub(super) force: Vector3<f64>,
    /// Mean reading of the gyroscope, in whatever unit.
    pub(super) rate: Vector3<f64>,
}

/// Largest number of turns used, the latest ones.
const MOST_TURNS: usize = 12;
/// Least angle by which gravity must have turned, rad.
const TURNED: f64 = 0.45;
/// Longest usable turn, s.
const LONGEST: f64 = 60.0;
/// Standard gravity, m/s².
const G: f64 = 9.80665;

impl Stood {
    /// Takes a rest that was accepted, or rejected for what a wrong unit or a wrong axis may cause.
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

/// Explains the turns of a gyroscope whose readings were taken for this unit.
pub(super) fn explanation(history: &History, stood: &[Stood], unit: RateUnit) -> Explanation {
    // A reading in rad/s is the recorded one times the factor of the unit.
    let scales: Vec<_> = RateScale::all().map(|scale| scale.per_radian() * unit.factor()).collect();
    explain(&seen(history, stood), &scales)
}

/// Explains turns of other recordings, whose readings were converted to rad/s.
pub(super) fn explanation_of_past(turns: &[TurnSeen], entries: &[JudgedRest]) -> Explanation {
    let stood: Vec<_> = entries.iter().map(Stood::of).collect();
    let known: Vec<_> = stood.iter().flatten().copied().collect();
    let correct = correction(&known);
    let seen = turns.iter().rev().filter_map(|turn| {
        let [before, after] = turn.rests.map(|rest| stood.get(rest).copied().flatten());
        let ends = ends(&before?, &after?, &correct)?;
        Some(SeenTurn { pieces: turn.pieces.clone(), ends, force: None, clipped: false })
    });
    let seen: Vec<_> = seen.take(MOST_TURNS).collect();
    let scales: Vec<_> = RateScale::all().map(|scale| scale.per_radian()).collect();
    explain(&seen, &scales)
}

/// Specific force in m/s² of a reading in any unit: gravity is the length that the rests share.
fn correction(stood: &[Stood]) -> impl Fn(&Vector3<f64>) -> Vector3<f64> + use<> {
    let scale = typical(stood.iter().map(|rest| rest.force.norm())).map_or(1.0, |gravity| G / gravity);
    let forces: Vec<_> = stood.iter().map(|rest| rest.force * scale).collect();
    let calibration = guess(forces.iter(), G);
    move |force: &Vector3<f64>| calibration.correct(&(force * scale))
}

/// Ends of a turn that also rotated gravity.
fn ends(before: &Stood, after: &Stood, correct: &impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Option<Ends> {
    let up = |rest: &Stood| correct(&rest.force).try_normalize(f64::MIN_POSITIVE);
    let ends = Ends { up: [up(before)?, up(after)?], rate: [before.rate, after.rate], by_up: Matrix3::zeros() };
    (angle_between(&ends.up[0], &ends.up[1]) > TURNED).then_some(ends)
}

/// Selects the turns that also rotated gravity.
fn seen(history: &History, stood: &[Stood]) -> Vec<SeenTurn> {
    let at = |start: Stamp| stood.iter().find(|rest| rest.start == start);
    let correct = correction(stood);
    let turns = history.turns(|start| at(start).is_some());
    let seen = turns.into_iter().rev().filter_map(|turn| {
        let why = turn.unusable(None);
        let told = matches!(why, None | Some(Unusable::Clipped | Unusable::TooLong)) && turn.seconds() < LONGEST;
        let ends = ends(at(turn.from)?, at(turn.to)?, &correct)?;
        let force = turn.force().map(|force| correct(&force) / G);
        let clipped = why == Some(Unusable::Clipped);
        let pieces = turn.pieces();
        (told && !pieces.is_empty()).then_some(SeenTurn { pieces, ends, force, clipped })
    });
    seen.take(MOST_TURNS).collect()
}

/// Median of several lengths.
pub(super) fn typical(lengths: impl Iterator<Item = f64>) -> Option<f64> {
    let mut lengths: Vec<_> = lengths.filter(|length| *length > 0.0).collect();
    let middle = lengths.len() / 2;
    (!lengths.is_empty()).then(|| *lengths.select_nth_unstable_by(middle, f64::total_cmp).1)
}
