//! Drift of a calibration since an earlier one: axis by axis, and as its effect on a corrected reading.

use nalgebra::{Matrix3, Vector3};

use super::{Earlier, Findings, calibration, matrix, vector};
use crate::fit::temperature::BiasCourse;
use crate::fit::{Calibration, Gravity};
use crate::messages::triad::Status;
use crate::messages::{self, Triad};

/// Drift of one triad.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    /// "accelerometer", "gyroscope", or the secondary's name.
    pub sensor: String,
    /// Change of the bias, in the unit of the triad; absent if the earlier one is unknown.
    pub bias: Option<[Change; 3]>,
    /// Change of the scale, if both have one.
    pub scale: Option<[Change; 3]>,
    /// Largest change of a corrected reading over all directions of gravity, m/s²: accelerometers only.
    pub worst: Option<f64>,
}

/// Change of a parameter: now minus then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Size of the change.
    pub by: f64,
    /// Standard deviation of the change, as far as the two calibrations state theirs.
    pub std: f64,
}

impl Change {
    /// Whether the change exceeds three standard deviations.
    pub fn is_significant(self) -> bool {
        self.by.abs() > 3.0 * self.std
    }
}

impl Drift {
    /// Whether any change is significant.
    pub fn is_significant(&self) -> bool {
        self.bias.iter().chain(&self.scale).flatten().any(|change| change.is_significant())
    }
}

/// Drifts of an IMU's triads since an earlier calibration, for triads that both determine.
///
/// # Errors
///
/// If the earlier calibration has none that is this one.
pub fn drift(now: &Findings, earlier: &Earlier<'_>) -> Result<Vec<Drift>, String> {
    let then = earlier.of(&now.name, &now.topic)?.findings;
    let (Some(now), Some(then)) = (&now.calibration, &then.calibration) else { return Ok(Vec::new()) };
    // If both took the same standard gravity, at one site, its error is the same in both scales.
    let standard = Gravity::standard();
    let same_site = now.gravity_source == standard.source.name() && then.gravity_source == now.gravity_source;
    let shared = if same_site { standard.std / standard.value } else { 0.0 };
    let secondary = now.secondary.iter().filter_map(|triad| {
        let then = then.secondary.iter().find(|then| then.sensor == triad.sensor)?;
        moved(triad, then, Some(now.gravity), shared)
    });
    let accelerometer = now.accelerometer.as_ref().zip(then.accelerometer.as_ref());
    let gyroscope = now.gyroscope.as_ref().zip(then.gyroscope.as_ref());
    let accelerometer = accelerometer.and_then(|(now_, then)| moved(now_, then, Some(now.gravity), shared));
    let gyroscope = gyroscope.and_then(|(now, then)| moved(now, then, None, 0.0));
    Ok(accelerometer.into_iter().chain(gyroscope).chain(secondary).collect())
}

/// Drift of a triad. Both scales contain a common relative error with standard deviation `shared`, which counts once.
fn moved(now: &Triad, then: &Triad, gravity: Option<f64>, shared: f64) -> Option<Drift> {
    let current = calibration(now)?;
    if then.status() == Status::Undetermined {
        return None;
    }
    let then = &at_temperature_of(now, then);
    let earlier = calibration(then);
    let changes = |now: [Option<&messages::Vector3>; 2], then: [Option<&messages::Vector3>; 2], shared: f64| {
        let [value, std] = now.map(|v| v.map(vector));
        let [before, std_before] = then.map(|v| v.map(vector));
        let (by, std) = (value? - before?, std.unwrap_or_default());
        let std = std.zip_map(&std_before.unwrap_or_default(), |a: f64, b: f64| {
            let once = (shared * shared).min(a * a).min(b * b);
            (a * a + b * b - once).sqrt()
        });
        Some([0, 1, 2].map(|i| Change { by: by[i], std: std[i] }))
    };
    Some(Drift {
        sensor: now.sensor.clone(),
        bias: changes([now.bias.as_ref(), now.bias_std.as_ref()], [then.bias.as_ref(), then.bias_std.as_ref()], 0.0),
        scale: changes(
            [now.scale.as_ref(), now.scale_std.as_ref()],
            [then.scale.as_ref(), then.scale_std.as_ref()],
            shared,
        )
        .filter(|_| matrix(&then.sensitivity).is_some()),
        worst: gravity.zip(earlier).map(|(gravity, earlier)| worst(&current, &earlier, gravity)),
    })
}

/// Earlier triad with its bias at the temperature that the present one is for, as far as that is known.
fn at_temperature_of(now: &Triad, then: &Triad) -> Triad {
    let (Some(now), Some(course)) = (&now.temperature, then.temperature.as_ref().and_then(BiasCourse::of)) else {
        return then.clone();
    };
    let (change, more) = (course.change(now.reference), course.change_std(now.reference));
    let shifted = |v: &messages::Vector3| messages::Vector3 { x: v.x + change.x, y: v.y + change.y, z: v.z + change.z };
    let wider = |v: &messages::Vector3| messages::Vector3 {
        x: libm::hypot(v.x, more.x),
        y: libm::hypot(v.y, more.y),
        z: v.z.hypot(more.z),
    };
    let (bias, bias_std) = (then.bias.as_ref().map(shifted), then.bias_std.as_ref().map(wider));
    Triad { bias, bias_std, ..then.clone() }
}

/// Largest ‖corrected with `earlier` − true‖ over all directions of a true value of length g, if `now` is right.
///
/// The difference is A·g·u + c over unit vectors u. Its length is convex, so stepping from a direction to that of its
/// gradient never lowers it, and the 26 starts find the highest peak.
fn worst(now: &Calibration, earlier: &Calibration, gravity: f64) -> f64 {
    let inverse = earlier.inverse();
    let a = (inverse * now.sensitivity - Matrix3::identity()) * gravity;
    let c = inverse * (now.bias - earlier.bias);
    let starts = (0..27).map(|k| Vector3::new((k % 3 - 1) as f64, (k / 3 % 3 - 1) as f64, (k / 9 - 1) as f64));
    let peak = |mut u: Vector3<f64>| {
        for _ in 0..60 {
            u = (a.transpose() * (a * u + c)).try_normalize(1e-300).unwrap_or(u);
        }
        (a * u + c).norm()
    };
    starts.filter_map(|start| start.try_normalize(0.5)).map(peak).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_direction_changes_by_more_than_the_worst(
            s in prop::array::uniform9(-0.05..0.05), b in prop::array::uniform3(-1.0..1.0), u in prop::array::uniform3(-1.0..1.0)
        ) {
            let now = Calibration { bias: b.into(), sensitivity: Matrix3::identity() + Matrix3::from_row_slice(&s) };
            let worst = worst(&now, &Calibration::default(), 9.8);
            let Some(u) = Vector3::from(u).try_normalize(0.01) else { return Ok(()) };
            let change = (Calibration::default().correct(&now.measure(&(u * 9.8))) - u * 9.8).norm();
            prop_assert!(change <= worst * (1.0 + 1e-6), "{change} > {worst}");
            // And some direction comes close to the bound of the triangle inequality.
            prop_assert!(worst >= now.bias.norm() * 0.99);
        }
    }
}
