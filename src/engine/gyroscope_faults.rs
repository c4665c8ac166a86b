//! Faults of a gyroscope that its rests, its turns and its clock show: zeros at rest, a bias that drifts, the end of its
//! range, stamps that run fast.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::clock_drift::ClockDrift;
use super::fault::{Fault, FaultKind};
use super::fit_inputs::FitInputs;
use super::observations;
use super::rest_history::JudgedRest;
use super::solution::Solution;
use crate::imu::Sensor;
use crate::plural::counted;
use crate::still::{Segmenter, TriadMean};
use crate::turns::Unusable;

/// Detects them, given the estimates.
pub(super) fn detect(
    segmenter: &Segmenter,
    entries: &[JudgedRest],
    clock: &ClockDrift,
    inputs: &FitInputs<'_>,
    solution: &Solution,
) -> Vec<Fault> {
    let Some(signal) = segmenter.signal(Sensor::Gyroscope) else { return Vec::new() };
    let fault = |kind, text| Fault { sensor: Sensor::Gyroscope, kind, text };
    let rests: Vec<_> = entries.iter().filter(|entry| entry.verdict.is_at_rest()).collect();
    // A sensor that never reads anything else is told as absent or dead.
    let silenced = (signal.range.peak() > 0.0 && is_silenced(&rests)).then(|| {
        let text = "reads exactly 0 at rest, and other values in motion: the driver leaves out small rates or takes the bias off, \
                    so none can be told. Record the raw rates";
        fault(FaultKind::Silenced, text.to_owned())
    });
    let drifting = drift(&rests, solution).map(|moved| {
        let [x, y, z] = moved.into();
        let text = format!(
            "its bias drifts steadily, by {x:+.4} {y:+.4} {z:+.4} rad/s from the first rest to the last; what is told is about the \
             mean. Let it warm up first, record its temperature, or set fit.half_life_s for the bias at the end"
        );
        fault(FaultKind::Drifting, text)
    });
    let clock = clock.found().map(|drift| {
        let way = if drift > 0.0 { "fast" } else { "slow" };
        let percent = 100.0 * drift.abs();
        let text = format!(
            "the stamps run {percent:.1} % {way} against the times of the log: if the sensor's own clock makes them, angles and with \
             them the scale of the gyroscope are off by as much. Synchronise the clocks, or stamp by the host's"
        );
        fault(FaultKind::Clock, text)
    });
    let clipped = clipped(segmenter, entries, inputs).map(|text| fault(FaultKind::Clipped, text));
    silenced.into_iter().chain(drifting).chain(clock).chain(clipped).collect()
}

/// Text on turns between rests that reach the end of the range, if any do.
fn clipped(segmenter: &Segmenter, entries: &[JudgedRest], inputs: &FitInputs<'_>) -> Option<String> {
    let noise = observations::gyroscope_noise(segmenter);
    let tells = |entry: &&JudgedRest| observations::tells_of_rates(entry, noise);
    let stood: BTreeSet<_> = entries.iter().filter(tells).map(|entry| entry.rest.start).collect();
    let turns = inputs.turns.turns(|start| stood.contains(&start));
    let clipped = turns.iter().filter(|turn| turn.unusable(inputs.gyro_range) == Some(Unusable::Clipped));
    let peak = clipped.clone().map(|turn| turn.peak()).reduce(f64::max)?;
    Some(format!(
        "{} of {} without use: the rate reached the end of the range, {:.0} °/s ({peak:.3} rad/s). Turn it more slowly, or set a wider \
         range in the driver",
        clipped.count(),
        counted(turns.len() as u64, "turn"),
        peak.to_degrees()
    ))
}

/// Whether most rests read exactly zero on all axes throughout.
fn is_silenced(rests: &[&JudgedRest]) -> bool {
    /// Fewest such rests.
    const LEAST: usize = 2;
    let means = rests.iter().filter_map(|entry| entry.rest.gyroscope.as_ref());
    let is_zero = |mean: &&TriadMean| mean.mean == Vector3::zeros() && mean.std() == Vector3::zeros();
    let (all, zero) = (means.clone().count(), means.filter(is_zero).count());
    zero >= LEAST && 2 * zero > all
}

/// Change of the bias from the first rest to the last, rad/s, if a line explains nearly all of what the rests differ by
/// on an axis, and the published interval does not hold its ends. A bias that follows the temperature does not drift.
fn drift(rests: &[&JudgedRest], solution: &Solution) -> Option<Vector3<f64>> {
    /// Fewest rests.
    const LEAST: usize = 6;
    /// Least share of the variance between rests that the line explains.
    const EXPLAINED: f64 = 0.9;
    /// Least change over the standard deviation of the bias.
    const BEYOND: f64 = 5.0;
    if solution.temperature.as_ref().is_some_and(|courses| courses.gyroscope.is_ok()) {
        return None;
    }
    let fit = solution.gyroscope.as_ref()?;
    let first = rests.first()?.rest.start;
    let seen: Vec<_> = rests
        .iter()
        .filter_map(|entry| Some((entry.rest.start.seconds_since(first), entry.rest.gyroscope.as_ref()?.mean)))
        .collect();
    let n = seen.len() as f64;
    if seen.len() < LEAST {
        return None;
    }
    let time = seen.iter().map(|(time, _)| time).sum::<f64>() / n;
    let mean = seen.iter().map(|(_, rate)| rate).sum::<Vector3<f64>>() / n;
    let squares: f64 = seen.iter().map(|(at, _)| (at - time).powi(2)).sum();
    let slope = seen.iter().map(|(at, rate)| (rate - mean) * (at - time)).sum::<Vector3<f64>>() / squares;
    let total = seen.iter().map(|(_, rate)| (rate - mean).map(|off| off * off)).sum::<Vector3<f64>>();
    let lasted = seen.last()?.0;
    let moved = slope * lasted;
    let drifts = |axis: usize| {
        slope[axis] * slope[axis] * squares > EXPLAINED * total[axis] && moved[axis].abs() > BEYOND * fit.std(axis)
    };
    (squares > 0.0 && (0..3).any(drifts)).then_some(moved)
}
