//! Course of the parameters of accelerometer and gyroscope over time, recording by recording: rests as equations in
//! walking parameters, and their estimates.

use nalgebra::{SVector, Vector3};

use super::change_points::{Explained, Jump, Stray, jumps, remove_strays};
use super::past_rest::PastRest;
use super::random_walk::{Averaged, Equation, State, Visit, Walk, span};
use crate::Stamp;
use crate::engine;
use crate::fit::{Calibration, Parameterisation, Term};

/// Bias and lower-triangular sensitivity, in the order of [`Parameterisation::TRIANGULAR`].
pub(super) const UNKNOWNS: usize = 9;

/// Time after which a later rest of the same recording begins a new visit, s.
const LONG: f64 = 3600.0;
/// Threshold of twice the log likelihood ratio; one in a hundred sensors without drift exceeds it.
const DRIFTS: f64 = 6.6;

/// Course of the parameters of one triad.
#[derive(Clone, Debug)]
pub(super) struct Course<const N: usize> {
    /// States by visit.
    pub(super) states: Vec<State<N>>,
    pub(super) jumps: Vec<Jump<N>>,
    /// Starts of rests of which one is a wrong placement, which alone would make a jump.
    pub(super) strays: Vec<Vec<Stamp>>,
    /// Whether the parameters clearly walk between the jumps.
    pub(super) drifts: bool,
    /// Whether a walk is modelled: not within an hour, nor with only two visits or too few equations.
    pub(super) is_followed: bool,
    /// Variance that each parameter walks in a second.
    pub(super) speed: SVector<f64, N>,
}

/// Groups the rests into visits, by their indices.
pub(super) fn visits(rests: &[&PastRest]) -> Vec<Vec<usize>> {
    let mut visits: Vec<Vec<usize>> = Vec::new();
    for (i, past) in rests.iter().enumerate() {
        let same = visits.last().and_then(|visit| rests.get(*visit.first()?)).is_some_and(|first| {
            first.recording == past.recording && past.rest.start.seconds_since(first.rest.start) < LONG
        });
        match visits.last_mut().filter(|_| same) {
            Some(visit) => visit.push(i),
            None => visits.push(vec![i]),
        }
    }
    visits
}

/// Course of the primary accelerometer, from the length of its readings. `hints` are the first visits behind jumps of the
/// gyroscope.
pub(super) fn accelerometer(
    rests: &[&PastRest],
    visits: &[Vec<usize>],
    config: &engine::Config,
    hints: &[usize],
) -> Course<UNKNOWNS> {
    /// Rounds of linearising the equations.
    const ROUNDS: usize = 4;
    /// How far from the sensor's usual parameters a point may well be: bias (m/s²), scale, and lean of an axis (rad).
    const NEAR: [f64; 3] = [0.2, 0.02, 0.01];
    let gravity = engine::gravity(config).value;
    let times = times(rests, visits);
    let walk = of_accelerometer(config, gravity).within(times.last().copied().unwrap_or_default());
    let linearised = |at: &[SVector<f64, UNKNOWNS>]| -> Vec<Visit<UNKNOWNS>> {
        let visit = |((visit, time), at): ((&Vec<usize>, &f64), &SVector<f64, UNKNOWNS>)| {
            let calibration = calibration(at);
            let equations = placements(rests, visit).filter_map(|rest| {
                let noise = rest.rest.accelerometer.mean_variance();
                length(&calibration, at, &rest.rest.accelerometer.mean, noise, gravity)
            });
            Visit { time: *time, equations: equations.collect() }
        };
        visits.iter().zip(&times).zip(at).map(visit).collect()
    };
    // Behind a jump the equations may determine little. Where they do not, all visits are linearised at one point: what is
    // lost by that is the same before and behind the jump.
    let within = of_each_kind(NEAR);
    let (mut found, mut strays) = (Vec::new(), Vec::new());
    let mut equations = linearised(&vec![walk.start; visits.len()]);
    for round in 0..ROUNDS {
        let resets: Vec<_> = found.iter().map(|jump: &Jump<UNKNOWNS>| jump.at).collect();
        let pooled = walk.average(&equations, &[]).states;
        let common = pooled.iter().map(|state| state.mean).sum::<SVector<f64, UNKNOWNS>>() / pooled.len().max(1) as f64;
        let states = if resets.is_empty() { pooled } else { walk.average(&equations, &resets).states };
        let at: Vec<_> = states.iter().map(|state| state.settled(&common, &within, &walk.unknown())).collect();
        equations = linearised(&at);
        // The first rounds only approximate.
        if round + 2 >= ROUNDS {
            strays = remove_strays(&walk, &mut equations);
            found = jumps(&walk, &equations, hints);
            found.retain(|jump| !strays.iter().any(|explained: &Explained| explained.holds(jump)));
        }
    }
    let stray = |stray: &Stray| Some(placements(rests, visits.get(stray.visit)?).nth(stray.equation)?.rest.start);
    let strays = strays.iter().map(|explained| explained.strays.iter().filter_map(stray).collect()).collect();
    Course { strays, ..course(&walk, &equations, found) }
}

/// Course of the gyroscope's bias.
pub(super) fn gyroscope(rests: &[&PastRest], visits: &[Vec<usize>], config: &engine::Config) -> Course<3> {
    let times = times(rests, visits);
    let walk = of_gyroscope(config).within(times.last().copied().unwrap_or_default());
    let visit = |(visit, time): (&Vec<usize>, f64)| {
        let rates = placements(rests, visit).filter_map(|rest| rest.rest.gyroscope.as_ref());
        let equations = rates.flat_map(|rate| {
            let noise = rate.mean_variance();
            (0..3).map(move |axis| {
                let mut factors = Vector3::zeros();
                factors[axis] = 1.0;
                Equation { factors, value: rate.mean[axis], noise: noise[axis], gain: 1.0 }
            })
        });
        Visit { time, equations: equations.collect() }
    };
    let equations: Vec<_> = visits.iter().zip(times).map(visit).collect();
    course(&walk, &equations, jumps(&walk, &equations, &[]))
}

/// Bias and sensitivity of a state.
pub(super) fn calibration(at: &SVector<f64, UNKNOWNS>) -> Calibration {
    let parameters = nalgebra::DVector::from_column_slice(at.as_slice());
    Parameterisation::TRIANGULAR.calibration(&parameters)
}

/// Biases of a state.
pub(super) fn bias(parameters: &SVector<f64, UNKNOWNS>) -> [f64; 3] {
    of_terms(parameters, Term::Bias)
}

/// Diagonal of the sensitivity of a state.
pub(super) fn diagonal(parameters: &SVector<f64, UNKNOWNS>) -> [f64; 3] {
    of_terms(parameters, |axis| Term::Own(axis, axis))
}

fn of_terms(parameters: &SVector<f64, UNKNOWNS>, term: impl Fn(usize) -> Term) -> [f64; 3] {
    let terms = Parameterisation::TRIANGULAR.terms();
    let value = |axis: usize| terms.iter().position(|known| *known == term(axis)).map(|i| parameters[i]);
    [0, 1, 2].map(|axis| value(axis).unwrap_or_default())
}

impl<const N: usize> Walk<N> {
    /// The same model over so many seconds: nothing walks within an hour.
    fn within(mut self, seconds: f64) -> Self {
        if seconds < LONG {
            self.distances.truncate(1);
        }
        self
    }
}

fn course<const N: usize>(walk: &Walk<N>, equations: &[Visit<N>], jumps: Vec<Jump<N>>) -> Course<N> {
    let resets: Vec<_> = jumps.iter().map(|jump| jump.at).collect();
    let Averaged { states, ratio, speed } = walk.average(equations, &resets);
    let is_followed = walks(equations);
    let speed = walk.pace.map(|pace| pace * pace * speed);
    Course { states, jumps, strays: Vec::new(), drifts: is_followed && ratio > DRIFTS, is_followed, speed }
}

/// Whether the visits lie far enough apart for a walk, with enough equations to estimate it.
fn walks<const N: usize>(visits: &[Visit<N>]) -> bool {
    let told: usize = visits.iter().map(|visit| visit.equations.len()).sum();
    visits.len() > 2 && span(visits) >= LONG && told >= 2 * N
}

/// Model of an accelerometer's walk, in m/s² and without unit.
fn of_accelerometer(config: &engine::Config, gravity: f64) -> Walk<UNKNOWNS> {
    /// Prior standard deviations: bias (m/s²), scale, and lean of an axis (rad).
    const PRIOR: [f64; 3] = [2.0, 0.1, 0.015];
    /// Pace of the scale relative to the bias, in units of gravity.
    const SCALE: f64 = 0.3;
    let start = Parameterisation::TRIANGULAR.vector(&Calibration::default());
    Walk {
        start: SVector::from_iterator(start.iter().copied()),
        prior: of_each_kind(PRIOR),
        pace: of_each_kind([1.0, SCALE / gravity, 0.0]),
        scatters: ratios(0.05, 3.0).map(|share| share * config.fit.placement_std).collect(),
        distances: distances(0.002, 0.8),
        usual: 0.05,
    }
}

/// One number for each bias, scale, and lean of an axis.
fn of_each_kind([bias, scale, lean]: [f64; 3]) -> SVector<f64, UNKNOWNS> {
    let terms = Parameterisation::TRIANGULAR.terms().iter().map(|term| match term {
        Term::Bias(_) => bias,
        Term::Own(row, column) if row == column => scale,
        _ => lean,
    });
    SVector::from_iterator(terms)
}

/// Model of the walk of a gyroscope's bias, rad/s.
fn of_gyroscope(config: &engine::Config) -> Walk<3> {
    Walk {
        start: Vector3::zeros(),
        prior: Vector3::repeat(0.1),
        pace: Vector3::repeat(1.0),
        scatters: ratios(0.01, 3.0).map(|share| share * config.fit.rate_std).collect(),
        distances: distances(1e-5, 3e-2),
        usual: 2e-3,
    }
}

/// Numbers between two at equal ratios, so close that the walk of a number in between reads like that of its neighbour.
fn ratios(least: f64, most: f64) -> impl Iterator<Item = f64> {
    /// Ratio of neighbours.
    const RATIO: f64 = 1.8;
    let count = libm::ceil(libm::log(most / least) / libm::log(RATIO)) as i32;
    (0..=count).map(move |k| least * libm::pow(most / least, f64::from(k) / f64::from(count.max(1))))
}

fn distances(least: f64, most: f64) -> Vec<f64> {
    std::iter::once(0.0).chain(ratios(least, most)).collect()
}

/// ‖S⁻¹(m − b)‖ = g, linearised.
fn length(
    calibration: &Calibration,
    at: &SVector<f64, UNKNOWNS>,
    mean: &Vector3<f64>,
    noise: Vector3<f64>,
    gravity: f64,
) -> Option<Equation<UNKNOWNS>> {
    let corrected = calibration.correct(mean);
    let up = corrected.try_normalize(f64::MIN_POSITIVE)?;
    let by_measured = calibration.inverse().transpose() * up;
    let mut factors: SVector<f64, UNKNOWNS> = SVector::zeros();
    for (i, term) in Parameterisation::TRIANGULAR.terms().iter().enumerate() {
        factors[i] = match *term {
            Term::Bias(axis) => -by_measured[axis],
            Term::Own(row, column) => -by_measured[row] * corrected[column],
            _ => 0.0,
        };
    }
    let value = gravity - corrected.norm() + factors.dot(at);
    let noise = by_measured.component_mul(&by_measured).dot(&noise);
    let sound = value.is_finite() && noise.is_finite() && factors.iter().all(|factor| factor.is_finite());
    sound.then(|| Equation { factors, value, noise, gain: by_measured.norm_squared() })
}

/// The longest rest of each placement in a visit: the others only repeat its reading.
fn placements<'a>(rests: &'a [&PastRest], visit: &'a [usize]) -> impl Iterator<Item = &'a PastRest> {
    let all = visit.iter().filter_map(|&i| rests.get(i).copied());
    let mut longest: std::collections::BTreeMap<u32, &PastRest> = std::collections::BTreeMap::new();
    for rest in all {
        let known = longest.entry(rest.rest.placement).or_insert(rest);
        if known.rest.accelerometer.effective < rest.rest.accelerometer.effective {
            *known = rest;
        }
    }
    longest.into_values()
}

/// Time from the first visit to each, in seconds.
fn times(rests: &[&PastRest], visits: &[Vec<usize>]) -> Vec<f64> {
    let start = |visit: &Vec<usize>| rests.get(*visit.first()?).map(|rest| rest.rest.start);
    let first = visits.first().and_then(start).unwrap_or_default();
    visits.iter().map(|visit| start(visit).map_or(0.0, |start| start.seconds_since(first))).collect()
}
