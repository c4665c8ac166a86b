//! The primary accelerometer's calibration from the placements on the faces of a fixture. Which rests these are is left
//! to the caller.
//!
//! Two stages, each a bounded linear least squares. The regression on the fixture uses, of each placement, the
//! component along its own face alone: the others are first order in tilt. The refinement then is Gauss–Newton on
//! ‖S⁻¹(m − b)‖ = g, which no tilt can touch (Frosio, Pedersini & Borghese, "Autocalibration of MEMS accelerometers",
//! IEEE TIM 2009).

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::calibration::{Calibration, Shape};
use super::config::{Bounds, Estimator};
use super::lsqlin::{self, lsqlin};
use super::scatter::variance_between;

/// What one placement read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Mean of the raw readings, m/s².
    pub mean: Vector3<f64>,
    /// Variance of that mean by noise alone, per axis, (m/s²)².
    pub noise: Vector3<f64>,
    /// Direction of true specific force meant by the face, unit vector.
    pub normal: Vector3<f64>,
}

/// The length of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gravity {
    /// m/s².
    pub value: f64,
    /// One standard deviation, m/s².
    pub std: f64,
}

/// What is assumed beside the observations.
#[derive(Clone, Copy, Debug)]
pub struct Assumptions<'a> {
    /// Which entries are unknown.
    pub shape: Shape,
    /// Where to stop.
    pub estimator: Estimator,
    /// The length of gravity.
    pub gravity: Gravity,
    /// Scatter of specific force from placement to placement, while repeats do not show it, m/s².
    pub placement_std: f64,
    /// Limits of the parameters.
    pub bounds: &'a Bounds,
}

/// A calibration and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Bias and sensitivity.
    pub calibration: Calibration,
    /// Which entries were estimated.
    pub shape: Shape,
    /// Covariance of the parameters in the order of [`Shape`], all causes included.
    pub covariance: DMatrix<f64>,
    /// Weighted root mean square of ‖corrected‖ − g over the placements, m/s².
    pub residual_rms: f64,
    /// The greatest rms that noise or the gate's allowance excuse, m/s².
    pub residual_limit: f64,
    /// Weighted sum of squares over its degrees of freedom, at the assumed placement scatter; `None` without redundancy.
    pub chi2_per_dof: Option<f64>,
    /// Condition number of the design.
    pub condition: f64,
    /// Parameters held back by a bound, by their place in the parameter vector.
    pub active: Vec<usize>,
}

/// Accelerometers cross-couple by about this much where the model has no word for it (one standard deviation).
const UNMODELLED_CROSS_AXIS: f64 = 0.01;
/// Residuals of ‖a‖ − g below this are no reason to refuse, m/s².
const ALLOWANCE: f64 = 0.03;

impl Fit {
    /// Whether the placements agree that ‖a‖ = g.
    pub fn agrees(&self) -> bool {
        self.residual_rms <= self.residual_limit
    }
}

/// Fits the observations.
///
/// # Errors
/// If they do not determine the parameters, or the solver fails.
pub fn fit(observations: &[Observation], given: &Assumptions<'_>) -> Result<Fit, lsqlin::Error> {
    let solve = |between: f64, tilts: Option<&Calibration>| {
        let stage = on_fixture(observations, given, between, tilts)?;
        match given.estimator {
            Estimator::Fixture => Ok(stage),
            Estimator::Magnitude => on_magnitude(observations, given, between, stage),
        }
    };
    // The scatter and the tilts that the first fit shows set the weights of the second.
    let first = solve(given.placement_std * given.placement_std, None)?;
    let second = solve(observed_scatter(observations, given, &first), Some(&first.calibration))?;
    Ok(summarise(observations, given, second))
}

/// A solution with the weighted design that it came from.
struct Stage {
    calibration: Calibration,
    design: DMatrix<f64>,
    /// How the rows would answer to the entries of S that the model has no word for, weighted like the design.
    leaks: DMatrix<f64>,
    condition: f64,
    active: Vec<usize>,
}

/// Regression on the fixture: each placement tells of the axis that its face lies along. A tilt takes 1 − cos θ from it,
/// which is in the weights once the tilts are known.
fn on_fixture(
    observations: &[Observation],
    given: &Assumptions<'_>,
    between: f64,
    tilts: Option<&Calibration>,
) -> Result<Stage, lsqlin::Error> {
    let (mut rows, mut leaks, mut targets) = (Vec::new(), Vec::new(), Vec::new());
    for seen in observations {
        let truth = seen.normal * given.gravity.value;
        let felt = tilts.map_or(truth, |calibration| calibration.correct(&seen.mean));
        let lost = given.gravity.value - felt.dot(&seen.normal);
        let jacobian = given.shape.jacobian(&truth);
        let unmodelled = given.shape.unmodelled(&felt);
        for axis in (0..3).filter(|&axis| seen.normal[axis].abs() > 0.5) {
            let weight = 1.0 / (between + lost * lost + seen.noise[axis]).sqrt();
            rows.push(jacobian.row(axis) * weight);
            leaks.push(unmodelled.row(axis) * weight);
            targets.push(seen.mean[axis] * weight);
        }
    }
    if rows.len() < given.shape.unknowns() {
        return Err(lsqlin::Error::Singular(f64::INFINITY));
    }
    let design = DMatrix::from_rows(&rows);
    let (low, high) = limits(given, None);
    let solution = lsqlin(&design, &DVector::from_vec(targets), &low, &high)?;
    Ok(Stage {
        calibration: given.shape.calibration(&solution.x),
        design,
        leaks: DMatrix::from_rows(&leaks),
        condition: solution.condition,
        active: solution.active,
    })
}

/// Gauss–Newton on ‖S⁻¹(m − b)‖ = g, every step a bounded least squares.
fn on_magnitude(
    observations: &[Observation],
    given: &Assumptions<'_>,
    between: f64,
    start: Stage,
) -> Result<Stage, lsqlin::Error> {
    const STEPS: usize = 20;
    // In units of the residuals' standard deviations: less is nothing gained.
    const ENOUGH: f64 = 1e-9;
    let mut stage = start;
    for _ in 0..STEPS {
        let lines: Vec<Line> =
            observations.iter().map(|seen| Line::of(seen, given, &stage.calibration, between)).collect();
        if lines.len() < given.shape.unknowns() {
            return Err(lsqlin::Error::Singular(f64::INFINITY));
        }
        let rows: Vec<_> = lines.iter().map(|line| line.gradient.transpose() / line.variance.sqrt()).collect();
        let leaks: Vec<_> = lines.iter().map(|line| line.leak.transpose() / line.variance.sqrt()).collect();
        let targets =
            DVector::from_iterator(lines.len(), lines.iter().map(|line| -line.residual / line.variance.sqrt()));
        let here = given.shape.vector(&stage.calibration);
        let (low, high) = limits(given, Some(&here));
        let design = DMatrix::from_rows(&rows);
        let leaks = DMatrix::from_rows(&leaks);
        let step = lsqlin(&design, &targets, &low, &high)?;
        let gained = (&design * &step.x).amax();
        let calibration = given.shape.calibration(&(here + &step.x));
        stage = Stage { calibration, design, leaks, condition: step.condition, active: step.active };
        if gained < ENOUGH {
            return Ok(stage);
        }
    }
    Err(lsqlin::Error::NotConverged)
}

/// One placement's equation ‖S⁻¹(m − b)‖ = g, linearised.
struct Line {
    /// ‖corrected‖ − g, m/s².
    residual: f64,
    /// By the parameters.
    gradient: DVector<f64>,
    /// By the entries of S that the model has no word for.
    leak: DVector<f64>,
    /// Of the residual by noise, (m/s²)².
    noise: f64,
    /// The same with placement scatter.
    variance: f64,
}

impl Line {
    fn of(seen: &Observation, given: &Assumptions<'_>, calibration: &Calibration, between: f64) -> Self {
        let corrected = calibration.correct(&seen.mean);
        let length = corrected.norm();
        let up = corrected / length.max(f64::MIN_POSITIVE);
        // ∂‖S⁻¹(m − b)‖/∂m.
        let by_measured = calibration.inverse().transpose() * up;
        let noise = by_measured.component_mul(&by_measured).dot(&seen.noise);
        Self {
            residual: length - given.gravity.value,
            gradient: -given.shape.jacobian(&corrected).tr_mul(&by_measured),
            leak: -given.shape.unmodelled(&corrected).tr_mul(&by_measured),
            noise,
            variance: by_measured.norm_squared() * between + noise,
        }
    }
}

fn observed_scatter(observations: &[Observation], given: &Assumptions<'_>, stage: &Stage) -> f64 {
    let lines: Vec<_> = observations.iter().map(|seen| Line::of(seen, given, &stage.calibration, 0.0)).collect();
    let freedom = observations.len().saturating_sub(given.shape.unknowns()) as f64;
    let residuals = lines.iter().map(|line| (line.residual, line.noise));
    variance_between(residuals, freedom, given.placement_std)
}

fn summarise(observations: &[Observation], given: &Assumptions<'_>, stage: Stage) -> Fit {
    let assumed = given.placement_std * given.placement_std;
    let lines: Vec<_> = observations.iter().map(|seen| Line::of(seen, given, &stage.calibration, assumed)).collect();
    let count = lines.len() as f64;
    let weights: f64 = lines.iter().map(|line| 1.0 / line.variance).sum();
    let squares: f64 = lines.iter().map(|line| line.residual * line.residual / line.variance).sum();
    let residual_rms = (squares / weights).sqrt();
    let white = lines.iter().map(|line| line.noise).sum::<f64>() / count;
    let freedom = lines.len().saturating_sub(given.shape.unknowns());
    Fit {
        covariance: covariance(given, &stage),
        calibration: stage.calibration,
        shape: given.shape,
        residual_rms,
        residual_limit: (5.0 * white.sqrt()).max(ALLOWANCE),
        chi2_per_dof: (freedom > 0).then(|| squares / freedom as f64),
        condition: stage.condition,
        active: stage.active,
    }
}

/// (JᵀWJ)⁻¹; what the uncertainty of g does, which scales S and leaves b alone; and what unmodelled cross-axis
/// sensitivity does, which is the same at every placement, so that no repetition averages it away.
fn covariance(given: &Assumptions<'_>, stage: &Stage) -> DMatrix<f64> {
    let information = stage.design.tr_mul(&stage.design);
    let unknowns = given.shape.unknowns();
    let mut covariance = information.try_inverse().unwrap_or_else(|| DMatrix::repeat(unknowns, unknowns, f64::NAN));
    let by_leak = &covariance * stage.design.tr_mul(&stage.leaks);
    covariance += &by_leak * by_leak.transpose() * UNMODELLED_CROSS_AXIS.powi(2);
    let mut by_gravity = given.shape.vector(&stage.calibration) / given.gravity.value;
    by_gravity.fixed_rows_mut::<3>(0).fill(0.0);
    covariance += &by_gravity * by_gravity.transpose() * given.gravity.std.powi(2);
    covariance
}

/// The bounds of the parameters, or of a step from `here`.
fn limits(given: &Assumptions<'_>, here: Option<&DVector<f64>>) -> (DVector<f64>, DVector<f64>) {
    let Bounds { accel_bias: bias, accel_scale: scale, .. } = given.bounds;
    let of = |side: usize| {
        let entries = given.shape.free().iter().map(|(row, column)| match (row == column, side) {
            (true, _) => scale[side],
            (false, 0) => f64::NEG_INFINITY,
            (false, _) => f64::INFINITY,
        });
        let limit = DVector::from_iterator(given.shape.unknowns(), [bias[side]; 3].into_iter().chain(entries));
        match here {
            Some(here) => limit - here,
            None => limit,
        }
    };
    (of(0), of(1))
}

/// 95 % bound of the error of a corrected reading, over all directions of gravity, m/s².
pub fn worst_case_error(calibration: &Calibration, shape: Shape, covariance: &DMatrix<f64>, gravity: f64) -> f64 {
    let inverse = calibration.inverse();
    let worst = directions().map(|up| {
        // δ(S⁻¹(m − b)) = −S⁻¹ ∂measured/∂parameters δparameters.
        let by_parameters = inverse * shape.jacobian(&(up * gravity));
        let error: Matrix3<f64> =
            Matrix3::from_fn(|i, j| (by_parameters.row(i) * covariance * by_parameters.row(j).transpose())[(0, 0)]);
        error.symmetric_eigenvalues().max()
    });
    1.96 * worst.fold(0.0, f64::max).sqrt()
}

/// Faces, edges and corners of a cube: where a quadratic form of direction has its extremes, near enough.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let axis = [-1.0, 0.0, 1.0];
    axis.into_iter()
        .flat_map(move |x| axis.into_iter().flat_map(move |y| axis.into_iter().map(move |z| Vector3::new(x, y, z))))
        .filter_map(|direction: Vector3<f64>| direction.try_normalize(0.5))
}
