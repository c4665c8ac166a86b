//! What people are told.

use super::Config;
use super::publish::CONFIRMING_REPEATS;
use super::solve::Solution;
use crate::fit::{Estimate, Gravity, Shape, Source, Term};
use crate::imu::Sensor;
use crate::messages::foxglove::log::Level;
use crate::messages::triad::Status;
use crate::messages::{Calibration, Face, Segment, Triad, Vector3};
use crate::still::{self, Segmenter, State};

/// The operator's next step.
pub(super) fn next_step(faces: &[Face], found: u64, solution: &Solution, status: Status) -> String {
    let missing = faces.iter().filter(|face| face.placements == 0 && solution.accelerometer.is_err());
    let missing: Vec<_> = missing.map(|face| face.name.as_str()).collect();
    match (missing.as_slice(), &solution.accelerometer, status) {
        ([first, ..], _, _) if found == 0 || missing.len() == faces.len() => {
            format!("put the sensor down with {first} up (any face will do) and let it rest for two seconds")
        }
        (_, Err(why), _) if solution.unseen.is_some() => {
            let unseen = solution.unseen.as_deref().unwrap_or_default();
            format!("{why}. Turn the sensor so that {unseen} points up and let it rest for two seconds")
        }
        ([only], _, _) => format!("turn the sensor so that {only} points up and let it rest for two seconds"),
        ([first, ..], _, _) => format!(
            "still to see: {}. Turn the sensor so that {first} points up and let it rest for two seconds",
            missing.join(", ")
        ),
        ([], Err(why), _) => format!("no calibration: {why}. Repeat the {} faces on a flat, firm surface", faces.len()),
        ([], Ok(_), Status::Confirmed) => "done: repeated placements agree".to_owned(),
        ([], Ok(_), _) if solution.repeats >= CONFIRMING_REPEATS => {
            "repeated placements disagree: place every face once more on a flat, firm surface".to_owned()
        }
        ([], Ok(_), _) => match CONFIRMING_REPEATS.saturating_sub(solution.repeats) {
            1 => "place another face once more, so that repeats can confirm the calibration".to_owned(),
            repeats => format!("place any {repeats} faces once more, so that repeats can confirm the calibration"),
        },
    }
}

/// A rest that did not enter the fit.
pub(super) fn rejection(segment: &Segment) -> String {
    let time = |stamp: Option<&prost_types::Timestamp>| {
        stamp.map_or(0.0, |stamp| stamp.seconds as f64 + f64::from(stamp.nanos) * 1e-9)
    };
    let start = time(segment.start.as_ref());
    format!(
        "rest of {:.1} s at {start:.2} rejected ({}): {}",
        time(segment.end.as_ref()) - start,
        segment.reason().as_str_name(),
        segment.explanation
    )
}

/// A calibration that was published.
pub(super) fn published(calibration: &Calibration) -> String {
    let triads = calibration.accelerometer.iter().chain(&calibration.gyroscope).chain(&calibration.secondary);
    let parts: Vec<_> = triads.filter(|triad| triad.status() != Status::Undetermined).map(triad).collect();
    format!("calibration {} from {} rests: {}", calibration.revision, calibration.segments, parts.join("; "))
}

/// That nothing was believed to be a rest, and why; `None` if something was.
pub(super) fn never_still(segmenter: &Segmenter, found: u64, config: &still::Config) -> Option<String> {
    let status = segmenter.status();
    if found > 0 || status.state != State::Unknown {
        return None;
    }
    let level = |floor: Option<f64>| floor.map(|floor| floor / 3_f64.sqrt());
    let (accel, gyro) = (level(status.accel_floor), level(status.gyro_floor));
    let said = |level: Option<f64>| level.map_or_else(|| "unknown".to_owned(), |level| format!("{level:.3}"));
    let degrees = gyro.is_some_and(|rate| rate > config.gyro_ceiling && rate.to_radians() < config.gyro_ceiling);
    let hint = if degrees { "; is the gyroscope in deg/s? Set its unit" } else { "" };
    Some(format!(
        "never seen still: the quietest was {} m/s² and {} rad/s per axis, credible are {} and {}{hint}. Let the sensor rest, \
         or raise still.accel_ceiling and still.gyro_ceiling if it vibrates by nature",
        said(accel),
        said(gyro),
        config.accel_ceiling,
        config.gyro_ceiling
    ))
}

/// The driver changed a calibration of its own.
pub(super) fn new_round(config: &Config, sensor: Sensor) -> String {
    let (name, advice) = match sensor {
        Sensor::Accelerometer => ("accelerometer", "show every face again"),
        Sensor::Gyroscope => ("gyroscope", "let the sensor rest again"),
        Sensor::Secondary(i) => {
            (config.secondary.get(i).map_or("secondary", |s| s.name.as_str()), "show the faces again")
        }
    };
    format!("the driver changed its own calibration of the {name}: what it read before no longer counts; {advice}")
}

/// Further remarks, to be put behind a sentence.
pub(super) fn also(remarks: &[String]) -> String {
    remarks.iter().map(|remark| format!("; {remark}")).collect()
}

/// What is left to say at the end.
pub(super) fn closing(segmenter: &Segmenter, found: u64, config: &still::Config) -> Vec<(Level, String)> {
    let mut said = Vec::new();
    said.extend(never_still(segmenter, found, config).map(|text| (Level::Warning, text)));
    if segmenter.dropped() > 0 {
        let text = format!("{} samples with repeated or backward stamps were dropped", segmenter.dropped());
        said.push((Level::Warning, text));
    }
    if segmenter.breaks() > 0 {
        let text = format!("the stamps jumped {} times; no rest was carried across", segmenter.breaks());
        said.push((Level::Warning, text));
    }
    said
}

/// Parameters that the configuration's bounds hold back.
pub(super) fn active_bounds(fit: &Estimate) -> Vec<String> {
    let terms = fit.active.iter().filter_map(|&i| fit.shape.terms().get(i));
    terms.map(|term| format!("{} is held back by its bound: check fit.bounds", parameter(*term))).collect()
}

/// Why richer models than that of the accelerometer are none.
pub(super) fn refused(solution: &Solution) -> Vec<String> {
    let line = |(shape, why): &(Shape, String)| format!("{} is not determined: {why}", model(*shape));
    solution.refused.iter().map(line).collect()
}

/// What a model of an accelerometer is called in the configuration.
fn model(shape: Shape) -> &'static str {
    match shape {
        Shape::DIAGONAL => "bias-scale",
        Shape::TRIANGULAR => "triangular",
        Shape::MATRIX => "cross-axis",
        _ => "full",
    }
}

/// What a parameter is called.
fn parameter(term: Term) -> String {
    let axis = |i: usize| ["x", "y", "z"].get(i).copied().unwrap_or("?");
    match term {
        Term::Bias(i) => format!("bias {}", axis(i)),
        Term::Own(row, column) => format!("sensitivity {}{}", axis(row), axis(column)),
        Term::Other(row, column) => format!("sensitivity of {} to the other sensor's {}", axis(row), axis(column)),
        Term::Square(i) => format!("g²-sensitivity {}", axis(i)),
    }
}

/// Noise does not average the rounding out.
pub(super) fn coarse(step: f64) -> String {
    format!("the noise is below half a step of {step:.4} m/s²: rounding may bias every mean, which is in the bars")
}

/// Gravity was not measured; `None` if it was.
pub(super) fn assumed_gravity(gravity: Gravity) -> Option<String> {
    let how = match gravity.source {
        Source::Configured => return None,
        Source::Latitude => "of the latitude: set fit.gravity",
        Source::FixTopic => "of the recorded position: set fit.gravity",
        Source::Standard => "assumed: set fit.gravity or fit.latitude_deg",
    };
    Some(format!("gravity {:.5} ± {:.4} m/s², {how} to sharpen the scale", gravity.value, gravity.std))
}

fn triad(triad: &Triad) -> String {
    let status = triad.status().as_str_name().to_lowercase();
    let vector =
        |v: &Option<Vector3>| v.as_ref().map_or_else(String::new, |v| format!("{:.5} {:.5} {:.5}", v.x, v.y, v.z));
    let scale = if triad.scale.is_some() { format!(", scale {}", vector(&triad.scale)) } else { String::new() };
    format!("{} ({status}) bias {}{scale}", triad.sensor, vector(&triad.bias))
}
