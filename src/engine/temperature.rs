//! Dependence of the biases on the temperature, and the rests as they would have read at one temperature.
//!
//! The temperature of reference is that of the latest rest: a reader who knows nothing of temperatures then has the bias
//! of the sensor as it was last, and the intervals are those of that bias.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Vector3};

use super::config::Config;
use super::fit_inputs::FitInputs;
use super::model_trial::{Trial, assumptions};
use super::observations;
use super::rest_history::JudgedRest;
use super::rest_judge::{Judge, Poses};
use super::solution::Solution;
use super::temperature_courses::TemperatureCourses;
use crate::Stamp;
use crate::fit::temperature::{self, Between, BiasCourse, LengthEquation, Unclear, WarmReading};
use crate::fit::{Estimate, Parameterisation, Term};
use crate::messages::TemperatureModel;
use crate::messages::segment::Reason;
use crate::still::{Rest, TriadMean};

/// Longest time between a rest without temperature and the one whose temperature it is taken to have, s.
const NEAR: f64 = 60.0;
/// Scatter of the rests of a placement, as a share of that of placements, until they show it.
const WITHIN: f64 = 0.1;

/// Learns how the biases depend on the temperature from rests that were judged and fitted without; `None` if there is no
/// temperature, or nothing is to be learned from it.
pub(super) fn learn(
    entries: &[JudgedRest],
    solution: &Solution,
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
    config: &Config,
) -> Option<TemperatureCourses> {
    let most = config.fit.temperature.most();
    let last = entries.iter().rev().find_map(|entry| entry.rest.temperature.filter(|_| entry.verdict.is_at_rest()));
    let reference = last.filter(|_| most > 0 && inputs.reference.is_none())?;
    let celsius = match temperatures(entries) {
        Ok(celsius) => celsius,
        Err(gaps) => return Some(TemperatureCourses { accelerometer: Err(gaps), gyroscope: Err(gaps) }),
    };
    let noise = observations::gyroscope_noise(judge.segmenter);
    let rates = readings(entries, &celsius, |entry| {
        entry.rest.gyroscope.as_ref().filter(|_| observations::tells_of_rates(entry, noise))
    });
    let still =
        |entry: &JudgedRest| matches!(entry.verdict.reason, Reason::Accepted | Reason::Tilted | Reason::Outlier);
    let forces = readings(entries, &celsius, |entry| Some(&entry.rest.accelerometer).filter(|_| still(entry)));
    let lengths = lengths(entries, &celsius, solution, judge, inputs);
    let scatter = |between: f64| [WITHIN * between, between];
    Some(TemperatureCourses {
        accelerometer: temperature::learn(
            &forces,
            Between::Lengths(&lengths),
            most,
            scatter(config.fit.placement_std),
            reference,
        ),
        gyroscope: temperature::learn(&rates, Between::Readings, most, scatter(config.fit.rate_std), reference),
    })
}

/// Temperature of each rest; one without has that of the rest nearest in time.
fn temperatures(entries: &[JudgedRest]) -> Result<Vec<f64>, Unclear> {
    let known: Vec<_> = entries.iter().filter_map(|entry| Some((&entry.rest, entry.rest.temperature?))).collect();
    let apart = |one: &Rest, other: &Rest| one.start.seconds_since(other.end).max(other.start.seconds_since(one.end));
    let near = |rest: &Rest| {
        let nearest = known.iter().min_by(|(a, _), (b, _)| apart(a, rest).total_cmp(&apart(b, rest)))?;
        (apart(nearest.0, rest) <= NEAR).then_some(nearest.1)
    };
    let celsius: Vec<_> = entries.iter().map(|entry| entry.rest.temperature.or_else(|| near(&entry.rest))).collect();
    let without =
        celsius.iter().zip(entries).filter(|(celsius, entry)| celsius.is_none() && entry.verdict.is_at_rest());
    match without.count() {
        0 => Ok(celsius.into_iter().map(Option::unwrap_or_default).collect()),
        without => {
            let of = entries.iter().filter(|entry| entry.verdict.is_at_rest()).count();
            Err(Unclear::Gaps { without, of })
        }
    }
}

fn readings<'a>(
    entries: &'a [JudgedRest],
    celsius: &[f64],
    mean: impl Fn(&'a JudgedRest) -> Option<&'a TriadMean>,
) -> Vec<WarmReading> {
    let first = first(entries);
    let of = |(entry, celsius): (&'a JudgedRest, &f64)| {
        let mean = mean(entry)?;
        Some(WarmReading {
            placement: entry.rest.placement,
            time: middle(&entry.rest, first),
            celsius: *celsius,
            mean: mean.mean,
            noise: mean.mean_variance(),
        })
    };
    entries.iter().zip(celsius).filter_map(of).collect()
}

fn first(entries: &[JudgedRest]) -> Stamp {
    entries.iter().map(|entry| entry.rest.start).min().unwrap_or_default()
}

/// Middle of a rest, s since the first one.
fn middle(rest: &Rest, first: Stamp) -> f64 {
    rest.start.seconds_since(first) + rest.seconds() / 2.0
}

/// Lengths of the accelerometer's readings by placement, about its calibration as far as it is known.
fn lengths(
    entries: &[JudgedRest],
    celsius: &[f64],
    solution: &Solution,
    judge: &Judge<'_>,
    inputs: &FitInputs<'_>,
) -> Vec<LengthEquation> {
    let fit = solution.accelerometer.as_ref();
    let (shape, calibration) = match fit {
        Ok(fit) => (fit.shape, fit.calibration()),
        Err(_) => (Parameterisation::DIAGONAL, solution.guessed),
    };
    let poses = match shape {
        Parameterisation::TRIANGULAR => Poses::Any,
        Parameterisation::DIAGONAL => Poses::OnFaces,
        _ => return Vec::new(),
    };
    let given = assumptions(judge, &Trial { shape, inputs }, calibration);
    let warm = by_placement(entries, celsius);
    let seen = observations::placements(entries, judge, poses, inputs.step);
    let equation = |placed: &observations::Placed| {
        let (celsius, time) = *warm.get(&placed.observation.placement)?;
        Some(LengthEquation::of(&placed.observation, &given, &calibration, celsius, time))
    };
    seen.iter().filter_map(equation).collect()
}

/// Mean temperature and time of the accepted rests of each placement, weighted as their readings are.
fn by_placement(entries: &[JudgedRest], celsius: &[f64]) -> BTreeMap<u32, (f64, f64)> {
    let first = first(entries);
    let mut sums: BTreeMap<u32, (f64, f64, f64)> = BTreeMap::new();
    for (entry, celsius) in entries.iter().zip(celsius).filter(|(entry, _)| entry.verdict.is_accepted()) {
        let weight = entry.rest.accelerometer.effective;
        let sum = sums.entry(entry.rest.placement).or_default();
        sum.0 += weight;
        sum.1 += weight * celsius;
        sum.2 += weight * middle(&entry.rest, first);
    }
    sums.into_iter()
        .map(|(placement, (weight, celsius, time))| (placement, (celsius / weight, time / weight)))
        .collect()
}

/// Judges and fits the rests anew, as they would have read at the temperature of reference, with `solve`.
pub(super) fn at_reference(
    entries: &mut [JudgedRest],
    courses: TemperatureCourses,
    before: Solution,
    solve: impl Fn(&mut [JudgedRest]) -> Solution,
) -> Solution {
    let celsius = match temperatures(entries) {
        Ok(celsius) if courses.accelerometer.is_ok() || courses.gyroscope.is_ok() => celsius,
        _ => return Solution { temperature: Some(courses), ..before },
    };
    let mut steady = entries.to_vec();
    for (JudgedRest { rest, rate_taken_off, .. }, celsius) in steady.iter_mut().zip(&celsius) {
        take_off(&mut rest.accelerometer, &courses.force(Some(*celsius)));
        if let Some(gyroscope) = &mut rest.gyroscope {
            *rate_taken_off = courses.rate(Some(*celsius));
            take_off(gyroscope, rate_taken_off);
        }
    }
    let mut solution = solve(&mut steady);
    entries.iter_mut().zip(steady).for_each(|(entry, steady)| entry.verdict = steady.verdict);
    if let (Ok(course), Ok(fit)) = (&courses.accelerometer, &mut solution.accelerometer) {
        widen(fit, course, entries, &celsius);
    }
    if let Ok(course) = &courses.gyroscope {
        let fits = [&mut solution.gyroscope, &mut solution.gyro_at_rest];
        fits.into_iter().flatten().for_each(|fit| widen(fit, course, entries, &celsius));
    }
    Solution { temperature: Some(courses), ..solution }
}

fn take_off(mean: &mut TriadMean, change: &Vector3<f64>) {
    mean.mean -= change;
    mean.ends.iter_mut().for_each(|end| *end -= change);
}

/// Widens the covariance of a fit by what is uncertain of the temperature's effect on the rests in it.
fn widen(fit: &mut Estimate, course: &BiasCourse, entries: &[JudgedRest], celsius: &[f64]) {
    let placements = by_placement(entries, celsius);
    let mut by_course = DMatrix::zeros(fit.parameters.len(), 3 * course.order());
    match &fit.origin {
        Some(origin) => {
            for (placement, influence) in &origin.influence {
                let Some((celsius, _)) = placements.get(placement) else { continue };
                for (k, power) in course.powers(*celsius).iter().enumerate() {
                    for axis in 0..3 {
                        let mut column = by_course.column_mut(3 * k + axis);
                        column -= influence.column(axis) * *power;
                    }
                }
            }
        }
        // The bias is the mean of the placements.
        None => {
            let count = placements.len().max(1) as f64;
            for (celsius, _) in placements.values() {
                for (k, power) in course.powers(*celsius).iter().enumerate() {
                    for (row, term) in fit.shape.terms().iter().enumerate() {
                        if let Term::Bias(axis) = *term {
                            by_course[(row, 3 * k + axis)] -= power / count;
                        }
                    }
                }
            }
        }
    }
    let more = &by_course * course.covariance() * by_course.transpose();
    fit.covariance += &more;
    if let Some(origin) = &mut fit.origin {
        origin.systematic += more;
    }
}

/// Message on the dependence of a bias on the temperature.
pub(super) fn model(course: &BiasCourse) -> TemperatureModel {
    let list = |values: &[Vector3<f64>]| values.iter().flat_map(|value| <[f64; 3]>::from(*value)).collect();
    TemperatureModel {
        order: course.order() as u32,
        reference: course.reference,
        minimum: course.range[0],
        maximum: course.range[1],
        coefficients: list(&course.coefficients),
        coefficients_std: list(&course.coefficients_std()),
    }
}

/// Note on the bias of a triad: the temperature that it is for, or why it is for all of them.
pub(super) fn note(course: &Result<BiasCourse, Unclear>, accelerometer: bool) -> String {
    let course = match course {
        Ok(course) => course,
        Err(why) => return why.to_string(),
    };
    let (reference, [low, high], order) = (course.reference, course.range, course.order());
    let scale = match accelerometer {
        // At rest nothing tells the two apart.
        true => "; what the temperature does to the scale is in it as far as one face of an axis was seen alone",
        false => "",
    };
    format!(
        "the bias is that at {reference:.1} °C; from {low:.1} to {high:.1} °C a polynomial of order {order} tells it{scale}"
    )
}
