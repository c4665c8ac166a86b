//! Refit of an engine over rests and turns that were found before, in any recording: the basis of merging. What only samples
//! show, such as the converter's step and the noise floor, is not known here.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::change_gate::ChangeGate;
use super::config::Config;
use super::noise::Noise;
use super::session::Session;
use super::solution::Solution;
use super::{guidance, partial_session, publication, solve};
use crate::fit::turn_fit::{Told, TurnSeen};
use crate::fit::{Estimate, Gravity, Parameterisation, Term};
use crate::imu::Sensor;
use crate::messages::{Calibration, Combination, Coverage, Segment, TriadMean as MeanMessage};
use crate::still::{AllanSums, ReadingRange, Rest, Sketch, TriadMean};
use crate::{Stamp, messages};

/// Result of a refit over rests of several recordings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Refitted {
    /// Rests in the order given, with the verdicts of this fit.
    pub segments: Vec<Segment>,
    /// Coverage: the faces seen, and the next step.
    pub coverage: Coverage,
    /// Calibration, if anything is determined.
    pub calibration: Option<Calibration>,
}

/// Parameters of a triad at the time that the calibration is for, from a model in which they move.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// Values in the order of [`Parameterisation::TRIANGULAR`], or the bias alone.
    pub parameters: DVector<f64>,
    /// Covariance of the values, without the uncertainty of gravity.
    pub covariance: DMatrix<f64>,
    /// What each value walks over the whole time, one standard deviation.
    pub walked: DVector<f64>,
    /// Note for the calibration.
    pub note: String,
}

/// Replacements for the estimates of triads that move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Replacement for the primary accelerometer.
    pub accelerometer: Option<Moved>,
    /// Replacement for the gyroscope's bias.
    pub gyroscope: Option<Moved>,
}

/// Gravity that such a fit uses.
pub fn gravity(config: &Config) -> Gravity {
    solve::gravity(&config.fit, None)
}

/// Judges and fits rests as if one engine had found them all, and the turns between them, whose rests are given by
/// their indices. Placements are distinguished by their numbers.
pub fn refit(
    rests: impl IntoIterator<Item = Rest>,
    turns: &[TurnSeen],
    noise: BTreeMap<Sensor, AllanSums>,
    motion: &Motion,
    config: Config,
) -> Refitted {
    let mut session = Session::new(config);
    session.noise = Noise::of(noise);
    rests.into_iter().for_each(|rest| session.history.add(rest));
    let mut solution = session.solve(None, turns);
    let moved = motion.replace(&mut solution);
    if let Some(courses) = &mut solution.temperature {
        // A bias that is that of a time is not that of a temperature.
        courses.give_up(moved.map(|moved| moved.is_some()));
    }
    let Session { config, fixture, history, noise, .. } = &session;
    let stamp = history.entries().iter().map(|entry| entry.rest.end).max().unwrap_or_default();
    let header = publication::header(stamp, &config.frame_id);
    let segment = |entry| publication::segment(header.clone(), entry, config, fixture);
    let segments = history.entries().iter().map(segment).collect();
    let obstacle = guidance::obstacle(config, &solution, history.entries(), fixture);
    let coverage = publication::coverage(header.clone(), history, (config, fixture), &solution, obstacle);
    let mut calibration = publication::calibration(header, history, config, &solution);
    for (moved, triad) in moved.into_iter().zip([&mut calibration.accelerometer, &mut calibration.gyroscope]) {
        if let (Some(moved), Some(triad)) = (moved, triad) {
            triad.notes.push(moved.note.clone());
        }
    }
    let mut gate = ChangeGate::default();
    let round = gate.round(history, fixture, config.fit.refit);
    let mut calibration = gate.calibration(calibration, true, round);
    if let Some(calibration) = &mut calibration {
        noise.describe(calibration);
    }
    Refitted { segments, coverage, calibration }
}

impl Motion {
    /// Replaces the estimates of accelerometer and gyroscope, and returns by what. What the turns show of the
    /// accelerometer's off-diagonal entries is joined to its values: those do not move, whereas bias and scale were others at
    /// each of the turns. Of the gyroscope they show the sensitivity, which does not move.
    pub(super) fn replace(&self, solution: &mut Solution) -> [Option<&Moved>; 2] {
        let turning = solution.turning.as_ref();
        let found = turning.and_then(|turning| turning.found.as_ref().ok());
        let told = found.filter(|_| turning.is_some_and(|turning| turning.completed));
        let told = told.map(|found| Told::from(&found.off_diagonals));
        let mut moved = [None; 2];
        if let (Some(accelerometer), Ok(fit)) = (&self.accelerometer, &mut solution.accelerometer) {
            let joined = told.and_then(|told| accelerometer.joined(&told));
            joined.as_ref().unwrap_or(accelerometer).replace(fit, Some(solution.gravity));
            moved[0] = Some(accelerometer);
        }
        if let (Some(accelerometer), Err(_), Ok(known)) =
            (&self.accelerometer, &solution.accelerometer, &mut solution.partial.accelerometer)
        {
            known.iter_mut().for_each(|known| accelerometer.restate(known, solution.gravity));
        }
        if let (Some(gyroscope), Some(bias), Some(fit)) =
            (&self.gyroscope, &mut solution.gyro_at_rest, &mut solution.gyroscope)
            && bias.shape == Parameterisation::BIAS
        {
            gyroscope.replace(bias, None);
            *fit = found.map_or_else(|| bias.clone(), |found| found.with_bias(bias));
            moved[1] = Some(gyroscope);
        }
        moved
    }
}

impl Moved {
    /// Joins what turns show of an accelerometer, which is independent of its rests.
    fn joined(&self, told: &Told) -> Option<Self> {
        let count = Parameterisation::TRIANGULAR.unknowns();
        if self.parameters.len() != count || self.covariance.shape() != (count, count) {
            return None;
        }
        let own = self.covariance.clone().try_inverse()?;
        let (more, moment) = (&told.information, &told.moment);
        let information = DMatrix::from_fn(count, count, |i, j| own[(i, j)] + more[(i, j)]);
        let covariance = information.cholesky()?.inverse();
        let moment = own * &self.parameters + DVector::from_column_slice(moment.as_slice());
        Some(Self {
            parameters: &covariance * moment,
            covariance,
            walked: self.walked.clone(),
            note: self.note.clone(),
        })
    }

    /// Restates a combination of parameters that move. Where their values do not determine it, as where it comes from how
    /// level faces lie, it may have walked.
    fn restate(&self, known: &mut Combination, gravity: Gravity) {
        let (order, all) = (Parameterisation::TRIANGULAR, Parameterisation::MATRIX);
        if self.parameters.len() != order.unknowns() {
            return;
        }
        let coefficient = |term: &Term| {
            let at = all.terms().iter().position(|other| other == term);
            at.and_then(|at| known.coefficients.get(at)).copied().unwrap_or(0.0)
        };
        let coefficients = DVector::from_iterator(order.unknowns(), order.terms().iter().map(coefficient));
        let std = coefficients.dot(&(&self.covariance * &coefficients)).max(0.0).sqrt();
        let scale = coefficients.rows(3, order.unknowns() - 3).norm();
        let std = libm::hypot(std, scale * gravity.std / gravity.value);
        let walked = coefficients.component_mul(&self.walked).norm();
        // Values that the lengths of readings determine; what the rests leave open else stays in the interval.
        if std < 3.0 * libm::hypot(known.std, walked) {
            known.value = coefficients.dot(&self.parameters);
            known.std = known.std.max(std);
        } else {
            known.std = libm::hypot(known.std, walked);
        }
        known.explanation = partial_session::text(&known.coefficients, known.value, known.std);
    }

    /// Replaces the values of an estimate with the same parameters, or fewer.
    fn replace(&self, fit: &mut Estimate, gravity: Option<Gravity>) {
        let order = match self.parameters.len() {
            3 => Parameterisation::BIAS,
            _ => Parameterisation::TRIANGULAR,
        };
        let place = |term: &Term| order.terms().iter().position(|known| known == term);
        let Some(places) = fit.shape.terms().iter().map(place).collect::<Option<Vec<_>>>() else { return };
        if self.parameters.len() != order.unknowns() || self.covariance.shape() != (order.unknowns(), order.unknowns())
        {
            return;
        }
        fit.parameters = DVector::from_iterator(places.len(), places.iter().map(|&at| self.parameters[at]));
        fit.covariance = DMatrix::from_fn(places.len(), places.len(), |i, j| self.covariance[(places[i], places[j])]);
        if let Some(gravity) = gravity {
            let mut by_gravity = &fit.parameters / gravity.value;
            by_gravity.fixed_rows_mut::<3>(0).fill(0.0);
            fit.covariance += &by_gravity * by_gravity.transpose() * gravity.std.powi(2);
        }
    }
}

/// Rest of a segment, without its secondary accelerometers, and those by name. `None` if its values are no readings.
pub fn rest_of(segment: &Segment) -> Option<(Rest, BTreeMap<String, TriadMean>)> {
    let (start, end) = (stamp(&segment.start)?, stamp(&segment.end)?);
    let (mut accelerometer, mut gyroscope, mut secondary) = (None, None, BTreeMap::new());
    for mean in &segment.means {
        match mean.sensor.as_str() {
            "accelerometer" => accelerometer = mean_of(mean),
            "gyroscope" => gyroscope = mean_of(mean),
            name => secondary.extend(mean_of(mean).map(|mean| (name.to_owned(), mean))),
        }
    }
    let (placement, crept) = (segment.placement, false);
    let temperature = segment.temperature.filter(|temperature| temperature.is_finite());
    let (accelerometer, others) = (accelerometer?, Vec::new());
    let rest = Rest { start, end, placement, crept, accelerometer, gyroscope, secondary: others, temperature };
    (start <= end).then_some((rest, secondary))
}

/// Stamp of a message, if it can be one.
pub(super) fn stamp(time: &Option<prost_types::Timestamp>) -> Option<Stamp> {
    let time = time.as_ref()?;
    Some(Stamp::from_nanos(time.seconds.checked_mul(1_000_000_000)?.checked_add(time.nanos.into())?))
}

fn mean_of(message: &MeanMessage) -> Option<TriadMean> {
    /// Largest reading of any sensor, in either unit.
    const MOST: f64 = 1e6;
    let vector = |v: &messages::Vector3| Vector3::new(v.x, v.y, v.z);
    let mean = vector(message.mean.as_ref()?);
    let covariance = match message.covariance.len() {
        9 => Matrix3::from_row_slice(&message.covariance),
        _ => Matrix3::from_diagonal(&vector(message.std.as_ref()?).map(|std| std * std)),
    };
    let effective = message.effective_samples;
    let sound = mean.iter().all(|value| value.abs() <= MOST)
        && covariance.iter().all(|value| value.abs() <= MOST * MOST)
        && covariance.diagonal().iter().all(|variance| *variance >= 0.0)
        && effective > 0.0
        && effective.is_finite()
        && message.samples > 0;
    sound.then(|| TriadMean {
        samples: message.samples,
        effective,
        mean,
        covariance,
        trend: Vector3::zeros(),
        trend_noise: 0.0,
        ends: [mean; 2],
        extremes: ReadingRange::of(&mean),
        clipped: 0,
        sketch: Sketch::default(),
    })
}
