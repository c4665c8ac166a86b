//! Calibration of the primary accelerometer from placements on the faces of a fixture.
//!
//! Two stages, each a bounded linear least squares. The regression on the fixture uses only the component of each
//! placement along its own face, because the others are first order in tilt. The refinement is Gauss–Newton on ‖S⁻¹(m −
//! b)‖ = g, which does not depend on tilt (Frosio, Pedersini & Borghese, "Autocalibration of MEMS accelerometers", IEEE
//! TIM 2009).

use nalgebra::{DMatrix, SMatrix, SVector, Vector3};

use super::bound::Bounds;
use super::calibration::Calibration;
use super::config::{Estimator, Loss};
use super::error::Error;
use super::estimate::{Estimate, Origin};
use super::gravity::Gravity;
use super::linear_system::{LinearSystem, Solved, limits};
use super::parameterisation::{Parameterisation, Term, Truth};
use super::placement_scatter::Assumed;
use super::reliability::{GROSS_ERROR, Reliability};
use super::turn_fit::Told;
use super::uncertainty::{Sharing, Uncertainty};

/// Readings of one placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Number of the placement.
    pub placement: u32,
    /// Mean of the raw readings, m/s².
    pub mean: Vector3<f64>,
    /// Variance of that mean by noise alone, per axis, (m/s²)².
    pub noise: Vector3<f64>,
    /// Nominal direction of true specific force on the face, unit vector.
    pub normal: Vector3<f64>,
}

/// Assumptions of a fit beside its observations.
#[derive(Clone, Copy, Debug)]
pub struct Assumptions<'a> {
    /// Unknown parameters.
    pub shape: Parameterisation,
    /// Stage after which the fit stops.
    pub estimator: Estimator,
    /// Magnitude of gravity.
    pub gravity: Gravity,
    /// Scatter of specific force between placements, assumed until repeats show it, standard deviation, m/s².
    pub placement_std: f64,
    /// Standard deviation of the off-diagonal entries of S that the model does not estimate.
    pub cross_axis_std: f64,
    /// Quadratic nonlinearity: what the square of a reading adds to it at 1 g, standard deviation, m/s².
    pub nonlinearity: f64,
    /// Loss function of the residuals.
    pub loss: Loss,
    /// Limits of the parameters.
    pub bounds: &'a Bounds,
    /// Initial guess, for models that the faces do not determine.
    pub start: Calibration,
}

/// Residuals of ‖a‖ − g below this never make a fit disagree, m/s².
const ALLOWANCE: f64 = 0.03;

/// Fits the observations.
///
/// If the observations do not determine the parameters, or the solver fails.
pub fn fit(observations: &[Observation], given: &Assumptions<'_>) -> Result<Estimate, Error> {
    fit_with(observations, given, None)
}

/// Fits the observations together with what turns say of the biases and a lower-triangular S.
///
/// If they do not determine the parameters, or the solver fails.
pub fn fit_with(observations: &[Observation], given: &Assumptions<'_>, told: Option<&Told>) -> Result<Estimate, Error> {
    let allowed = told.filter(|_| given.nonlinearity > 0.0).map(|told| told.allowing_for(given.nonlinearity));
    let told = allowed.as_ref().or(told);
    let solve = |between: f64, before: Option<&Calibration>| match (given.estimator, before) {
        (Estimator::Fixture, _) => on_fixture(observations, given, between, before),
        (Estimator::Magnitude, Some(before)) => on_magnitude(observations, given, told, between, *before),
        (Estimator::Magnitude, None) if given.shape == Parameterisation::TRIANGULAR => {
            on_magnitude(observations, given, told, between, given.start)
        }
        (Estimator::Magnitude, None) => {
            let start = on_fixture(observations, given, between, None)?;
            on_magnitude(observations, given, told, between, start.calibration)
        }
    };
    // The scatter and the tilts of the first fit set the weights of the second.
    let first = solve(given.placement_std * given.placement_std, None)?;
    let uncertainty = Uncertainty::learn(given.shape, &first.solved, Sharing::All, given.assumed());
    let second = solve(uncertainty.between(0), Some(&first.calibration))?;
    let mut estimate = summarise(observations, given, &uncertainty, second);
    if !estimate.active.is_empty() {
        // A fit without bounds shows where the data alone put the parameters.
        let free = Bounds::none();
        let free = Assumptions { bounds: &free, start: estimate.calibration(), ..*given };
        let stage = match given.estimator {
            Estimator::Fixture => on_fixture(observations, &free, uncertainty.between(0), None),
            Estimator::Magnitude => on_magnitude(observations, &free, told, uncertainty.between(0), free.start),
        };
        estimate.doubt_bound(&given.shape.vector(&stage?.calibration));
    }
    Ok(estimate)
}

/// A solution with the weighted equations that it came from.
struct Stage {
    calibration: Calibration,
    solved: Solved,
}

/// Regression on the fixture: one equation a placement, along the normal of its face. A tilt θ takes g (1 − cos θ) from
/// it, which enters the weights once the tilts are known.
fn on_fixture(
    observations: &[Observation],
    given: &Assumptions<'_>,
    between: f64,
    tilts: Option<&Calibration>,
) -> Result<Stage, Error> {
    let mut system = LinearSystem::leaking(given.shape, given.assumed().leak);
    for seen in observations {
        let truth = seen.normal * given.gravity.value;
        let felt = tilts.map_or(truth, |calibration| calibration.correct(&seen.mean));
        let lost = given.gravity.value - felt.dot(&seen.normal);
        let noise = seen.normal.component_mul(&seen.normal).dot(&seen.noise);
        system.push(&seen.normal, &Truth::of(truth), seen.normal.dot(&seen.mean), noise + lost * lost, between);
    }
    let solved = system.solve(&limits(given.shape, |term| given.bounds.accelerometer(term)), given.loss)?;
    Ok(Stage { calibration: given.shape.calibration(&solved.solution.x), solved })
}

/// Refinement on ‖S⁻¹(m − b)‖ = g. Bounds may leave residuals that no cross-axis sensitivity explains; then leaks are
/// not estimated.
fn on_magnitude(
    observations: &[Observation],
    given: &Assumptions<'_>,
    told: Option<&Told>,
    between: f64,
    start: Calibration,
) -> Result<Stage, Error> {
    match gauss_newton(observations, given, told, between, given.assumed().leak, start) {
        Err(Error::NotConverged) => gauss_newton(observations, given, told, between, 0.0, start),
        found => found,
    }
}

/// Gauss–Newton iteration, every step a bounded least squares.
fn gauss_newton(
    observations: &[Observation],
    given: &Assumptions<'_>,
    told: Option<&Told>,
    between: f64,
    leak: f64,
    start: Calibration,
) -> Result<Stage, Error> {
    const STEPS: usize = 20;
    // Largest change of a residual at convergence, in its standard deviations. The next step would be a thousandth of
    // it.
    const ENOUGH: f64 = 1e-6;
    let (low, high) = limits(given.shape, |term| given.bounds.accelerometer(term));
    let mut calibration = start;
    for _ in 0..STEPS {
        let mut system = LinearSystem::leaking(given.shape, leak);
        for seen in observations {
            let MagnitudeEquation { residual, by_measured, truth, noise } =
                MagnitudeEquation::of(seen, given, &calibration);
            system.push(&-by_measured, &truth, -residual, noise, between);
        }
        if let (Some(told), Some(first)) = (told, observations.first()) {
            push_told(&mut system, told, &calibration, first.noise.max());
        }
        let here = given.shape.vector(&calibration);
        let solved = system.solve(&(&low - &here, &high - &here), given.loss)?;
        calibration = given.shape.calibration(&(here + &solved.solution.x));
        if (&solved.design * &solved.solution.x).amax() < ENOUGH {
            return Ok(Stage { calibration, solved });
        }
    }
    Err(Error::NotConverged)
}

/// Adds what turns say as equations with independent errors, in units of a typical variance: one along each principal
/// axis.
fn push_told(system: &mut LinearSystem, told: &Told, at: &Calibration, variance: f64) {
    /// Least information along an axis that counts, relative to the best-known axis.
    const NOTHING: f64 = 1e-9;
    let shape = Parameterisation::TRIANGULAR;
    let here = shape.vector(at);
    // A unit of an entry of S changes a reading by about ten times as much as a unit of bias.
    let unit = SVector::<f64, 9>::from_fn(|i, _| if i < 3 { 1.0 } else { 0.1 });
    let scaled = SMatrix::<f64, 9, 9>::from_fn(|i, j| told.information[(i, j)] * unit[i] * unit[j]);
    let off = SVector::<f64, 9>::from_fn(|i, _| {
        let said: f64 = (0..9).map(|j| told.information[(i, j)] * here[j]).sum();
        (told.moment[i] - said) * unit[i]
    });
    let eigen = scaled.symmetric_eigen();
    let best = eigen.eigenvalues.max();
    for (k, &information) in eigen.eigenvalues.iter().enumerate() {
        if variance.is_nan() || variance <= 0.0 || information.is_nan() || information <= NOTHING * best.max(0.0) {
            continue;
        }
        let axis = eigen.eigenvectors.column(k);
        let factor = (information * variance).sqrt();
        let terms: Vec<(Term, f64)> =
            shape.terms().iter().enumerate().map(|(i, term)| (*term, factor * axis[i] / unit[i])).collect();
        system.push_known(&terms, axis.dot(&off) / information * factor, variance);
    }
}

/// Linearised equation ‖S⁻¹(m − b)‖ = g of one placement.
pub(super) struct MagnitudeEquation {
    /// ‖corrected‖ − g, m/s².
    pub(super) residual: f64,
    /// ∂‖S⁻¹(m − b)‖/∂m.
    pub(super) by_measured: Vector3<f64>,
    /// Corrected reading.
    pub(super) truth: Truth,
    /// Variance of the residual from noise, (m/s²)².
    pub(super) noise: f64,
}

impl MagnitudeEquation {
    pub(super) fn of(seen: &Observation, given: &Assumptions<'_>, calibration: &Calibration) -> Self {
        let inverse = calibration.inverse();
        let corrected = inverse * (seen.mean - calibration.bias);
        let length = corrected.norm();
        let up = corrected / length.max(f64::MIN_POSITIVE);
        let by_measured = inverse.tr_mul(&up);
        let noise = by_measured.component_mul(&by_measured).dot(&seen.noise);
        Self { residual: length - given.gravity.value, by_measured, truth: Truth::of(corrected), noise }
    }
}

fn summarise(
    observations: &[Observation],
    given: &Assumptions<'_>,
    uncertainty: &Uncertainty,
    stage: Stage,
) -> Estimate {
    let lines: Vec<_> =
        observations.iter().map(|seen| MagnitudeEquation::of(seen, given, &stage.calibration)).collect();
    let weight =
        |line: &MagnitudeEquation| 1.0 / (line.by_measured.norm_squared() * given.placement_std.powi(2) + line.noise);
    let weights: f64 = lines.iter().map(weight).sum();
    let squares: f64 = lines.iter().map(|line| line.residual * line.residual * weight(line)).sum();
    let white = lines.iter().map(|line| line.noise).sum::<f64>() / lines.len() as f64;
    let gain = stage.solved.gain();
    let leak = if given.shape.unmodelled().next().is_some() { uncertainty.leak_rms } else { given.cross_axis_std };
    let beside = by_gravity(given, &stage.calibration)
        + by_lengths(given, &stage.calibration, leak)
        + by_squares(given, &stage.calibration);
    let numbers = observations.iter().map(|seen| seen.placement);
    let origin = Origin {
        systematic: uncertainty.leakage(&stage.solved, &gain) + &beside,
        influence: numbers.zip(stage.solved.influence(&gain)).collect(),
        between: uncertainty.between_placements(),
    };
    let mut reliability = Reliability::of(&stage.solved, &gain, GROSS_ERROR);
    // The equations of the turns come after those of the placements.
    reliability.checks.truncate(observations.len());
    Estimate {
        shape: given.shape,
        parameters: given.shape.vector(&stage.calibration),
        covariance: uncertainty.covariance(given.shape, &stage.solved, &gain, &beside.into()),
        unmodelled_std: uncertainty.leak_rms,
        inherited_std: 0.0,
        residual_rms: (squares / weights).sqrt(),
        residual_limit: (5.0 * libm::hypot(white.sqrt(), given.placement_std)).max(ALLOWANCE),
        chi2_per_dof: uncertainty.chi2_per_dof(),
        freedom: uncertainty.freedom(),
        placement_std: uncertainty.placement_std(),
        condition: stage.solved.solution.condition(),
        reliability: Some(reliability),
        active: stage.solved.solution.active,
        origin: Some(origin),
    }
}

/// Covariance from the uncertainty of g, which scales S and leaves b alone.
fn by_gravity(given: &Assumptions<'_>, calibration: &Calibration) -> DMatrix<f64> {
    let mut by_gravity = given.shape.vector(calibration) / given.gravity.value;
    by_gravity.fixed_rows_mut::<3>(0).fill(0.0);
    &by_gravity * by_gravity.transpose() * given.gravity.std.powi(2)
}

/// Covariance from what the length of a reading leaves open and no tilt shows. Lengths determine the columns of a
/// diagonal S, not its diagonal: off-diagonal entries of ±`leak` lengthen a column by half their squares. Of a
/// triangular S they determine the rows; the entries above the diagonal only rotate the frame.
fn by_lengths(given: &Assumptions<'_>, calibration: &Calibration, leak: f64) -> DMatrix<f64> {
    let unknowns = given.shape.unknowns();
    let mut by_lengths = DMatrix::zeros(unknowns, unknowns);
    if given.estimator != Estimator::Magnitude || given.shape == Parameterisation::MATRIX {
        return by_lengths;
    }
    for (i, term) in given.shape.terms().iter().enumerate() {
        if let Term::Own(axis, column) = *term
            && axis == column
        {
            let squares = if given.shape == Parameterisation::TRIANGULAR { 2 - axis } else { 2 };
            // Half the sum of n squares of standard normal numbers has a mean of n/2 and a variance of n/2.
            let (mean, variance) = (squares as f64 / 2.0, squares as f64 / 2.0);
            by_lengths[(i, i)] =
                (mean * mean + variance) * leak.powi(4) * calibration.sensitivity[(axis, axis)].powi(2);
        }
    }
    by_lengths
}

/// Covariance from the quadratic nonlinearity: it adds the same on opposite faces, like a bias.
fn by_squares(given: &Assumptions<'_>, calibration: &Calibration) -> DMatrix<f64> {
    let unknowns = given.shape.unknowns();
    let mut by_squares = DMatrix::zeros(unknowns, unknowns);
    for (i, term) in given.shape.terms().iter().enumerate() {
        if let Term::Bias(axis) = *term {
            by_squares[(i, i)] = (given.nonlinearity * calibration.sensitivity[(axis, axis)]).powi(2);
        }
    }
    by_squares
}

impl Assumptions<'_> {
    /// Assumed errors. The entries of S above the diagonal only rotate the frame, which does not change the length of a
    /// reading: a triangular S is given in the sensor's own axes, and leaves nothing out.
    fn assumed(&self) -> Assumed {
        Assumed { placement: self.placement_std, leak: self.leak() }
    }

    /// Standard deviation of the leaks of this model.
    pub(super) fn leak(&self) -> f64 {
        let own_axes = self.shape == Parameterisation::TRIANGULAR && self.estimator == Estimator::Magnitude;
        if own_axes { 0.0 } else { self.cross_axis_std }
    }
}
