//! Guidance for the operator: notes and log lines.

use nalgebra::{Matrix3, Rotation3, Vector3 as Direction};

use super::config::Config;
use super::drift::Drift;
use super::fault::{Fault, FaultKind};
use super::next_step::seconds;
use super::refusal::Refusal;
use super::rest_history::JudgedRest;
use super::solution::Solution;
use crate::fit::{Calibration, Estimate, Fixture, Gravity, Parameterisation, Source};
use crate::imu::Sensor;
use crate::messages::foxglove::log::Level;
use crate::messages::segment::Reason;
use crate::messages::triad::Status;
use crate::messages::{self, Segment, Triad, Vector3};
use crate::plural::counted;
use crate::still::{self, Segmenter, State};

/// Note that rests were left out of a gyroscope's bias as turns.
pub(super) fn some_turned(count: usize) -> String {
    let rests = counted(count as u64, "rest");
    format!("{rests} turned at a constant rate and left out: let it rest where nothing turns to confirm its bias")
}

/// Log line on a rest that did not enter the fit.
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

/// Log line on a published calibration.
pub(super) fn published(calibration: &messages::Calibration) -> String {
    let triads = calibration.accelerometer.iter().chain(&calibration.gyroscope).chain(&calibration.secondary);
    let parts: Vec<_> = triads.filter_map(triad).collect();
    format!("calibration {} from {} rests: {}", calibration.revision, calibration.segments, parts.join("; "))
}

/// Text on why nothing was accepted as a rest; `None` if something was.
pub(super) fn never_still(segmenter: &Segmenter, found: u64, config: &still::Config) -> Option<String> {
    let status = segmenter.status();
    if found > 0 {
        return None;
    }
    if status.state != State::Unknown {
        return Some(format!(
            "never still for {} s: it was quiet for moments only. Put it down, away from what shakes it, and let it rest for {}",
            config.min_rest_s,
            seconds(segmenter.hold_s())
        ));
    }
    let level = |floor: Option<f64>| floor.map(|floor| floor / 3_f64.sqrt());
    let (accel, gyro) = (level(status.accel_floor), level(status.gyro_floor));
    let known = [(accel, "m/s²", config.accel_ceiling), (gyro, "rad/s", config.gyro_ceiling)];
    let known = || known.into_iter().filter_map(|(level, unit, most)| Some((level?, unit, most)));
    let quietest: Vec<_> = known().map(|(level, unit, _)| format!("{level:.3} {unit}")).collect();
    let credible: Vec<_> = known().map(|(.., most)| most.to_string()).collect();
    Some(match quietest.as_slice() {
        [] => "never seen still: the readings are too few to tell what is quiet. Let the sensor rest for some seconds"
            .to_owned(),
        quietest => format!(
            "never seen still: the quietest was {} per axis, credible {} {}. Let the sensor rest for {}, or raise \
             still.accel_ceiling and still.gyro_ceiling if it vibrates by nature",
            quietest.join(" and "),
            if credible.len() == 1 { "is" } else { "are" },
            credible.join(" and "),
            seconds(segmenter.hold_s())
        ),
    })
}

/// Text on readings in another unit or of several sensors, because of which nothing seemed still or every rest a turn.
pub(super) fn misread(config: &Config, solution: &Solution) -> Option<String> {
    let faults = solution.faults.iter().filter(|fault| matches!(fault.kind, FaultKind::Unit | FaultKind::Alternating));
    let mut texts: Vec<_> = faults.map(|fault| format!("{}: {}", sensor(config, fault.sensor), fault.text)).collect();
    texts.dedup();
    (!texts.is_empty()).then(|| texts.join("; "))
}

/// Text on a gyroscope in another unit, while nothing is published that says so in a note.
pub(super) fn misread_rates(config: &Config, solution: &Solution) -> Option<String> {
    solution
        .accelerometer
        .is_err()
        .then(|| wrong_unit(solution))?
        .map(|text| format!("{}: {text}", sensor(config, Sensor::Gyroscope)))
}

/// Lays the rests that seem to turn to the unit of the gyroscope, if that is wrong.
pub(super) fn lay_to_unit(entries: &mut [JudgedRest], solution: &Solution) {
    let Some(text) = wrong_unit(solution) else { return };
    for entry in entries {
        let rate = entry.rest.gyroscope.as_ref().map_or(0.0, |mean| mean.mean.norm());
        entry.verdict.lay_to_unit(rate, text);
    }
}

fn wrong_unit(solution: &Solution) -> Option<&str> {
    let is_unit = |fault: &&Fault| fault.kind == FaultKind::Unit && fault.sensor == Sensor::Gyroscope;
    solution.faults.iter().find(is_unit).map(|fault| fault.text.as_str())
}

/// Name of a triad.
pub(super) fn sensor(config: &Config, sensor: Sensor) -> &str {
    match sensor {
        Sensor::Accelerometer => "accelerometer",
        Sensor::Gyroscope => "gyroscope",
        Sensor::Secondary(i) => config.secondary.get(i).map_or("secondary", |secondary| &secondary.name),
        Sensor::Reference(_) => "reference",
    }
}

/// Text on what prevents a calibration of the accelerometer, however many faces are shown; `None` if nothing known
/// does.
pub(super) fn obstacle(
    config: &Config,
    solution: &Solution,
    entries: &[JudgedRest],
    fixture: &Fixture,
) -> Option<String> {
    let none_accepted = !entries.is_empty() && !entries.iter().any(|entry| entry.verdict.is_accepted());
    if let Some(misread) = misread(config, solution).filter(|_| none_accepted) {
        return Some(misread);
    }
    let forbidden = solution.faults.iter().find(|s| s.sensor == Sensor::Accelerometer && s.forbids());
    if let Some(fault) = forbidden {
        return Some(fault.text.clone());
    }
    if solution.accelerometer.is_err()
        && let Some(rejected) = mounted(entries, fixture, solution).or_else(|| out_of_range(entries, solution))
    {
        return Some(rejected);
    }
    if entries.iter().any(|entry| entry.verdict.is_accepted()) {
        return None;
    }
    // No rest can be used: the fault of the longest is mostly that of all.
    let worst = entries.iter().max_by(|a, b| a.seconds.total_cmp(&b.seconds))?;
    let count = entries.len();
    Some(format!("none of {count} rests can be used: {}", worst.verdict.explanation))
}

/// Text on faces whose readings are unusable, however often they are shown again.
fn out_of_range(entries: &[JudgedRest], solution: &Solution) -> Option<String> {
    let wrong = entries.iter().filter(|entry| matches!(entry.verdict.reason, Reason::Saturated | Reason::SensorFault));
    let count = wrong.clone().count();
    let worst = wrong.max_by(|a, b| a.seconds.total_cmp(&b.seconds))?;
    let missing = match &solution.accelerometer {
        Err(Refusal::FacesMissing(faces)) => format!(". Then show {}", faces.join(", ")),
        _ => String::new(),
    };
    Some(format!("{count} of {} rests cannot be used: {}{missing}", entries.len(), worst.verdict.explanation))
}

/// Text on tilted rests that are all askew in the same way: the sensor is not mounted along the axes of its box.
fn mounted(entries: &[JudgedRest], fixture: &Fixture, solution: &Solution) -> Option<String> {
    /// Fewest rests, and largest deviation from the mounting that they agree on, rad.
    const LEAST: usize = 4;
    const NEAR: f64 = 0.1;
    let tilted = entries.iter().filter(|entry| entry.verdict.reason == Reason::Tilted);
    let tilted = tilted.filter_map(|entry| {
        let normal = fixture.faces().get(entry.verdict.face()?)?.normal;
        let up = solution.guessed.correct(&entry.rest.accelerometer.mean).try_normalize(f64::MIN_POSITIVE)?;
        Some((normal, up))
    });
    let tilted: Vec<_> = tilted.collect();
    if tilted.len() < LEAST {
        return None;
    }
    // Rotation that best maps the directions seen onto the faces (Kabsch 1976).
    let product: Matrix3<f64> = tilted.iter().map(|(normal, up)| normal * up.transpose()).sum();
    let svd = product.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?);
    let proper = Direction::new(1.0, 1.0, (u * v).determinant().signum());
    let turned = u * Matrix3::from_diagonal(&proper) * v;
    let plane = svd.singular_values[1] < 0.1 * svd.singular_values[0];
    if plane || tilted.iter().any(|(normal, up)| (turned * up - normal).norm() > NEAR) {
        return None;
    }
    let degrees = Rotation3::from_matrix_unchecked(turned).scaled_axis().map(f64::to_degrees);
    Some(format!(
        "{} rests lie askew in the same way: is the sensor mounted at an angle of {:.0}° in its box? Then say so: \
         fit.fixture.mounting_deg = [{:.1}, {:.1}, {:.1}]",
        tilted.len(),
        degrees.norm(),
        degrees.x,
        degrees.y,
        degrees.z
    ))
}

/// Log line on a change of the driver's own calibration.
pub(super) fn new_round(config: &Config, sensor: Sensor) -> String {
    let name = self::sensor(config, sensor);
    let advice = match sensor {
        Sensor::Accelerometer => "show every face again",
        Sensor::Gyroscope => "let the sensor rest again",
        Sensor::Secondary(_) => "show the faces again",
        Sensor::Reference(_) => "move the sensor again",
    };
    format!("the driver changed its own calibration of the {name}: what it read before no longer counts; {advice}")
}

/// Note on why a gyroscope has no bias yet, from the number of its placements and its relaxation in one, if any.
pub(super) fn no_rates(placements: usize, relaxed: Option<(f64, f64)>) -> String {
    match (placements, relaxed) {
        (0, Some((from, to))) => format!(
            "its mean went from {from:.4} to {to:.4} rad/s while it rested: a motion that ended slowly, or an estimator in the \
             driver that removes the bias. Let it rest once more"
        ),
        (0, None) => "was silent during every rest: check its topic and its time stamps".to_owned(),
        _ => "the rests so far are too short together to tell its bias from a slow turn: let it rest longer".to_owned(),
    }
}

/// Log lines at the end of a recording.
pub(super) fn closing(segmenter: &Segmenter, found: u64, config: &still::Config) -> Vec<(Level, String)> {
    let mut said = Vec::new();
    said.extend(never_still(segmenter, found, config).map(|text| (Level::Warning, text)));
    if segmenter.dropped() > 0 {
        let read = [Sensor::Accelerometer, Sensor::Gyroscope].into_iter().filter_map(|sensor| segmenter.signal(sensor));
        let share = segmenter.dropped() as f64 / (segmenter.dropped() + read.map(|s| s.readings).sum::<u64>()) as f64;
        let twice = if share > 0.2 { ": is the topic published twice?" } else { "" };
        let text = format!(
            "{} samples ({:.0} %) with repeated or backward stamps were dropped{twice}",
            segmenter.dropped(),
            100.0 * share
        );
        said.push((Level::Warning, text));
    }
    if segmenter.breaks() > 0 {
        let text = format!("the stamps jumped {} times; no rest was carried across", segmenter.breaks());
        said.push((Level::Warning, text));
    }
    said
}

/// Log line on samples that are no readings.
pub(super) fn unread(sensor: &str, count: u64) -> String {
    let samples = counted(count, "sample");
    format!("{sensor}: {samples} of NaN, infinity or beyond what any sensor reads are left out")
}

/// Notes on why richer models than the accelerometer's were refused.
pub(super) fn refused(solution: &Solution) -> Vec<String> {
    let line = |(shape, why): &(Parameterisation, Refusal)| format!("{} is not determined: {why}", shape.name());
    solution.refused.iter().map(line).collect()
}

/// Notes on what the bars of an accelerometer depend on, and what contradicts them.
pub(super) fn caveats(solution: &Solution, fit: &Estimate, placement_std: f64) -> Vec<String> {
    let mut caveats = solution.doubts.clone();
    caveats.extend(solution.drift.as_ref().map(Drift::explanation));
    if fit.chi2_per_dof.is_none() {
        let seen = match fit.shape {
            Parameterisation::DIAGONAL | Parameterisation::MATRIX => "with each face seen once",
            _ => "with as many placements as unknowns",
        };
        let repeat = match fit.shape {
            Parameterisation::DIAGONAL | Parameterisation::MATRIX => {
                "Place every face twice, and it would be named and left out"
            }
            _ => "Further ones would name it",
        };
        caveats.push(format!(
            "{seen} a wrong one does not show, and the bars do not allow for it: they take placements to repeat within \
             {placement_std} m/s² (fit.placement_std, or the preset's). {repeat}"
        ));
    }
    if fit.shape == Parameterisation::DIAGONAL {
        caveats.push(format!(
            "worst_case_error allows for cross-axis sensitivity, ± {:.1} % an entry, which faces cannot tell from tilt",
            100.0 * fit.unmodelled_std
        ));
    }
    caveats
}

/// Note that the fit is the identity within its bars, if it is.
pub(super) fn residual(fit: &Estimate) -> Option<String> {
    /// Standard deviations that hold all parameters of a corrected sensor nine times in ten.
    const WITHIN: f64 = 2.4;
    let identity = fit.shape.vector(&Calibration::default());
    let off = &fit.parameters - identity;
    let within = off.iter().enumerate().all(|(i, off)| off.abs() <= WITHIN * fit.std(i));
    within.then(|| {
        "no correction within its bars: the readings are corrected already, and this is a residual calibration, not the \
         raw sensor's"
            .to_owned()
    })
}

/// Note that noise does not average out the rounding.
pub(super) fn coarse(step: f64) -> String {
    format!("the noise is below half a step of {step:.4} m/s²: rounding may bias every mean, which is in the bars")
}

/// Note that turns about the vertical leave the rest of a gyroscope's sensitivity open. Beside an accelerometer that is
/// calibrated, the fit to the turns says it.
pub(super) fn one_scale(solution: &Solution) -> Option<String> {
    let alone = solution.turning.is_none() && !solution.partial.gyroscope.is_empty();
    let text =
        "turns about the vertical show one scale alone: for all of its sensitivity, turn it over, from face to face";
    alone.then(|| text.to_owned())
}

/// Note on the gravity assumed, and its effect on the scale.
pub(super) fn assumed_gravity(gravity: Gravity) -> String {
    let how = match gravity.source {
        Source::Configured => {
            return format!(
                "gravity {:.5} m/s² as configured, taken as exact: what it is off by is in the scale",
                gravity.value
            );
        }
        Source::Latitude => "of the latitude: set fit.gravity",
        Source::FixTopic => "of the recorded position: set fit.gravity",
        Source::Standard => "assumed: set fit.gravity or fit.latitude_deg",
    };
    format!("gravity {:.5} ± {:.4} m/s², {how} to sharpen the scale", gravity.value, gravity.half_interval())
}

fn triad(triad: &Triad) -> Option<String> {
    let known: Vec<_> = triad.combinations.iter().map(|known| known.explanation.as_str()).collect();
    if triad.status() == Status::Undetermined {
        return (!known.is_empty()).then(|| format!("{} in part, {}", triad.sensor, known.join(", ")));
    }
    let status = triad.status().as_str_name().to_lowercase();
    let vector =
        |v: &Option<Vector3>| v.as_ref().map_or_else(String::new, |v| format!("{:.5} {:.5} {:.5}", v.x, v.y, v.z));
    let scale = if triad.scale.is_some() { format!(", scale {}", vector(&triad.scale)) } else { String::new() };
    Some(format!("{} ({status}) bias {}{scale}", triad.sensor, vector(&triad.bias)))
}
