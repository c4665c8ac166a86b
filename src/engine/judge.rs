//! What is thought of each rest: accepted on a face, or rejected for a reason that a person can act on.

use nalgebra::Vector3;

use super::book::{Entry, Verdict};
use crate::fit::{self, Calibration, Fixture};
use crate::messages::segment::Reason;
use crate::still::{self, Rest, Segmenter, TriadMean};

/// What rests are judged by.
pub(super) struct Judge<'a> {
    pub(super) still: &'a still::Config,
    pub(super) fit: &'a fit::Config,
    pub(super) fixture: &'a Fixture,
    /// Knows the noise floor.
    pub(super) segmenter: &'a Segmenter,
}

impl Judge<'_> {
    /// Faults that show whatever the orientation.
    pub(super) fn sort_out(&self, entries: &mut [Entry]) {
        let usual_rate = self.usual_rate(entries);
        for entry in entries {
            let (reason, explanation) = match self.fault(&entry.rest, usual_rate) {
                Some((reason, explanation)) => (reason, explanation),
                None => (Reason::Accepted, String::new()),
            };
            entry.verdict = Verdict { reason, face: None, explanation };
        }
    }

    /// The faces of the faultless, by the accelerometer's calibration as it is known or guessed.
    pub(super) fn assign_faces(&self, entries: &mut [Entry], calibration: &Calibration) {
        for Entry { rest, verdict, .. } in entries {
            if !matches!(verdict.reason, Reason::Accepted | Reason::Tilted) {
                continue;
            }
            let nearest = self.fixture.nearest(&calibration.correct(&rest.accelerometer.mean));
            let Some((face, tilt)) = nearest.filter(|(_, tilt)| tilt.is_finite()) else { continue };
            let name = self.fixture.faces().get(face).map_or("?", |face| face.name.as_str());
            let limit = self.fit.max_tilt_deg;
            (verdict.reason, verdict.explanation) = if tilt > limit {
                let explanation =
                    format!("{tilt:.1}° from the nearest face, {name} (limit {limit}°): was the sensor lying flat?");
                (Reason::Tilted, explanation)
            } else {
                (Reason::Accepted, format!("{name} up, {:.1} s, tilt {tilt:.1}°", rest.seconds()))
            };
            verdict.face = Some((face, tilt));
        }
    }

    fn fault(&self, rest: &Rest, usual_rate: Option<Vector3<f64>>) -> Option<(Reason, String)> {
        let accelerometer = &rest.accelerometer;
        if rest.seconds() < self.still.min_fit_s {
            let explanation = format!("{:.2} s: hold it still for {} s or more", rest.seconds(), self.still.min_fit_s);
            return Some((Reason::TooShort, explanation));
        }
        if let Some(axis) = frozen_axis(accelerometer, self.segmenter.accel_step()) {
            let explanation =
                format!("the accelerometer's {axis} axis does not change while the others do: is it dead?");
            return Some((Reason::SensorFault, explanation));
        }
        if !self.segmenter.is_quiet(rest) {
            let explanation = format!(
                "noisier than the rests seen since (accelerometer {:.3} m/s²): it was quiet motion",
                accelerometer.deviation() / 3_f64.sqrt()
            );
            return Some((Reason::Outlier, explanation));
        }
        let creep = accelerometer.trend.norm();
        // The trend of white noise over the rest has √12 times the error of its mean.
        let noise = (12.0 * accelerometer.mean_variance().sum()).sqrt();
        if creep > 0.7 * self.still.max_creep + 3.0 * noise {
            let explanation = format!("specific force wandered by {creep:.3} m/s²: let the sensor settle");
            return Some((Reason::Creeping, explanation));
        }
        let rate = rest.gyroscope.as_ref()?.mean;
        let [low, high] = self.fit.bounds.gyro_bias;
        let off = usual_rate.map_or(0.0, |usual| (rate - usual).norm());
        if off > self.still.max_turn || rate.iter().any(|rate| *rate < low || *rate > high) {
            let explanation = format!(
                "turns at a constant rate of {:.2} °/s: let it stand",
                (rate - usual_rate.unwrap_or_default()).norm().max(off).to_degrees()
            );
            return Some((Reason::Turning, explanation));
        }
        None
    }

    /// The mean rate that most rests agree on: the gyroscope's bias, unless it turned most of the time.
    fn usual_rate(&self, entries: &[Entry]) -> Option<Vector3<f64>> {
        let long = entries.iter().filter(|entry| entry.rest.seconds() >= self.still.min_fit_s);
        let mut rates: Vec<_> = long.filter_map(|entry| entry.rest.gyroscope.as_ref()).map(|seen| seen.mean).collect();
        if rates.len() <= 2 {
            // Two cannot outvote each other; what turns turns faster.
            return rates.into_iter().min_by(|a, b| a.norm().total_cmp(&b.norm()));
        }
        Some(Vector3::from_fn(|axis, _| {
            rates.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
            rates.get(rates.len() / 2).map_or(0.0, |rate| rate[axis])
        }))
    }
}

/// The axis that stands still to the last bit while another moves by more than a step of the converter.
fn frozen_axis(mean: &TriadMean, step: Option<f64>) -> Option<&'static str> {
    let std = mean.std();
    let alive = std.max() > 2.0 * step.unwrap_or(0.0);
    let axes = ["x", "y", "z"];
    axes.into_iter().zip(&std).find(|(_, std)| alive && **std == 0.0).map(|(axis, _)| axis)
}
