//! What speaks against the readings of a triad, whatever is fitted to them: each thing is said once in the log and stands
//! in the triad's notes, and some forbid a calibration. What is wrong with a single rest is left to `judge`.

use serde::{Deserialize, Serialize};

use super::book::Entry;
use super::observe;
use super::solve::Solution;
use super::turn::{Axes, Hypothesis, Turns};
use super::words;
use crate::imu::{Preset, Sensor};
use crate::still::{Segmenter, Signal};

/// Something that was recognised.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Suspicion {
    pub(super) sensor: Sensor,
    pub(super) cause: Cause,
    /// What was seen and what to do, for people.
    pub(super) text: String,
}

/// What may be wrong with a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) enum Cause {
    /// An axis is flipped against the other sensor.
    Flipped,
    /// The gyroscope does not explain how gravity turned, and no flip does.
    Disagreeing,
    /// It is in deg/s.
    Degrees,
    /// Its mean relaxes to zero at rest.
    Relaxing,
    /// An axis never changes.
    Dead,
    /// Readings are published twice.
    Repeated,
    /// From face to face it spans far more than gravity.
    Stretched,
    /// It reads more than the sensor can measure.
    BeyondRange,
    /// The first rest reads −g on z.
    Inverted,
}

impl Suspicion {
    /// Whether a calibration must not be published in spite of it.
    pub(super) fn forbids(&self) -> bool {
        match self.cause {
            // A bias at rest is one, whatever the sign of the axis; an accelerometer's faces are not.
            Cause::Flipped => self.sensor == Sensor::Accelerometer,
            Cause::Degrees | Cause::Relaxing | Cause::Dead | Cause::Stretched | Cause::BeyondRange => true,
            Cause::Disagreeing | Cause::Repeated | Cause::Inverted => false,
        }
    }
}

/// All that is suspicious, given what the rests seem to determine.
pub(super) fn examine(
    segmenter: &Segmenter,
    entries: &[Entry],
    turns: &Turns,
    preset: Option<Preset>,
    solution: &Solution,
) -> Vec<Suspicion> {
    let guessed = solution.guessed;
    let calibration = solution.accelerometer.as_ref().map_or(guessed, |fit| fit.calibration());
    let accelerometer = segmenter.signal(Sensor::Accelerometer);
    let gyroscope = segmenter.signal(Sensor::Gyroscope);
    let repeated = [(Sensor::Accelerometer, accelerometer), (Sensor::Gyroscope, gyroscope)];
    let repeated = repeated.into_iter().filter_map(|(sensor, signal)| {
        let text = words::repeated(repeated_share(&signal?)?);
        Some(Suspicion { sensor, cause: Cause::Repeated, text })
    });
    let of_gyroscope = |cause, text| Suspicion { sensor: Sensor::Gyroscope, cause, text };
    let degrees = gyroscope.filter(|signal| signal.extremes.peak() > FASTEST);
    let degrees = degrees.map(|signal| of_gyroscope(Cause::Degrees, words::too_fast(signal.extremes.peak())));
    let dead = gyroscope.and_then(|signal| dead_axis(&signal));
    let dead = dead.map(|axis| of_gyroscope(Cause::Dead, words::dead_gyroscope(axis)));
    let relaxing = relaxing(entries, observe::gyroscope_noise(segmenter));
    let relaxing = relaxing.map(|(from, to)| of_gyroscope(Cause::Relaxing, words::relaxing(from, to)));
    let axes = match turns.verdict(|force| calibration.correct(force)) {
        Axes::Unknown | Axes::Agree => None,
        Axes::Disagree(degrees) => Some(of_gyroscope(Cause::Disagreeing, words::disagreeing(degrees))),
        Axes::Otherwise(Hypothesis { degrees: true, .. }) => {
            Some(of_gyroscope(Cause::Degrees, words::turned_too_far()))
        }
        Axes::Otherwise(Hypothesis { signs, .. }) => {
            let odd = signs.iter().product::<f64>() < 0.0;
            let sensor = if odd { Sensor::Gyroscope } else { Sensor::Accelerometer };
            Some(Suspicion { sensor, cause: Cause::Flipped, text: words::flipped(&signs) })
        }
    };
    let of_accelerometer = |cause, text| Suspicion { sensor: Sensor::Accelerometer, cause, text };
    let stretched = guessed.sensitivity.diagonal().max();
    let stretched = (stretched > STRETCHED).then(|| of_accelerometer(Cause::Stretched, words::stretched(stretched)));
    let beyond = preset.zip(accelerometer).and_then(|(preset, signal)| {
        let (peak, range) = (signal.extremes.peak(), preset.datasheet().accelerometer.range);
        let text = words::beyond_range(peak, range);
        (peak > BEYOND * range).then(|| of_accelerometer(Cause::BeyondRange, text))
    });
    let inverted = entries.iter().find(|entry| entry.verdict.is_accepted()).is_some_and(|entry| {
        let force = calibration.correct(&entry.rest.accelerometer.mean);
        force.z < -0.9 * force.norm()
    });
    let inverted = inverted.then(|| of_accelerometer(Cause::Inverted, words::inverted()));
    repeated
        .chain(stretched)
        .chain(beyond)
        .chain(degrees.or(dead))
        .chain(relaxing)
        .chain(axes)
        .chain(inverted)
        .collect()
}

/// Takes back what must not be published.
pub(super) fn veto(solution: &mut Solution) {
    for suspicion in solution.suspicions.iter().filter(|suspicion| suspicion.forbids()) {
        match suspicion.sensor {
            Sensor::Accelerometer => {
                solution.accelerometer = Err(suspicion.text.clone());
                for secondary in &mut solution.secondary {
                    *secondary = Err("waits for the calibration of the primary accelerometer".to_owned());
                }
            }
            Sensor::Gyroscope => solution.gyroscope = None,
            Sensor::Secondary(i) => {
                if let Some(secondary) = solution.secondary.get_mut(i) {
                    *secondary = Err(suspicion.text.clone());
                }
            }
            Sensor::Reference(_) => {}
        }
    }
}

/// A scale that is off, and a bias, take readings a little beyond the nominal range.
const BEYOND: f64 = 1.2;
/// No datasheet allows a scale like this.
const STRETCHED: f64 = 1.4;
/// Faster than any hand-sized gyroscope measures (±4000 °/s), rad/s.
const FASTEST: f64 = 75.0;

/// The part of the readings that repeat the one before, if that is more than chance makes.
fn repeated_share(signal: &Signal) -> Option<f64> {
    const CHANCE: f64 = 0.1;
    const ENOUGH: u64 = 200;
    let share = signal.repeated as f64 / signal.readings.max(1) as f64;
    (signal.is_fine() && signal.readings > ENOUGH && share > CHANCE).then_some(share)
}

/// An axis that never changed while another moved.
fn dead_axis(signal: &Signal) -> Option<&'static str> {
    const ENOUGH: u64 = 100;
    let span = (signal.extremes.high - signal.extremes.low).max();
    let alive = signal.readings > ENOUGH && signal.step.is_some_and(|step| span > 10.0 * step);
    let axes = ["x", "y", "z"].into_iter().enumerate();
    axes.filter(|(i, _)| alive && signal.extremes.is_constant(*i)).map(|(_, axis)| axis).next()
}

/// The mean rates at the ends of a rest in which the gyroscope went to zero, if that is no single motion that ended slowly:
/// an estimator that runs beside it takes its bias away while it rests.
fn relaxing(entries: &[Entry], noise: f64) -> Option<(f64, f64)> {
    const LONG: f64 = 10.0;
    let relaxed = entries.iter().filter(|entry| entry.verdict.is_at_rest());
    let relaxed: Vec<_> = relaxed.filter_map(|entry| Some((observe::relaxed(entry, noise)?, entry.seconds))).collect();
    let seconds: f64 = relaxed.iter().map(|(_, seconds)| seconds).sum();
    let (ends, _) = relaxed.first()?;
    (relaxed.len() > 1 || seconds > LONG).then_some(*ends)
}
