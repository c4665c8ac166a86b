//! Judge of rests: accepted on a face, or rejected for a reason that a person can act on.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::rest_history::{JudgedRest, Verdict};
use super::units::{self, ForceScale};
use crate::fit::{self, Calibration, Fixture};
use crate::imu::{AccelUnit, Sensor};
use crate::messages::segment::Reason;
use crate::plural::counted;
use crate::still::{self, Rest, Segmenter, Signal, TriadMean};

/// Settings and data that rests are judged by.
pub(super) struct Judge<'a> {
    pub(super) still: &'a still::Config,
    pub(super) fit: &'a fit::Config,
    pub(super) fixture: &'a Fixture,
    /// Segmenter, for the noise floor.
    pub(super) segmenter: &'a Segmenter,
    /// Magnitude of gravity, m/s².
    pub(super) gravity: f64,
    /// Unit that the accelerometer's readings were converted from.
    pub(super) accel_unit: AccelUnit,
    /// Whether the unit of the gyroscope's readings is configured.
    pub(super) rate_unit_is_set: bool,
}

/// Poses that a model can use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Poses {
    /// Poses near the faces of the fixture.
    OnFaces,
    /// All poses.
    Any,
}

impl Judge<'_> {
    /// Rejects rests with faults that show in any orientation.
    pub(super) fn sort_out(&self, entries: &mut [JudgedRest]) {
        let usual_rate = self.usual_rate(entries);
        // A long rest is split; its last piece may be short, but its placement is not.
        let mut seconds: BTreeMap<u32, f64> = BTreeMap::new();
        for entry in entries.iter() {
            *seconds.entry(entry.rest.placement).or_default() += entry.seconds;
        }
        let loudest = entries.iter().map(|entry| entry.rest.accelerometer.deviation()).fold(0.0, f64::max);
        for entry in entries {
            let seconds = seconds.get(&entry.rest.placement).copied().unwrap_or(entry.seconds);
            let (reason, explanation) = match self.fault(&entry.rest, seconds, loudest, usual_rate) {
                Some((reason, explanation)) => (reason, explanation),
                None => (Reason::Accepted, String::new()),
            };
            entry.verdict = Verdict { reason, face: None, explanation, misread: false };
        }
    }

    /// Assigns faces to the remaining rests, by the accelerometer's calibration as known or guessed.
    pub(super) fn assign_faces(&self, entries: &mut [JudgedRest], calibration: &Calibration, poses: Poses) {
        let mut placements: BTreeMap<u32, f64> = BTreeMap::new();
        entries.iter().for_each(|entry| *placements.entry(entry.rest.placement).or_default() += entry.seconds);
        for JudgedRest { rest, verdict, .. } in entries {
            // A short rest is accepted for those of its placement, with which it is long enough.
            let with_others = placements
                .get(&rest.placement)
                .filter(|_| rest.seconds() < self.still.min_fit_s)
                .map_or(String::new(), |all| format!(" of {all:.1} s at this placement"));
            if !verdict.is_at_rest() {
                continue;
            }
            let specific_force = calibration.correct(&rest.accelerometer.mean);
            let length = specific_force.norm() / self.gravity;
            // Before the biases are known each axis may seem to sense all of gravity.
            let nearest = self.fixture.nearest(&specific_force).filter(|_| (0.5..1.8).contains(&length));
            let Some((face, tilt)) = nearest else {
                let read = rest.accelerometer.mean.norm();
                verdict.reason = Reason::SensorFault;
                verdict.explanation = not_gravity(read, self.gravity, self.accel_unit);
                verdict.face = None;
                continue;
            };
            let name = self.fixture.faces().get(face).map_or("?", |face| face.name.as_str());
            let limit = self.fit.max_tilt_deg;
            (verdict.reason, verdict.explanation) = if tilt > limit && poses == Poses::OnFaces {
                let explanation =
                    format!("{tilt:.1}° from the nearest face, {name} (limit {limit}°): was the sensor lying flat?");
                (Reason::Tilted, explanation)
            } else if tilt > limit {
                let explanation = format!(
                    "{tilt:.1}° from {name}, {:.1} s{with_others}: the model takes any direction",
                    rest.seconds()
                );
                (Reason::Accepted, explanation)
            } else {
                (Reason::Accepted, format!("{name} up, {:.1} s{with_others}, tilt {tilt:.1}°", rest.seconds()))
            };
            verdict.face = Some((face, tilt));
        }
    }

    /// Fault of a rest, given the duration of its placement and the noise of the noisiest rest.
    fn fault(
        &self,
        rest: &Rest,
        seconds: f64,
        loudest: f64,
        usual_rate: Option<Vector3<f64>>,
    ) -> Option<(Reason, String)> {
        let accelerometer = &rest.accelerometer;
        if seconds < self.still.min_fit_s {
            let in_all = if seconds > rest.seconds() { " in all at this placement" } else { "" };
            let explanation = format!(
                "{seconds:.2} s of rest{in_all}, {} s are needed: hold it still for {} s or more",
                self.still.min_fit_s,
                self.segmenter.hold_s()
            );
            return Some((Reason::TooShort, explanation));
        }
        let pinned = self.segmenter.signal(Sensor::Accelerometer).and_then(|signal| pinned(accelerometer, &signal));
        if let Some(explanation) = clipped(rest).or(pinned) {
            return Some((Reason::Saturated, explanation));
        }
        // A coarse converter may repeat one value at rest; one whose noise is above its step does not.
        if accelerometer.deviation() == 0.0 && self.segmenter.accel_step().is_some_and(|step| loudest > 2.0 * step) {
            let explanation = "the accelerometer does not change at all, as it did before: is the stream frozen?";
            return Some((Reason::SensorFault, explanation.to_owned()));
        }
        if let Some(axis) = frozen_axis(accelerometer, self.segmenter.accel_step()) {
            let explanation =
                format!("the accelerometer's {axis} axis does not change while the others do: is it dead?");
            return Some((Reason::SensorFault, explanation));
        }
        let loudness = self.segmenter.loudness(rest);
        if loudness.0.max(loudness.1) > self.still.enter {
            let explanation = format!(
                "quiet motion, no rest: {:.1} (accelerometer) and {:.1} (gyroscope) times the noise floor seen since; put \
                 it on something firm and let go of it",
                loudness.0, loudness.1
            );
            return Some((Reason::Outlier, explanation));
        }
        let creep = accelerometer.trend.norm();
        // A steady slide trips the gate when its mean is off by `max_creep`; its trend is more than that.
        let noise = if rest.crept { 0.0 } else { 3.0 * accelerometer.trend_noise };
        if creep > 0.7 * self.still.max_creep + noise {
            let explanation = format!("specific force wandered by {creep:.3} m/s²: let the sensor settle");
            return Some((Reason::Creeping, explanation));
        }
        let rate = rest.gyroscope.as_ref()?.mean;
        if !self.is_bias(&rate) {
            let explanation = format!(
                "mean rate of {:.3} rad/s, outside fit.bounds.gyro_bias {}: does it turn{}?",
                rate.norm(),
                self.fit.bounds.gyro_bias,
                if self.rate_unit_is_set { "" } else { ", or is another unit than rad/s to be set" }
            );
            return Some((Reason::Turning, explanation));
        }
        let off = usual_rate.map_or(0.0, |usual| (rate - usual).norm());
        if off > self.still.max_turn {
            let explanation = format!("turns at a constant rate of {:.2} °/s: let it stand", off.to_degrees());
            return Some((Reason::Turning, explanation));
        }
        None
    }

    /// Whether a mean rate may be the bias of a gyroscope at rest.
    fn is_bias(&self, rate: &Vector3<f64>) -> bool {
        rate.iter().enumerate().all(|(axis, rate)| self.fit.bounds.gyro_bias.contains(axis, *rate))
    }

    /// Mean rate on which most of the time at rest agrees within `max_turn`: the gyroscope's bias, unless the sensor
    /// turned steadily most of the time. Among equals the slower, since turning adds to the rate.
    fn usual_rate(&self, entries: &[JudgedRest]) -> Option<Vector3<f64>> {
        let credible = entries.iter().filter(|entry| self.segmenter.is_quiet(&entry.rest));
        let rates = credible.filter_map(|entry| Some((entry.rest.gyroscope.as_ref()?.mean, entry.seconds)));
        let rates: Vec<_> = rates.filter(|(rate, _)| self.is_bias(rate)).collect();
        let support = |centre: &Vector3<f64>| -> f64 {
            let near = rates.iter().filter(|(rate, _)| (rate - centre).norm() <= self.still.max_turn);
            near.map(|(_, seconds)| seconds).sum()
        };
        let scored = rates.iter().map(|(rate, _)| (support(rate), rate));
        let best = scored.max_by(|(a, x), (b, y)| a.total_cmp(b).then(y.norm().total_cmp(&x.norm())));
        best.map(|(_, rate)| *rate)
    }
}

/// Text on readings that the driver reported as clipped.
fn clipped(rest: &Rest) -> Option<String> {
    let gyroscope = rest.gyroscope.as_ref().map_or(0, |mean| mean.clipped);
    let said = [("accelerometer", rest.accelerometer.clipped), ("gyroscope", gyroscope)];
    said.into_iter().find(|(_, clipped)| *clipped > 0).map(|(name, clipped)| {
        let readings = counted(clipped, "reading");
        format!("the driver says that it clipped {readings} of the {name}: set a wider range in the driver")
    })
}

/// Text on an axis at an end of its range: at the lowest or highest reading of the whole stream, far more often than by
/// noise.
fn pinned(mean: &TriadMean, signal: &Signal) -> Option<String> {
    const SHARE: f64 = 0.05;
    const LEAST: u64 = 10;
    let (rest, stream) = (&mean.extremes, &signal.range);
    (0..3).filter(|axis| signal.is_fine() && !stream.is_constant(*axis)).find_map(|axis| {
        let ends = [
            (rest.low[axis], stream.low[axis], rest.at_low[axis]),
            (rest.high[axis], stream.high[axis], rest.at_high[axis]),
        ];
        let often = |count: u64| count >= LEAST && count as f64 > SHARE * mean.samples as f64;
        let (end, _, count) = ends.into_iter().find(|(own, all, count)| own == all && often(*count))?;
        let share = 100.0 * count as f64 / mean.samples as f64;
        let axis = ["x", "y", "z"][axis];
        Some(format!(
            "the accelerometer's {axis} axis is pinned at {end:.3} m/s², an end of its range, in {share:.0} % of the samples: \
             set a wider range in the driver"
        ))
    })
}

/// Axis that stays exactly constant while another moves by more than a step of the converter.
fn frozen_axis(mean: &TriadMean, step: Option<f64>) -> Option<&'static str> {
    let std = mean.std();
    let alive = std.max() > 2.0 * step.unwrap_or(0.0);
    let axes = ["x", "y", "z"];
    axes.into_iter().zip(&std).find(|(_, std)| alive && **std == 0.0).map(|(axis, _)| axis)
}

/// Text on a magnitude at rest that is not gravity.
fn not_gravity(read: f64, gravity: f64, unit: AccelUnit) -> String {
    if let Some(scale) = ForceScale::of(read, unit.factor()) {
        return units::not_metres(read, scale);
    }
    let near = |value: f64| (read / value - 1.0).abs() < 0.4;
    let guess = if near(1.0) && unit == AccelUnit::default() {
        "it is in g: set accel = { unit = \"g\" }".to_owned()
    } else if read < 0.6 {
        "gravity was removed before it was recorded: record the raw accelerometer instead".to_owned()
    } else if read > 20.0 * gravity {
        "are these raw counts of the converter? Record them in m/s² or g".to_owned()
    } else {
        format!("that is {:.2} g: is the full-scale range that its driver assumes the one that is set?", read / gravity)
    };
    format!("reads {read:.3} m/s² at rest, where gravity is {gravity:.2}: {guess}")
}
