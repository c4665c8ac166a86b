//! Detection of faults in the readings of a triad, whatever is fitted to them. Each is logged once and appears in the
//! triad's notes; some forbid a calibration. Faults of a single rest are found by `rest_judge`.

use super::config::Config;
use super::fault::{Fault, FaultKind};
use super::observations;
use super::refusal::Refusal;
use super::rest_history::JudgedRest;
use super::solution::Solution;
use super::units::{self, Misread};
use crate::imu::{RateUnit, Sensor};
use crate::still::{Segmenter, Signal};
use crate::turns::Explanation;

/// Detects all faults, given the estimates from the rests. `force` is the text on the accelerometer's unit, if that is
/// wrong.
pub(super) fn detect(
    segmenter: &Segmenter,
    entries: &[JudgedRest],
    config: &Config,
    force: Option<String>,
    solution: &Solution,
) -> Vec<Fault> {
    let guessed = solution.guessed;
    let calibration = solution.accelerometer.as_ref().map_or(guessed, |fit| fit.calibration());
    let accelerometer = segmenter.signal(Sensor::Accelerometer);
    let gyroscope = segmenter.signal(Sensor::Gyroscope);
    let both = [(Sensor::Accelerometer, accelerometer), (Sensor::Gyroscope, gyroscope)];
    // Where readings of one triad are of several sensors, those of the other are, too.
    let sensors = both.iter().filter_map(|(_, signal)| signal.map(|signal| signal.sensors)).max().unwrap_or(1);
    let alternating = both.into_iter().filter_map(|(sensor, signal)| {
        signal.filter(|_| sensors > 1)?;
        Some(Fault { sensor, kind: FaultKind::Alternating, text: alternating_text(sensors) })
    });
    let uneven = both.into_iter().filter_map(|(sensor, signal)| {
        let signal = signal.filter(|_| sensors == 1)?;
        let apart = signal.apart.filter(|apart| signal.step.is_none_or(|step| *apart > 2.0 * step))?;
        Some(Fault { sensor, kind: FaultKind::Uneven, text: uneven_text(sensor, apart) })
    });
    let repeated = both.into_iter().filter_map(|(sensor, signal)| {
        let text = repeated_text(repeated_share(&signal?)?);
        Some(Fault { sensor, kind: FaultKind::Repeated, text })
    });
    let of_gyroscope = |kind, text| Fault { sensor: Sensor::Gyroscope, kind, text };
    let unit = config.gyro_unit.unwrap_or_default();
    let axes = misread(&solution.turned, unit);
    let told = solution.unit_confirmed || axes.as_ref().is_some_and(|fault| fault.kind == FaultKind::Unit);
    let too_fast = gyroscope.filter(|signal| !told && signal.range.peak() > FASTEST);
    let too_fast = too_fast.map(|signal| of_gyroscope(FaultKind::TooFast, too_fast_text(signal.range.peak())));
    let dead = gyroscope.and_then(|signal| dead_axis(&signal));
    let dead = dead.map(|axis| of_gyroscope(FaultKind::Dead, dead_gyroscope_text(axis)));
    let relaxing = relaxing_rates(entries, observations::gyroscope_noise(segmenter));
    let relaxing = relaxing.map(|(from, to)| of_gyroscope(FaultKind::Relaxing, relaxing_text(from, to)));
    let of_accelerometer = |kind, text| Fault { sensor: Sensor::Accelerometer, kind, text };
    let stretched = guessed.sensitivity.diagonal().max();
    let stretched = (stretched > STRETCHED).then(|| of_accelerometer(FaultKind::Stretched, stretched_text(stretched)));
    let beyond = config.preset.zip(accelerometer).and_then(|(preset, signal)| {
        let (peak, range) = (signal.range.peak(), preset.datasheet().accelerometer.range);
        let text = beyond_range_text(peak, range);
        (peak > BEYOND * range).then(|| of_accelerometer(FaultKind::BeyondRange, text))
    });
    let inverted = entries.iter().find(|entry| entry.verdict.is_accepted()).is_some_and(|entry| {
        let force = calibration.correct(&entry.rest.accelerometer.mean);
        force.z < -0.9 * force.norm()
    });
    let inverted = inverted.then(|| of_accelerometer(FaultKind::Inverted, inverted_text()));
    alternating
        .chain(uneven)
        .chain(repeated)
        .chain(force.map(|text| of_accelerometer(FaultKind::Unit, text)))
        .chain(stretched)
        .chain(beyond)
        .chain(too_fast.or(dead))
        .chain(relaxing)
        .chain(axes)
        .chain(inverted)
        .collect()
}

/// Fault in how the gyroscope or the accelerometer reads, from the turns.
fn misread(turned: &Explanation, unit: RateUnit) -> Option<Fault> {
    let fault = |sensor, kind, text| Some(Fault { sensor, kind, text });
    match *turned {
        Explanation::Unknown | Explanation::Agrees => None,
        Explanation::Disagrees(angle) => {
            fault(Sensor::Gyroscope, FaultKind::Disagreeing, disagreeing_text(angle.to_degrees()))
        }
        Explanation::Otherwise { per_radian, or, axes } => {
            let (what, text) = units::otherwise(per_radian, or, axes, unit);
            match what {
                Misread::Unit => fault(Sensor::Gyroscope, FaultKind::Unit, text),
                Misread::Accelerometer => fault(Sensor::Accelerometer, FaultKind::Flipped, text),
                Misread::Gyroscope | Misread::Turned => fault(Sensor::Gyroscope, FaultKind::Flipped, text),
            }
        }
    }
}

/// Removes what follows from another fault: rates that stop at the end of a range do not explain how gravity turned.
pub(super) fn attribute(faults: &mut Vec<Fault>) {
    if faults.iter().any(|fault| fault.kind == FaultKind::Clipped) {
        faults.retain(|fault| fault.kind != FaultKind::Disagreeing);
    }
}

/// Removes estimates that must not be published.
pub(super) fn veto(solution: &mut Solution) {
    for fault in solution.faults.iter().filter(|fault| fault.forbids()) {
        match fault.sensor {
            Sensor::Accelerometer => {
                solution.accelerometer = Err(Refusal::Fault(fault.text.clone()));
                // Without the accelerometer the turns say nothing.
                solution.gyroscope = solution.gyro_at_rest.take().filter(|_| solution.gyroscope.is_some());
                solution.turning = None;
                for secondary in &mut solution.secondary {
                    *secondary = Err(Refusal::WaitsForPrimary);
                }
            }
            Sensor::Gyroscope => solution.gyroscope = None,
            Sensor::Secondary(i) => {
                if let Some(secondary) = solution.secondary.get_mut(i) {
                    *secondary = Err(Refusal::Fault(fault.text.clone()));
                }
            }
            Sensor::Reference(_) => {}
        }
    }
}

/// Factor beyond the nominal range that a scale error and a bias may reach.
const BEYOND: f64 = 1.2;
/// Scale that no datasheet allows.
const STRETCHED: f64 = 1.4;
/// Rate that no hand-sized gyroscope measures (±4000 °/s), rad/s.
const FASTEST: f64 = 75.0;

/// Share of the readings that repeat the one before, if more than by chance.
fn repeated_share(signal: &Signal) -> Option<f64> {
    const CHANCE: f64 = 0.1;
    const ENOUGH: u64 = 200;
    let share = signal.repeated as f64 / signal.readings.max(1) as f64;
    (signal.is_fine() && signal.readings > ENOUGH && share > CHANCE).then_some(share)
}

/// Axis that never changed while another moved.
fn dead_axis(signal: &Signal) -> Option<&'static str> {
    const ENOUGH: u64 = 100;
    let span = (signal.range.high - signal.range.low).max();
    let alive = signal.readings > ENOUGH && signal.step.is_some_and(|step| span > 10.0 * step);
    let axes = ["x", "y", "z"].into_iter().enumerate();
    axes.filter(|(i, _)| alive && signal.range.is_constant(*i)).map(|(_, axis)| axis).next()
}

/// Mean rates at the ends of a rest in which the gyroscope went to zero, if this is not a single motion that ended
/// slowly: an estimator in the driver removes the bias at rest.
fn relaxing_rates(entries: &[JudgedRest], noise: f64) -> Option<(f64, f64)> {
    const LONG: f64 = 10.0;
    let relaxed = entries.iter().filter(|entry| entry.verdict.is_at_rest());
    let relaxed: Vec<_> =
        relaxed.filter_map(|entry| Some((observations::relaxed(entry, noise)?, entry.seconds))).collect();
    let seconds: f64 = relaxed.iter().map(|(_, seconds)| seconds).sum();
    let (ends, _) = relaxed.first()?;
    (relaxed.len() > 1 || seconds > LONG).then_some(*ends)
}

/// Text on readings of several sensors.
fn alternating_text(sensors: usize) -> String {
    let count = ["two", "three", "four"].get(sensors.saturating_sub(2)).copied().unwrap_or("several");
    format!(
        "readings are far from the one before and near the one {sensors} before: {count} sensors take turns on one topic, \
         and what is learned is of none of them. Record each on a topic, or under a frame_id, of its own"
    )
}

/// Text on readings at rest that may be of several sensors.
fn uneven_text(sensor: Sensor, apart: f64) -> String {
    let unit = if sensor == Sensor::Gyroscope { "rad/s" } else { "m/s²" };
    format!(
        "readings at rest alternate, {apart:.4} {unit} from one to the next: either sensors take turns on one topic, and what is \
         learned is of none of them, or something vibrates at half the sampling rate. Record each sensor on a topic, or under a \
         frame_id, of its own"
    )
}

/// Text on readings that are published twice.
fn repeated_text(share: f64) -> String {
    format!(
        "{:.0} % of the readings repeat the one before exactly: is the topic published twice, or the driver polled faster \
         than the sensor measures?",
        100.0 * share
    )
}

/// Text on a rate that no gyroscope measures.
fn too_fast_text(peak: f64) -> String {
    format!(
        "peaks at {peak:.0} rad/s, faster than any gyroscope measures: these are spikes, or it is in another unit than rad/s. \
         Set its unit, or turn it over between two rests: the turn tells"
    )
}

/// Text on an axis of the gyroscope that never changes.
fn dead_gyroscope_text(axis: &str) -> String {
    format!("the {axis} axis never changes while the others do: is it dead, or not mapped?")
}

/// Text on a bias that is removed at rest.
fn relaxing_text(from: f64, to: f64) -> String {
    format!(
        "its mean relaxes towards zero at rest, from {from:.4} to {to:.4} rad/s: an estimator in the driver removes the \
         bias as it goes. Record the raw rates, or switch it off"
    )
}

/// Text on a gyroscope that does not explain how gravity turned.
fn disagreeing_text(degrees: f64) -> String {
    format!(
        "integrating the rates from rest to rest misses gravity by {degrees:.0}° and no unit or order of axes explains it: check \
         that its axes are those of the accelerometer, its unit and its time stamps, and that no samples are missing between \
         two poses"
    )
}

/// Text on a reading beyond the range of the sensor.
fn beyond_range_text(peak: f64, range: f64) -> String {
    format!(
        "reads {peak:.0} m/s², beyond the {range:.0} m/s² that its preset can measure: is the preset the right one, and the \
         unit m/s²?"
    )
}

/// Text on an accelerometer that spans far more than gravity.
fn stretched_text(times: f64) -> String {
    format!(
        "an axis spans {times:.2} times gravity from face to face: is the full-scale range that its driver assumes the one \
         that is set?"
    )
}

/// Text on a first rest of −g on z.
fn inverted_text() -> String {
    "the first rest reads -g on z. In an FRD frame it should; if yours has z up, every axis has the wrong sign, which \
     rests cannot tell. The calibration holds for the readings as they are"
        .to_owned()
}
