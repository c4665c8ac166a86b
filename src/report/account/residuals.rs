//! Differences between readings at rest and what an earlier calibration predicts, with their covariance.

use nalgebra::{DMatrix, DVector, Vector3};

use super::seen::Seen;
use super::site::Site;
use crate::fit::temperature::BiasCourse;
use crate::fit::{Config, EARTH_RATE, Parameterisation, Term, Truth};
use crate::messages::Triad;
use crate::messages::triad::Model;
use crate::report::{calibration, matrix};

/// Differences of the readings, and their covariance: independent parts, and errors that all have in common.
pub(super) struct Residuals {
    /// Measured less predicted.
    pub(super) values: DVector<f64>,
    /// Placement of each, and the gyroscope's axis.
    pub(super) of: Vec<(usize, Option<usize>)>,
    /// Independent variances by the scatter of placements.
    scatter: DVector<f64>,
    /// Variances that come from an estimate of that scatter: that itself, and the errors of the earlier calibration.
    pub(super) estimated: DVector<f64>,
    /// Independent variances by noise.
    noise: DVector<f64>,
    /// Common errors, each of one standard deviation; those with a negative sign are in another one already.
    common: Vec<(DVector<f64>, f64)>,
    /// Degrees of freedom with which the scatter was estimated.
    pub(super) freedom: f64,
    pub(super) placements: usize,
    pub(super) states_uncertainty: bool,
}

const UNSEEN: &str = "no rest shows it";
const NO_BIAS: &str = "the earlier calibration does not tell its bias";

/// ‖a‖ − g of the placements.
pub(super) fn of_accelerometer(
    triad: &Triad,
    placements: u32,
    seen: &[Seen],
    site: &Site,
) -> Result<Residuals, &'static str> {
    let known = calibration(triad).ok_or(NO_BIAS)?;
    let inverse = known.inverse();
    let course = triad.temperature.as_ref().and_then(BiasCourse::of);
    let shape = shape(triad, true);
    let assumed = Config::default();
    let (std, freedom) = scatter(triad, 0, assumed.placement_std, placements as usize, shape.unknowns());
    // Few placements may agree by chance.
    let std = std.max(assumed.placement_std);
    let mut found = Found::default();
    for (place, rest) in seen.iter().enumerate() {
        let Some((mean, noise)) = rest.force else { continue };
        let (change, more) = warmth(course.as_ref(), rest.temperature);
        let force = inverse * (mean - known.bias - change);
        let length = force.norm();
        let by_measured = inverse.transpose() * force / length.max(f64::MIN_POSITIVE);
        if !length.is_finite() || !by_measured.iter().all(|x| x.is_finite()) {
            continue;
        }
        let truth = Truth::of(force);
        let slope = |term: Term| -by_measured[term.axis()] * term.regressor(&truth);
        found.add(
            (place, None),
            length - site.value,
            by_measured.component_mul(&by_measured).dot(&noise),
            by_measured.norm_squared() * std * std,
        );
        found.slopes.push(shape.terms().iter().map(|term| slope(*term)).collect());
        found.leaks.push(shape.unmodelled().map(|term| slope(term) * assumed.cross_axis_std).collect());
        found.warmth.push([0, 1, 2].map(|axis| -by_measured[axis] * more[axis]));
    }
    let mut residuals = found.residuals(triad, shape, freedom)?;
    let ones = DVector::repeat(residuals.values.len(), site.std);
    // At one site the error of gravity is in the earlier scale, and cancels.
    residuals.common.push((ones, if site.is_same { -1.0 } else { 1.0 }));
    Ok(residuals)
}

/// Rates of the placements.
pub(super) fn of_gyroscope(
    triad: &Triad,
    accelerometer: Option<&Triad>,
    placements: u32,
    seen: &[Seen],
) -> Result<Residuals, &'static str> {
    let known = calibration(triad).ok_or(NO_BIAS)?;
    let course = triad.temperature.as_ref().and_then(BiasCourse::of);
    let shape = shape(triad, false);
    let by_force = matrix(&triad.g_sensitivity).unwrap_or_default();
    let by_square = match triad.g2_sensitivity.as_slice() {
        &[x, y, z] => Vector3::new(x, y, z),
        _ => Vector3::zeros(),
    };
    let accelerometer = accelerometer.and_then(calibration).unwrap_or_default();
    let assumed = Config::default();
    let scatter = [0, 1, 2].map(|axis| scatter(triad, axis, assumed.rate_std, placements as usize, 1));
    let mut found = Found::default();
    for (place, rest) in seen.iter().enumerate() {
        let Some((mean, noise)) = rest.rate else { continue };
        let (change, more) = warmth(course.as_ref(), rest.temperature);
        let force = rest.force.map_or(Vector3::zeros(), |(force, _)| accelerometer.correct(&force));
        let off = mean - known.bias - change - by_force * force - by_square.component_mul(&force.component_mul(&force));
        if !off.iter().all(|x| x.is_finite()) {
            continue;
        }
        let truth = Truth { own: Vector3::zeros(), other: force };
        for axis in 0..3 {
            let slope = |term: &Term| if term.axis() == axis { -term.regressor(&truth) } else { 0.0 };
            found.add((place, Some(axis)), off[axis], noise[axis], scatter[axis].0.powi(2));
            found.slopes.push(shape.terms().iter().map(slope).collect());
            found.leaks.push(Vec::new());
            let mut warmth = [0.0; 3];
            warmth[axis] = -more[axis];
            found.warmth.push(warmth);
        }
    }
    let freedom = scatter.iter().map(|(_, freedom)| *freedom).fold(f64::INFINITY, f64::min);
    let mut residuals = found.residuals(triad, shape, freedom)?;
    // The Earth turns every placement about an axis that is not known.
    let count = residuals.values.len();
    for axis in 0..3 {
        let turns = |i: usize| if residuals.of[i].1 == Some(axis) { EARTH_RATE / 3_f64.sqrt() } else { 0.0 };
        let turned = DVector::from_fn(count, |i, _| turns(i));
        residuals.common.push((turned, 1.0));
    }
    Ok(residuals)
}

/// Equations as they are found.
#[derive(Default)]
struct Found {
    of: Vec<(usize, Option<usize>)>,
    values: Vec<f64>,
    noise: Vec<f64>,
    scatter: Vec<f64>,
    /// Derivatives by the parameters, by the entries of S that are left out, and by the warmth of each axis.
    slopes: Vec<Vec<f64>>,
    leaks: Vec<Vec<f64>>,
    warmth: Vec<[f64; 3]>,
}

impl Found {
    fn add(&mut self, of: (usize, Option<usize>), value: f64, noise: f64, scatter: f64) {
        self.of.push(of);
        self.values.push(value);
        self.noise.push(noise);
        self.scatter.push(scatter);
    }

    fn residuals(self, triad: &Triad, shape: Parameterisation, freedom: f64) -> Result<Residuals, &'static str> {
        let rows = self.values.len();
        if rows == 0 {
            return Err(UNSEEN);
        }
        let table = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), rows[0].len(), |r, c| rows[r][c]);
        let covariance = covariance(triad, shape);
        let states_uncertainty = covariance.is_some();
        let scatter = DVector::from_vec(self.scatter);
        let mut estimated = scatter.clone();
        let mut common: Vec<(DVector<f64>, f64)> = Vec::new();
        if let Some(covariance) = covariance {
            // Columns of a root of it.
            let eigen = covariance.symmetric_eigen();
            let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
            let moved = table(&self.slopes) * eigen.eigenvectors * DMatrix::from_diagonal(&roots);
            moved.column_iter().for_each(|column| estimated += column.component_mul(&column));
            common.extend(moved.column_iter().map(|column| (column.into_owned(), 1.0)));
        }
        let leaks = table(&self.leaks);
        common.extend(leaks.column_iter().map(|column| (column.into_owned(), 1.0)));
        let warmth = (0..3).map(|axis| DVector::from_fn(rows, |r, _| self.warmth[r][axis]));
        common.extend(warmth.filter(|column| column.amax() > 0.0).map(|column| (column, 1.0)));
        let mut placements: Vec<_> = self.of.iter().map(|(place, _)| *place).collect();
        placements.dedup();
        Ok(Residuals {
            values: DVector::from_vec(self.values),
            of: self.of,
            scatter,
            estimated,
            noise: DVector::from_vec(self.noise),
            common,
            freedom,
            placements: placements.len(),
            states_uncertainty,
        })
    }
}

impl Residuals {
    /// Sum of squares under the joint covariance, and the variance of each residual; `None` if it is no covariance.
    pub(super) fn tested(&self) -> Option<(f64, DVector<f64>)> {
        let own = &self.noise + &self.scatter;
        if !own.iter().all(|variance| *variance > 0.0) {
            return None;
        }
        let (shared, once): (Vec<_>, Vec<_>) = self.common.iter().partition(|(_, sign)| *sign > 0.0);
        let shared: Vec<_> = shared.iter().map(|(column, _)| column).collect();
        let joint = Joint::of(&own, &shared)?;
        let mut variances = own.clone();
        shared.iter().for_each(|column| variances += column.component_mul(*column));
        let mut squares = self.values.dot(&joint.divide(&self.values));
        for (column, _) in once {
            // Never more than what all have in common is taken off.
            const MOST: f64 = 0.95;
            let divided = joint.divide(column);
            let whole = column.dot(&divided);
            if whole <= 0.0 {
                continue;
            }
            let share = (MOST / whole).min(1.0);
            squares += share * divided.dot(&self.values).powi(2) / (1.0 - share * whole);
            variances -= column.component_mul(column) * share;
        }
        Some((squares, variances.zip_map(&own, |variance: f64, own| variance.max(own))))
    }
}

/// Covariance D + U Uᵀ, in terms of which vectors are divided (Woodbury).
struct Joint {
    own: DVector<f64>,
    common: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl Joint {
    fn of(own: &DVector<f64>, shared: &[&DVector<f64>]) -> Option<Self> {
        let common = DMatrix::from_fn(own.len(), shared.len(), |r, c| shared[c][r]);
        let mut weighted = common.clone();
        weighted.row_iter_mut().zip(own).for_each(|(mut row, variance)| row /= *variance);
        let inner = DMatrix::identity(shared.len(), shared.len()) + common.tr_mul(&weighted);
        Some(Self { own: own.clone(), common, inverse: inner.cholesky()?.inverse() })
    }

    fn divide(&self, vector: &DVector<f64>) -> DVector<f64> {
        let first = vector.component_div(&self.own);
        let back = &self.common * (&self.inverse * self.common.tr_mul(&first));
        first - back.component_div(&self.own)
    }
}

/// Parameters of a model, in the order of its covariance.
fn shape(triad: &Triad, is_accelerometer: bool) -> Parameterisation {
    match (triad.model(), is_accelerometer) {
        (Model::Triangular, true) => Parameterisation::TRIANGULAR,
        (Model::CrossAxis, true) => Parameterisation::MATRIX,
        (Model::Full, true) => Parameterisation::FULL_ACCELEROMETER,
        (_, true) => Parameterisation::DIAGONAL,
        (Model::CrossAxis, false) => Parameterisation::GYROSCOPE_AT_REST,
        (Model::Full, false) => Parameterisation::FULL_GYROSCOPE,
        (Model::Turns, false) if triad.g_sensitivity.is_empty() => Parameterisation::MATRIX,
        (Model::Turns, false) => Parameterisation::GYROSCOPE_BY_TURNS,
        (_, false) => Parameterisation::BIAS,
    }
}

/// Covariance of the parameters, or what the standard deviations say of it; `None` if the calibration states neither, or
/// no credible one.
fn covariance(triad: &Triad, shape: Parameterisation) -> Option<DMatrix<f64>> {
    /// Largest credible variance; far larger ones are not finite for long.
    const MOST: f64 = 1e12;
    let count = shape.unknowns();
    let covariance = if triad.covariance.len() == count * count {
        DMatrix::from_row_slice(count, count, &triad.covariance)
    } else {
        let bias = triad.bias_std.as_ref()?;
        let std = |term: &Term| match *term {
            Term::Bias(axis) => [bias.x, bias.y, bias.z][axis],
            Term::Own(row, column) => triad.sensitivity_std.get(3 * row + column).copied().unwrap_or(0.0),
            Term::Other(..) | Term::Square(_) => 0.0,
        };
        DMatrix::from_diagonal(&DVector::from_iterator(count, shape.terms().iter().map(|term| std(term).powi(2))))
    };
    covariance.iter().all(|value| value.abs() <= MOST).then_some(covariance)
}

/// Standard deviation between placements along an axis, and the degrees of freedom with which it was estimated.
fn scatter(triad: &Triad, axis: usize, assumed: f64, placements: usize, unknowns: usize) -> (f64, f64) {
    let known = triad.placement_std.get(axis).or(triad.placement_std.first()).copied();
    let Some(std) = known.filter(|std| *std > 0.0 && std.is_finite()) else { return (assumed, f64::INFINITY) };
    // With few degrees of freedom the assumption counted as further ones, see `fit::PlacementScatter`.
    let freedom = match placements.saturating_sub(unknowns) as f64 {
        0.0 => f64::INFINITY,
        few if few < 4.0 => few + 20.0 * (4.0 / few - 1.0).powi(4),
        freedom => freedom,
    };
    (std, freedom)
}

/// Change of the bias at a temperature, and the standard deviation of that, with the sign of the change of temperature.
fn warmth(course: Option<&BiasCourse>, celsius: Option<f64>) -> (Vector3<f64>, Vector3<f64>) {
    match course.zip(celsius.filter(|celsius| celsius.is_finite())) {
        Some((course, celsius)) => {
            let sign = (celsius - course.reference).signum();
            (course.change(celsius), course.change_std(celsius) * sign)
        }
        None => (Vector3::zeros(), Vector3::zeros()),
    }
}
