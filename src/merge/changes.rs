//! Changes of a sensor between recordings: shocks, other sensors under its name, and remounts.

use nalgebra::{SMatrix, SVector};

use super::change_points::Jump;
use super::history::{Change, ChangeKind};
use super::past_rest::PastRest;
use super::random_walk::State;
use super::remount::{Remount, remounts};
use super::timeline::{Course, UNKNOWNS, bias, diagonal};

/// What changes are told of.
struct Seen<'a> {
    rests: &'a [&'a PastRest],
    visits: &'a [Vec<usize>],
    accelerometer: &'a Course<UNKNOWNS>,
    gyroscope: &'a Course<3>,
}

/// Changes of a sensor between visits, by the courses of its triads and the way that it lies at rest.
pub(super) fn changes(
    rests: &[&PastRest],
    visits: &[Vec<usize>],
    accelerometer: &Course<UNKNOWNS>,
    gyroscope: &Course<3>,
) -> Vec<Change> {
    let seen = Seen { rests, visits, accelerometer, gyroscope };
    let (accelerometer, gyroscope) = (&accelerometer.jumps, &gyroscope.jumps);
    let near = |one: usize, other: usize| one.abs_diff(other) <= 1;
    let beside = |at: usize| gyroscope.iter().find(move |jump| near(jump.at, at));
    let alone = gyroscope.iter().filter(|jump| accelerometer.iter().all(|other| !near(other.at, jump.at)));
    let both = accelerometer.iter().map(|jump| (jump.at, Some(jump), beside(jump.at)));
    let mut changes: Vec<_> = both.chain(alone.map(|jump| (jump.at, None, Some(jump)))).collect();
    let remounts = remounts(rests, visits);
    let quiet = remounts.iter().filter(|remount| changes.iter().all(|(at, ..)| !near(*at, remount.at)));
    let quiet: Vec<_> = quiet.map(|remount| (remount.at, None, None)).collect();
    changes.extend(quiet);
    changes.sort_by_key(|(at, ..)| *at);
    let change = |(at, accelerometer, gyroscope): (usize, _, _)| {
        let remount = remounts.iter().find(|remount| near(remount.at, at));
        seen.change(at, accelerometer, gyroscope, remount)
    };
    changes.into_iter().filter_map(change).collect()
}

impl Seen<'_> {
    fn change(
        &self,
        at: usize,
        accelerometer: Option<&Jump<UNKNOWNS>>,
        gyroscope: Option<&Jump<3>>,
        remount: Option<&Remount>,
    ) -> Option<Change> {
        /// Largest change of scale that leaves a sensor the same, however significant it is.
        const SAME: f64 = 3e-3;
        let rest = |visit: usize, last: bool| {
            let visit = self.visits.get(visit)?;
            self.rests.get(*if last { visit.last() } else { visit.first() }?)
        };
        let (before, behind) = (rest(at.checked_sub(1)?, true)?, rest(at, false)?);
        let (by, std) = match accelerometer {
            Some(jump) => (jump.by, jump.std),
            None => difference(&self.accelerometer.states, at)?,
        };
        let gyro_bias = match gyroscope {
            Some(jump) => Some((jump.by, jump.std)),
            None => difference(&self.gyroscope.states, at)
                .filter(|_| self.rests.iter().any(|rest| rest.rest.gyroscope.is_some())),
        };
        let [scale, scale_std] = [&by, &std].map(diagonal);
        let replaced = accelerometer.is_some() && (0..3).any(|i| scale[i].abs() > SAME.max(4.0 * scale_std[i]));
        let scores = accelerometer.map(|jump| jump.score).into_iter().chain(gyroscope.map(|jump| jump.score));
        let scores = scores.chain(remount.map(Remount::score));
        let kind = match (accelerometer, gyroscope) {
            _ if replaced => ChangeKind::Replaced,
            (None, None) => ChangeKind::Remounted,
            _ => ChangeKind::Shock,
        };
        Some(Change {
            kind,
            after: before.rest.end,
            before: behind.rest.start,
            score: scores.fold(0.0, f64::max),
            bias: [bias(&by), bias(&std)],
            scale: [scale, scale_std],
            gyro_bias: gyro_bias.map(|(by, std)| [by.into(), std.into()]),
            turned: remount.map(|remount| remount.angle),
        })
    }
}

/// Difference of a state from the one before it, and its standard deviation.
fn difference<const N: usize>(states: &[State<N>], at: usize) -> Option<(SVector<f64, N>, SVector<f64, N>)> {
    let (before, behind) = (states.get(at.checked_sub(1)?)?, states.get(at)?);
    let covariance: SMatrix<f64, N, N> = before.covariance + behind.covariance;
    Some((behind.mean - before.mean, covariance.diagonal().map(|variance| variance.max(0.0).sqrt())))
}
