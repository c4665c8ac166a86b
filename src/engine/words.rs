//! What people are told.

use super::Config;
use super::book::Entry;
use super::drift::Drift;
use super::publish::CONFIRMING_REPEATS;
use super::solve::{Missing, Solution};
use crate::fit::{Calibration, Estimate, Gravity, Shape, Source, Term};
use crate::imu::Sensor;
use crate::messages::foxglove::log::Level;
use crate::messages::triad::Status;
use crate::messages::{self, Face, Segment, Triad, Vector3};
use crate::still::{self, Segmenter, State};

/// The operator's next step.
pub(super) fn next_step(faces: &[Face], found: u64, solution: &Solution, status: Status) -> String {
    let missing = faces.iter().filter(|face| face.placements == 0 && solution.accelerometer.is_err());
    let missing: Vec<_> = missing.map(|face| face.name.as_str()).collect();
    match (&solution.missing, &solution.accelerometer) {
        (Missing::Motion, Err(why)) => return format!("no calibration: {why}"),
        (Missing::Direction(unseen), Err(why)) if found > 0 => {
            return format!("{why}. Turn the sensor so that {unseen} points up and let it rest for two seconds");
        }
        _ => {}
    }
    match (missing.as_slice(), &solution.accelerometer, status) {
        ([first, ..], _, _) if found == 0 || missing.len() == faces.len() => {
            format!("put the sensor down with {first} up (any face will do) and let it rest for two seconds")
        }
        ([only], _, _) => format!("turn the sensor so that {only} points up and let it rest for two seconds"),
        ([first, ..], _, _) => format!(
            "still to see: {}. Turn the sensor so that {first} points up and let it rest for two seconds",
            missing.join(", ")
        ),
        ([], Err(why), _) => format!("no calibration: {why}. Repeat the {} faces on a flat, firm surface", faces.len()),
        ([], Ok(_), _) if !solution.doubts.is_empty() => solution.doubts.join("; "),
        ([], Ok(_), _) if solution.drift.is_some() => {
            solution.drift.as_ref().map(Drift::explanation).unwrap_or_default()
        }
        ([], Ok(_), Status::Confirmed) => "done: repeated placements agree".to_owned(),
        ([], Ok(fit), _) => unconfirmed(fit, solution),
    }
}

/// What would confirm a provisional calibration.
fn unconfirmed(fit: &Estimate, solution: &Solution) -> String {
    let repeats = CONFIRMING_REPEATS.saturating_sub(solution.repeats);
    match (fit.shape, repeats) {
        (Shape::FULL_ACCELEROMETER, _) => {
            "the readings follow the reference less evenly than noise would: check its time stamps, and that both are fixed to \
             each other"
                .to_owned()
        }
        (Shape::TRIANGULAR, 0) => {
            "the rests disagree by more than placements do: let it rest in further directions, on a firm surface".to_owned()
        }
        (Shape::TRIANGULAR, 1) => {
            "let it rest in one more direction, so that it can confirm the calibration".to_owned()
        }
        (Shape::TRIANGULAR, _) => {
            format!("let it rest in {repeats} more directions, so that they can confirm the calibration")
        }
        (_, 0) => "repeated placements disagree: place every face once more on a flat, firm surface".to_owned(),
        (_, 1) => "place another face once more, so that repeats can confirm the calibration".to_owned(),
        (_, _) => format!("place any {repeats} faces once more, so that repeats can confirm the calibration"),
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
pub(super) fn published(calibration: &messages::Calibration) -> String {
    let triads = calibration.accelerometer.iter().chain(&calibration.gyroscope).chain(&calibration.secondary);
    let parts: Vec<_> = triads.filter(|triad| triad.status() != Status::Undetermined).map(triad).collect();
    format!("calibration {} from {} rests: {}", calibration.revision, calibration.segments, parts.join("; "))
}

/// That nothing was believed to be a rest, and why; `None` if something was.
pub(super) fn never_still(segmenter: &Segmenter, found: u64, config: &still::Config) -> Option<String> {
    let status = segmenter.status();
    if found > 0 {
        return None;
    }
    if status.state != State::Unknown {
        return Some(format!(
            "never still for {} s: it was quiet for moments only. Put it down, away from what shakes it, and let it rest for \
             two seconds",
            config.min_rest_s
        ));
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

/// What a triad is called.
pub(super) fn sensor(config: &Config, sensor: Sensor) -> &str {
    match sensor {
        Sensor::Accelerometer => "accelerometer",
        Sensor::Gyroscope => "gyroscope",
        Sensor::Secondary(i) => config.secondary.get(i).map_or("secondary", |secondary| &secondary.name),
        Sensor::Reference(_) => "reference",
    }
}

/// What keeps the accelerometer from being calibrated however many faces are shown; `None` if nothing is known to.
pub(super) fn obstacle(solution: &Solution, entries: &[Entry]) -> Option<String> {
    let forbidden = solution.suspicions.iter().find(|s| s.sensor == Sensor::Accelerometer && s.forbids());
    if let Some(suspicion) = forbidden {
        return Some(suspicion.text.clone());
    }
    if entries.iter().any(|entry| entry.verdict.is_accepted()) {
        return None;
    }
    // No rest is any good: the fault of the longest, as a rule that of all.
    let worst = entries.iter().max_by(|a, b| a.seconds.total_cmp(&b.seconds))?;
    let count = entries.len();
    Some(format!("none of {count} rests can be used: {}", worst.verdict.explanation))
}

/// What a magnitude at rest that is not gravity may be.
pub(super) fn not_gravity(read: f64, gravity: f64) -> String {
    let near = |value: f64| (read / value - 1.0).abs() < 0.4;
    let guess = if near(1.0) {
        "it is in g: set accel = { unit = \"g\" }".to_owned()
    } else if read < 0.6 {
        "gravity was removed before it was recorded: record the raw accelerometer instead".to_owned()
    } else if near(100.0 * gravity) {
        "it is in mg or cm/s²: record it in m/s² or g".to_owned()
    } else if read > 20.0 * gravity {
        "are these raw counts of the converter? Record them in m/s² or g".to_owned()
    } else {
        format!("that is {:.2} g: is the full-scale range that its driver assumes the one that is set?", read / gravity)
    };
    format!("reads {read:.3} m/s² at rest, where gravity is {gravity:.2}: {guess}")
}

/// The driver changed a calibration of its own.
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

/// Why a gyroscope has no bias yet, given how many placements it was read in, and how it relaxed in one, if it did.
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

/// Readings that are published twice.
pub(super) fn repeated(share: f64) -> String {
    format!(
        "{:.0} % of the readings repeat the one before exactly: is the topic published twice, or the driver polled faster \
         than the sensor measures?",
        100.0 * share
    )
}

/// A rate that no gyroscope measures.
pub(super) fn too_fast(peak: f64) -> String {
    format!(
        "peaks at {peak:.0} rad/s, faster than any gyroscope measures: it is in deg/s. Set gyro = {{ unit = \"deg/s\" }}"
    )
}

/// It turned too far between rests.
pub(super) fn turned_too_far() -> String {
    "between rests gravity turned as if the rates were in deg/s: set gyro = { unit = \"deg/s\" }".to_owned()
}

/// An axis of the gyroscope that never changes.
pub(super) fn dead_gyroscope(axis: &str) -> String {
    format!("the {axis} axis never changes while the others do: is it dead, or not mapped?")
}

/// A bias that is taken away while the sensor rests.
pub(super) fn relaxing(from: f64, to: f64) -> String {
    format!(
        "its mean relaxes towards zero at rest, from {from:.4} to {to:.4} rad/s: an estimator in the driver removes the \
         bias as it goes. Record the raw rates, or switch it off"
    )
}

/// Signs of the axes under which the gyroscope would explain how gravity turned.
pub(super) fn flipped(signs: &[f64; 3]) -> String {
    let named = |sign: f64| {
        let axes = ["x", "y", "z"].into_iter().zip(signs);
        axes.filter(|(_, other)| **other == sign).map(|(axis, _)| axis).collect::<Vec<_>>().join(", ")
    };
    let cause = match signs.iter().filter(|sign| **sign < 0.0).count() {
        1 => format!("the gyroscope's {} axis is flipped", named(-1.0)),
        2 => {
            let (kept, flipped) = (named(1.0), named(-1.0));
            format!("the accelerometer's {kept} axis is flipped (or the gyroscope's {flipped})")
        }
        _ => "all axes of the gyroscope are flipped".to_owned(),
    };
    format!("{cause}: gravity turns between rests against what the rates say. Correct the sign in the driver")
}

/// The gyroscope does not explain how gravity turned.
pub(super) fn disagreeing(degrees: f64) -> String {
    format!(
        "integrating the rates from rest to rest misses gravity by {degrees:.0}° and no flipped axis explains it: check \
         that its axes are those of the accelerometer, its unit and its time stamps, and that no samples are missing between \
         two poses"
    )
}

/// A reading that the sensor cannot give.
pub(super) fn beyond_range(peak: f64, range: f64) -> String {
    format!(
        "reads {peak:.0} m/s², beyond the {range:.0} m/s² that its preset can measure: is the preset the right one, and the \
         unit m/s²?"
    )
}

/// The accelerometer spans far more than gravity.
pub(super) fn stretched(times: f64) -> String {
    format!(
        "an axis spans {times:.2} times gravity from face to face: is the full-scale range that its driver assumes the one \
         that is set?"
    )
}

/// The first rest reads −g on z.
pub(super) fn inverted() -> String {
    "the first rest reads −g on z. In an FRD frame it should; if yours has z up, every axis has the wrong sign, which \
     rests cannot tell. The calibration holds for the readings as they are"
        .to_owned()
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

/// Parameters that the configuration's bounds hold back.
pub(super) fn active_bounds(fit: &Estimate) -> Vec<String> {
    let terms = fit.active.iter().filter_map(|&i| fit.shape.terms().get(i));
    terms
        .map(|term| format!("{} is held back by its bound: check fit.bounds and the preset", parameter(*term)))
        .collect()
}

/// Why richer models than that of the accelerometer are none.
pub(super) fn refused(solution: &Solution) -> Vec<String> {
    let line = |(shape, why): &(Shape, String)| format!("{} is not determined: {why}", model(*shape));
    solution.refused.iter().map(line).collect()
}

/// What the bars of an accelerometer rest on, and what speaks against them.
pub(super) fn caveats(solution: &Solution, fit: &Estimate, placement_std: f64) -> Vec<String> {
    let mut caveats = solution.doubts.clone();
    caveats.extend(solution.drift.as_ref().map(Drift::explanation));
    if fit.chi2_per_dof.is_none() {
        let seen = match fit.shape {
            Shape::DIAGONAL | Shape::MATRIX => "with each face seen once",
            _ => "with as many placements as unknowns",
        };
        let repeat = match fit.shape {
            Shape::DIAGONAL | Shape::MATRIX => "Place every face twice, and it would be named and left out",
            _ => "Further ones would name it",
        };
        caveats.push(format!(
            "{seen} a wrong one does not show, and the bars do not allow for it: they take placements to repeat within \
             {placement_std} m/s² (fit.placement_std, or the preset's). {repeat}"
        ));
    }
    if fit.shape == Shape::DIAGONAL {
        caveats.push(format!(
            "worst_case_error allows for cross-axis sensitivity, ± {:.1} % an entry, which faces cannot tell from tilt",
            100.0 * fit.unmodelled_std
        ));
    }
    caveats
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

/// That the fit is the identity within its bars.
pub(super) fn residual(fit: &Estimate) -> Option<String> {
    /// So many standard deviations hold all parameters of a corrected sensor nine times in ten.
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

/// Noise does not average the rounding out.
pub(super) fn coarse(step: f64) -> String {
    format!("the noise is below half a step of {step:.4} m/s²: rounding may bias every mean, which is in the bars")
}

/// What is taken for gravity, and how that bears on the scale.
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
    format!("gravity {:.5} ± {:.4} m/s², {how} to sharpen the scale", gravity.value, gravity.std)
}

fn triad(triad: &Triad) -> String {
    let status = triad.status().as_str_name().to_lowercase();
    let vector =
        |v: &Option<Vector3>| v.as_ref().map_or_else(String::new, |v| format!("{:.5} {:.5} {:.5}", v.x, v.y, v.z));
    let scale = if triad.scale.is_some() { format!(", scale {}", vector(&triad.scale)) } else { String::new() };
    format!("{} ({status}) bias {}{scale}", triad.sensor, vector(&triad.bias))
}
