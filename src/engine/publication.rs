//! Messages on the results of an engine. [`ChangeGate`](super::change_gate::ChangeGate) selects those that are
//! published.

use nalgebra::{Matrix3, Vector3};

use super::config::{Config, Secondary};
use super::fault::FaultKind;
use super::guidance;
use super::next_step;
use super::refusal::held_back;
use super::rest_history::{JudgedRest, RestHistory};
use super::solution::Solution;
use super::{status, temperature, units};
use crate::Stamp;
use crate::fit::{Estimate, Fixture, Parameterisation, Term};
use crate::imu::Sensor;
use crate::messages::triad::{Model, Status};
use crate::messages::{self, Triad};
use crate::still::TriadMean;

pub(super) fn header(stamp: Stamp, frame_id: &str) -> messages::Header {
    messages::Header { stamp: Some(stamp.into()), frame_id: frame_id.to_owned() }
}

pub(super) fn segment(
    header: messages::Header,
    entry: &JudgedRest,
    config: &Config,
    fixture: &Fixture,
) -> messages::Segment {
    let JudgedRest { rest, verdict, .. } = entry;
    let secondary = rest.secondary.iter().zip(&config.secondary);
    let means = std::iter::once(("accelerometer", &rest.accelerometer))
        .chain(rest.gyroscope.as_ref().map(|mean| ("gyroscope", mean)))
        .chain(secondary.filter_map(|(mean, secondary)| Some((secondary.name.as_str(), mean.as_ref()?))));
    let face = verdict.face.and_then(|(face, _)| fixture.faces().get(face));
    messages::Segment {
        header: Some(header),
        start: Some(rest.start.into()),
        end: Some(rest.end.into()),
        accepted: verdict.is_accepted(),
        face: face.map(|face| face.name.clone()).unwrap_or_default(),
        tilt_deg: verdict.face.map(|(_, tilt)| tilt),
        reason: verdict.reason.into(),
        explanation: verdict.explanation.clone(),
        means: means.map(|(name, mean)| triad_mean(name, mean)).collect(),
        placement: rest.placement,
        temperature: rest.temperature,
    }
}

pub(super) fn coverage(
    header: messages::Header,
    history: &RestHistory,
    (config, fixture): (&Config, &Fixture),
    solution: &Solution,
    obstacle: Option<String>,
) -> messages::Coverage {
    let faces: Vec<_> = fixture
        .faces()
        .iter()
        .enumerate()
        .map(|(i, face)| {
            // A model that takes any direction accepts rests between the faces, too.
            let is_on = |(face, tilt): (usize, f64)| face == i && tilt <= config.fit.max_tilt_deg;
            let entries = history.entries().iter();
            let on_face = entries.filter(|entry| entry.verdict.is_accepted() && entry.verdict.face.is_some_and(is_on));
            let mut placements: Vec<_> = on_face.clone().map(|entry| entry.rest.placement).collect();
            placements.dedup();
            messages::Face {
                name: face.name.clone(),
                normal: Some(vector(&face.normal)),
                placements: placements.len() as u32,
                // A sum of nothing would be -0.
                seconds: on_face.fold(0.0, |seconds, entry| seconds + entry.seconds),
            }
        })
        .collect();
    // A model that needs no faces makes up for missing ones.
    let complete = solution.accelerometer.is_ok() || faces.iter().all(|face| face.placements > 0);
    let confirmed = status::accelerometer(solution);
    let next_step = obstacle.unwrap_or_else(|| {
        let next = next_step::next_step(&faces, history.found(), solution, confirmed);
        match guidance::misread_rates(config, solution) {
            Some(misread) => format!("{misread}. Then {next}"),
            None => next,
        }
    });
    messages::Coverage { header: Some(header), faces, complete, next_step }
}

pub(super) fn calibration(
    header: messages::Header,
    history: &RestHistory,
    config: &Config,
    solution: &Solution,
) -> messages::Calibration {
    let used = || history.entries().iter().filter(|entry| entry.verdict.is_accepted());
    let temperatures = || used().filter_map(|entry| entry.rest.temperature);
    messages::Calibration {
        header: Some(header),
        revision: 0,
        accelerometer: Some(accelerometer(config, solution)),
        gyroscope: Some(gyroscope(config, solution)),
        secondary: (0..config.secondary.len()).map(|i| secondary(i, config, solution)).collect(),
        gravity: solution.gravity.value,
        gravity_source: solution.gravity.source.name().to_owned(),
        segments: history.accepted() as u32,
        placements: solution.placements as u32,
        begin: used().map(|entry| entry.rest.start).min().map(Into::into),
        end: used().map(|entry| entry.rest.end).max().map(Into::into),
        temperature_min: temperatures().reduce(f64::min),
        temperature_max: temperatures().reduce(f64::max),
    }
}

fn accelerometer(config: &Config, solution: &Solution) -> Triad {
    let named = named("accelerometer", &config.accelerometer);
    let remarks = remarks(solution, Sensor::Accelerometer);
    let fit = match &solution.accelerometer {
        Ok(fit) => fit,
        Err(why) => {
            let why = why.to_string();
            let remarks = remarks.into_iter().filter(|remark| *remark != why);
            let notes = std::iter::once(why.clone()).chain(remarks).chain(guidance::refused(solution));
            let (combinations, against) = match &solution.partial.accelerometer {
                Ok(known) => (known.clone(), None),
                Err(against) => (Vec::new(), Some(against.to_string())),
            };
            return Triad { notes: notes.chain(against).collect(), combinations, ..named };
        }
    };
    let mut notes = held_back(fit);
    notes.extend(guidance::residual(fit));
    notes.extend(remarks);
    notes.extend(guidance::refused(solution));
    notes.extend(guidance::caveats(solution, fit, config.fit.placement_std));
    notes.extend(solution.coarse_step.map(guidance::coarse));
    notes.push(guidance::assumed_gravity(solution.gravity));
    let courses = solution.temperature.as_ref().map(|courses| &courses.accelerometer);
    notes.extend(courses.map(|course| temperature::note(course, true)));
    Triad {
        temperature: courses.and_then(|course| course.as_ref().ok()).map(temperature::model),
        status: status::message(status::accelerometer(solution)).into(),
        worst_case_error: Some(fit.worst_case_error(solution.gravity.value)),
        notes,
        ..estimated(named, fit)
    }
}

fn secondary(index: usize, config: &Config, solution: &Solution) -> Triad {
    let Secondary { name, topic, .. } = config.secondary.get(index).cloned().unwrap_or_default();
    let named = named(&name, &topic);
    let fit = match solution.secondary.get(index) {
        Some(Ok(fit)) => fit,
        Some(Err(why)) => {
            let combinations = solution.partial.secondary.get(index).cloned().unwrap_or_default();
            return Triad { notes: vec![why.to_string()], combinations, ..named };
        }
        None => return named,
    };
    // The secondary follows the primary, and so does the error that a wrong placement could hide there.
    let gravity = solution.gravity.value;
    let hidden = solution.accelerometer.as_ref().map_or(0.0, |primary| primary.hidden_error(gravity));
    Triad {
        status: status::message(status::secondary(solution, fit)).into(),
        worst_case_error: Some(fit.worst_case_error(gravity) + hidden),
        notes: held_back(fit),
        ..estimated(named, fit)
    }
}

fn gyroscope(config: &Config, solution: &Solution) -> Triad {
    let named = named("gyroscope", &config.gyroscope);
    let notes = remarks(solution, Sensor::Gyroscope);
    let Some(fit) = &solution.gyroscope else {
        let silent = (solution.placements > 0 || solution.gyro_refusal.is_some()) && !config.gyroscope.is_empty();
        let note = match &solution.gyro_refusal {
            Some(refusal) => refusal.to_string(),
            None => guidance::no_rates(solution.gyro_placements, solution.gyro_relaxed),
        };
        let note = silent.then_some(note).filter(|_| notes.is_empty());
        return Triad { notes: notes.into_iter().chain(note).collect(), ..named };
    };
    let some_turned = (solution.gyro_turned > 0).then(|| guidance::some_turned(solution.gyro_turned));
    let by_rests = solution.gyro_at_rest.as_ref().unwrap_or(fit);
    let at_rest = status::message(status::gyroscope(solution, by_rests));
    let turned = solution.turning.as_ref().map(|turning| turning.remarks()).unwrap_or_default();
    let unit = config.gyro_unit.unwrap_or_default();
    // Axes that are told to be those of the accelerometer were told by turns that could be followed.
    let is_contradicted = solution.faults.iter().any(|fault| fault.kind == FaultKind::Flipped);
    let unconfirmed = (!solution.unit_confirmed && notes.is_empty() && !is_contradicted && !config.reference)
        .then(|| units::unconfirmed_unit(unit));
    let courses = solution.temperature.as_ref().map(|courses| &courses.gyroscope);
    let warm = courses.map(|course| temperature::note(course, false));
    let notes = held_back(fit).into_iter().chain(notes).chain(some_turned).chain(turned).chain(unconfirmed);
    let notes = notes.chain(warm).chain(guidance::one_scale(solution)).collect();
    let named = Triad { temperature: courses.and_then(|course| course.as_ref().ok()).map(temperature::model), ..named };
    let known = &solution.partial.gyroscope;
    let by_turns = solution.turning.as_ref().and_then(|turning| turning.found.as_ref().ok());
    match (by_turns, &solution.gyro_at_rest) {
        (Some(turns), Some(bias)) if fit.shape != bias.shape => {
            let status = if turns.redundant { at_rest } else { at_rest.min(Status::Provisional) };
            let triad = estimated(named, fit);
            Triad {
                status: status.into(),
                notes,
                model: Model::Turns.into(),
                // Its cross terms are the g-sensitivity.
                g_sensitivity: triad.rate_sensitivity,
                rate_sensitivity: Vec::new(),
                turns: turns.used as u32,
                ..triad
            }
        }
        _ => Triad { status: at_rest.into(), notes, combinations: known.clone(), ..estimated(named, fit) },
    }
}

/// Faults of a triad, as notes.
fn remarks(solution: &Solution, sensor: Sensor) -> Vec<String> {
    let of_it = solution.faults.iter().filter(|fault| fault.sensor == sensor);
    of_it.map(|fault| fault.text.clone()).collect()
}

fn named(sensor: &str, topic: &str) -> Triad {
    Triad { sensor: sensor.to_owned(), topic: topic.to_owned(), ..Triad::default() }
}

/// Message on the estimate of any triad.
fn estimated(named: Triad, fit: &Estimate) -> Triad {
    let Estimate { shape, parameters, .. } = fit;
    let calibration = fit.calibration();
    let mut bias_std = Vector3::zeros();
    let mut sensitivity_std = Matrix3::zeros();
    for (i, term) in shape.terms().iter().enumerate() {
        match *term {
            Term::Bias(axis) => bias_std[axis] = fit.std(i),
            Term::Own(row, column) => sensitivity_std[(row, column)] = fit.std(i),
            Term::Other(..) | Term::Square(_) => {}
        }
    }
    let cross = shape.cross(parameters).map(|cross| row_major(&cross)).unwrap_or_default();
    let squares = shape.squares(parameters).map(|squares| squares.as_slice().to_vec()).unwrap_or_default();
    let gyroscope = matches!(*shape, Parameterisation::GYROSCOPE_AT_REST | Parameterisation::FULL_GYROSCOPE);
    let (g_sensitivity, rate_sensitivity) = if gyroscope { (cross, Vec::new()) } else { (Vec::new(), cross) };
    let triad = Triad {
        g_sensitivity,
        g2_sensitivity: squares,
        rate_sensitivity,
        model: model(*shape).into(),
        bias: Some(vector(&calibration.bias)),
        bias_std: Some(vector(&bias_std)),
        covariance: fit.covariance.transpose().as_slice().to_vec(),
        residual_rms: Some(fit.residual_rms),
        chi2_per_dof: fit.chi2_per_dof,
        condition: Some(fit.condition),
        placement_std: fit.placement_std.clone(),
        ..named
    };
    if !shape.has(Term::Own(0, 0)) {
        return triad;
    }
    let geometry = Geometry::of(&calibration.sensitivity, fit);
    Triad {
        row_norms: Some(vector(&geometry.norms)),
        row_norms_std: Some(vector(&geometry.norms_std)),
        misalignment: geometry.leans,
        misalignment_std: geometry.leans_std,
        scale: Some(vector(&calibration.sensitivity.diagonal())),
        scale_std: Some(vector(&sensitivity_std.diagonal())),
        sensitivity: row_major(&calibration.sensitivity),
        sensitivity_std: row_major(&sensitivity_std),
        ..triad
    }
}

/// Sensitivity of each axis along its own direction, and the angles by which that leans towards the other axes, rad.
struct Geometry {
    norms: Vector3<f64>,
    norms_std: Vector3<f64>,
    /// Leans of x towards y and z, y towards x and z, z towards x and y.
    leans: Vec<f64>,
    leans_std: Vec<f64>,
}

impl Geometry {
    fn of(sensitivity: &Matrix3<f64>, fit: &Estimate) -> Self {
        // Standard deviation of a function of one row, from its gradient.
        let std = |row: usize, gradient: Vector3<f64>| {
            let terms = fit.shape.terms();
            let slopes = terms.iter().map(|term| match *term {
                Term::Own(i, column) if i == row => gradient[column],
                _ => 0.0,
            });
            let slopes: Vec<_> = slopes.collect();
            let variance = slopes.iter().enumerate().map(|(i, one)| {
                one * slopes.iter().enumerate().map(|(j, other)| fit.covariance[(i, j)] * other).sum::<f64>()
            });
            variance.sum::<f64>().max(0.0).sqrt()
        };
        let (mut norms, mut norms_std) = (Vector3::zeros(), Vector3::zeros());
        let (mut leans, mut leans_std) = (Vec::with_capacity(6), Vec::with_capacity(6));
        for row in 0..3 {
            let entries = sensitivity.row(row).transpose();
            norms[row] = entries.norm();
            norms_std[row] = std(row, entries / norms[row].max(f64::MIN_POSITIVE));
            for towards in (0..3).filter(|column| *column != row) {
                let (along, across) = (entries[row], entries[towards]);
                leans.push(libm::atan2(across, along));
                let mut gradient = Vector3::zeros();
                let square = (along * along + across * across).max(f64::MIN_POSITIVE);
                gradient[row] = -across / square;
                gradient[towards] = along / square;
                leans_std.push(std(row, gradient));
            }
        }
        Self { norms, norms_std, leans, leans_std }
    }
}

/// Name of a shape in the messages.
fn model(shape: Parameterisation) -> Model {
    match shape {
        Parameterisation::BIAS => Model::Bias,
        Parameterisation::DIAGONAL => Model::BiasScale,
        Parameterisation::TRIANGULAR => Model::Triangular,
        Parameterisation::MATRIX | Parameterisation::GYROSCOPE_AT_REST => Model::CrossAxis,
        _ => Model::Full,
    }
}

fn triad_mean(sensor: &str, mean: &TriadMean) -> messages::TriadMean {
    messages::TriadMean {
        sensor: sensor.to_owned(),
        samples: mean.samples,
        effective_samples: mean.effective,
        mean: Some(vector(&mean.mean)),
        covariance: row_major(&mean.covariance),
        std: Some(vector(&mean.std())),
    }
}

pub(super) fn vector(v: &Vector3<f64>) -> messages::Vector3 {
    messages::Vector3 { x: v.x, y: v.y, z: v.z }
}

fn row_major(matrix: &Matrix3<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}
