//! Calibration of a triad beside a reference of true specific force and angular rate, in motion and at rest: normal
//! equations in constant memory, and their solution. [`TimeInterpolation`](super::TimeInterpolation) aligns the two in
//! time.
//!
//! One Gram matrix holds the regressors of all models, so that one pass serves them all. Sums are kept in spans of
//! equal length, which doubles when there are too many. Residuals are seldom white; how they add up within each span
//! shows by how much they are not.

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use serde::{Deserialize, Serialize};

use super::error::Error;
use super::estimate::{Estimate, Origin};
use super::linear_system::Limits;
use super::lsqlin::lsqlin;
use super::parameterisation::{Parameterisation, Term, Truth};

/// Number of regressors: one, the own quantity, the other quantity, its squares.
const REGRESSORS: usize = 10;
/// Largest number of spans.
const SPANS: usize = 32;
/// Initial number of samples in a span.
const FIRST_SPAN: u64 = 64;

/// Sums over all samples of one triad.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NormalEquations {
    spans: Vec<Span>,
    /// Number of samples in a span.
    length: u64,
}

/// Sums over one span.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Span {
    samples: u64,
    gram: SMatrix<f64, REGRESSORS, REGRESSORS>,
    /// Products of regressors and readings.
    products: SMatrix<f64, REGRESSORS, 3>,
    squares: Vector3<f64>,
}

impl Default for NormalEquations {
    fn default() -> Self {
        Self { spans: Vec::with_capacity(SPANS), length: FIRST_SPAN }
    }
}

impl NormalEquations {
    /// Adds a reading and its true value.
    pub fn push(&mut self, measured: &Vector3<f64>, truth: &Truth) {
        if self.spans.last().is_none_or(|span| span.samples >= self.length) {
            if self.spans.len() == SPANS {
                self.halve();
            }
            self.spans.push(Span::default());
        }
        let Some(span) = self.spans.last_mut() else { return };
        let regressors = regressors(truth);
        span.samples += 1;
        span.gram += regressors * regressors.transpose();
        span.products += regressors * measured.transpose();
        span.squares += measured.component_mul(measured);
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.spans.iter().map(|span| span.samples).sum()
    }

    /// Merges spans in pairs.
    fn halve(&mut self) {
        self.length *= 2;
        for i in 0..SPANS / 2 {
            let mut span = std::mem::take(&mut self.spans[2 * i]);
            span.add(&self.spans[2 * i + 1]);
            self.spans[i] = span;
        }
        self.spans.truncate(SPANS / 2);
    }

    /// Solves for the parameters of a shape. The residuals may have an rms of `most`.
    ///
    /// # Errors
    /// If the motion does not determine the parameters, or the solver fails.
    pub fn solve(&self, shape: Parameterisation, (low, high): &Limits, most: f64) -> Result<Estimate, Error> {
        let mut whole = Span::default();
        self.spans.iter().for_each(|span| whole.add(span));
        let unknowns = shape.unknowns();
        let mut estimate = Estimate {
            shape,
            parameters: DVector::zeros(unknowns),
            covariance: DMatrix::zeros(unknowns, unknowns),
            unmodelled_std: 0.0,
            inherited_std: 0.0,
            residual_rms: 0.0,
            residual_limit: most,
            chi2_per_dof: None,
            freedom: (self.spans.len() * unknowns) as f64,
            placement_std: Vec::new(),
            condition: 1.0,
            reliability: None,
            active: Vec::new(),
            origin: None,
        };
        let (mut squares, mut agreement) = (0.0, 0.0);
        for axis in 0..3 {
            // Each term acts on one axis, so the axes are solved one by one.
            let places: Vec<usize> = (0..unknowns).filter(|&i| shape.terms()[i].axis() == axis).collect();
            let columns: Vec<usize> = places.iter().map(|&i| column(shape.terms()[i])).collect();
            let bound = |limits: &DVector<f64>| DVector::from_iterator(places.len(), places.iter().map(|&i| limits[i]));
            let fixed = (!shape.has(Term::Own(axis, axis))).then(|| column(Term::Own(axis, axis)));
            let line = AxisEquations::of(&whole, axis, &columns, fixed);
            let freedom = (whole.samples as f64 - columns.len() as f64).max(0.0);
            let Some(triangle) = line.gram.clone().cholesky() else {
                return Err(Error::Singular(f64::INFINITY));
            };
            let triangle = triangle.l().transpose();
            let target = triangle.tr_solve_upper_triangular(&line.products).ok_or(Error::NotConverged)?;
            let solution = lsqlin(&triangle, &target, &bound(low), &bound(high))?;
            let left = line.left_over(&solution.x).max(0.0);
            squares += left;

            let variance = left / freedom.max(1.0);
            let inverse = line.gram.clone().try_inverse().ok_or(Error::Singular(solution.condition()))?;
            // For white residuals, the score of each span has the variance that its Gram matrix implies; any excess is
            // correlation, and counts like fewer samples.
            let scores = self.spans.iter().map(|span| {
                let line = AxisEquations::of(span, axis, &columns, fixed);
                let score = &line.products - &line.gram * &solution.x;
                score.dot(&(&inverse * &score))
            });
            let inflation = scores.sum::<f64>() / (variance * columns.len() as f64).max(f64::MIN_POSITIVE);
            agreement += inflation / 3.0;
            let covariance = inverse * variance * inflation.max(1.0);
            for (i, &p) in places.iter().enumerate() {
                estimate.parameters[p] = solution.x[i];
                for (j, &q) in places.iter().enumerate() {
                    estimate.covariance[(p, q)] = covariance[(i, j)];
                }
            }
            estimate.condition = estimate.condition.max(solution.condition());
            estimate.active.extend(solution.active.iter().map(|&i| places[i]));
        }
        estimate.active.sort_unstable();
        estimate.residual_rms = (squares / (3 * whole.samples.max(1)) as f64).sqrt();
        // A triad compared with this one depends on it as a whole.
        let systematic = estimate.covariance.clone();
        estimate.origin = Some(Origin { systematic, influence: Vec::new(), between: [0.0; 3] });
        estimate.chi2_per_dof = (self.spans.len() > 2).then_some(agreement);
        Ok(estimate)
    }
}

impl Span {
    fn add(&mut self, other: &Self) {
        self.samples += other.samples;
        self.gram += other.gram;
        self.products += other.products;
        self.squares += other.squares;
    }
}

/// Normal equations of one axis in the columns of a shape.
struct AxisEquations {
    gram: DMatrix<f64>,
    products: DVector<f64>,
    squares: f64,
}

impl AxisEquations {
    /// Selects the equations; an own sensitivity that is not unknown is one, and its column moves to the other side.
    fn of(span: &Span, axis: usize, columns: &[usize], fixed: Option<usize>) -> Self {
        let (products, gram) = (&span.products, &span.gram);
        let known = |row: usize| fixed.map_or(0.0, |fixed| gram[(row, fixed)]);
        let squares = fixed.map_or(0.0, |fixed| gram[(fixed, fixed)] - 2.0 * products[(fixed, axis)]);
        Self {
            gram: DMatrix::from_fn(columns.len(), columns.len(), |i, j| gram[(columns[i], columns[j])]),
            products: DVector::from_fn(columns.len(), |i, _| products[(columns[i], axis)] - known(columns[i])),
            squares: span.squares[axis] + squares,
        }
    }

    /// Sum of the squared residuals for given parameters.
    fn left_over(&self, x: &DVector<f64>) -> f64 {
        self.squares - 2.0 * x.dot(&self.products) + x.dot(&(&self.gram * x))
    }
}

fn regressors(truth: &Truth) -> SMatrix<f64, REGRESSORS, 1> {
    let Truth { own, other } = truth;
    SMatrix::from([
        1.0,
        own.x,
        own.y,
        own.z,
        other.x,
        other.y,
        other.z,
        other.x * other.x,
        other.y * other.y,
        other.z * other.z,
    ])
}

/// Column of a term's regressor.
fn column(term: Term) -> usize {
    match term {
        Term::Bias(_) => 0,
        Term::Own(_, column) => 1 + column,
        Term::Other(_, column) => 4 + column,
        Term::Square(axis) => 7 + axis,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    use super::*;
    use crate::fit::{Bounds, LinearSystem, Loss, limits};

    const SHAPES: [Parameterisation; 4] = [
        Parameterisation::DIAGONAL,
        Parameterisation::MATRIX,
        Parameterisation::FULL_GYROSCOPE,
        Parameterisation::GYROSCOPE_AT_REST,
    ];

    fn readings(count: usize) -> Vec<(Vector3<f64>, Truth)> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal = |scale: f64| Vector3::from_fn(|_, _| scale * random.sample::<f64, _>(StandardNormal));
        let bias = Vector3::new(0.1, -0.2, 0.3);
        let cross = Matrix3::new(1e-2, 2e-2, 0.0, 0.0, 1e-2, 3e-2, 1e-2, 0.0, 2e-2);
        (0..count)
            .map(|_| {
                let truth = Truth { own: normal(1.0), other: normal(6.0) };
                let squares = truth.other.component_mul(&truth.other) * 1e-3;
                (bias + truth.own * 1.02 + cross * truth.other + squares + normal(0.01), truth)
            })
            .collect()
    }

    /// However many spans there were, the solution is that of all equations at once.
    #[test]
    fn normal_equations_say_what_all_equations_say() {
        let readings = readings(5000);
        let mut sums = NormalEquations::default();
        readings.iter().for_each(|(measured, truth)| sums.push(measured, truth));
        assert_eq!(sums.samples(), 5000);
        assert!(sums.spans.len() <= SPANS);
        for shape in SHAPES {
            let wide = limits(shape, |_| [f64::NEG_INFINITY, f64::INFINITY]);
            let found = sums.solve(shape, &wide, 1.0).unwrap();
            let mut system = LinearSystem::new(shape);
            for (measured, truth) in &readings {
                for axis in 0..3 {
                    let direction = Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
                    let own = if shape.has(Term::Own(axis, axis)) { 0.0 } else { truth.own[axis] };
                    system.push(&direction, truth, measured[axis] - own, 1.0, 0.0);
                }
            }
            let expected = system.solve(&wide, Loss::Square).unwrap().solution.x;
            assert!((&found.parameters - &expected).amax() < 1e-9, "{shape:?}");
        }
    }

    #[test]
    fn white_noise_needs_no_inflation_and_the_bars_hold_the_truth() {
        let mut sums = NormalEquations::default();
        readings(20_000).iter().for_each(|(measured, truth)| sums.push(measured, truth));
        let shape = Parameterisation::FULL_GYROSCOPE;
        let bounds = Bounds::default();
        let found = sums.solve(shape, &limits(shape, |term| bounds.gyroscope(term)), 1.0);
        // The configured bounds are tighter than this sensor, which is reported, too.
        assert!(!found.unwrap().active.is_empty());
        let wide = limits(shape, |_| [f64::NEG_INFINITY, f64::INFINITY]);
        let found = sums.solve(shape, &wide, 1.0).unwrap();
        assert!((0.6..1.6).contains(&found.chi2_per_dof.unwrap()), "{:?}", found.chi2_per_dof);
        assert!((found.residual_rms / 0.01 - 1.0).abs() < 0.02, "{}", found.residual_rms);
        let squares = shape.squares(&found.parameters).unwrap();
        for (i, square) in squares.iter().enumerate() {
            assert!((square - 1e-3).abs() < 4.0 * found.std(21 + i), "{square}");
        }
    }

    #[test]
    fn a_motion_about_one_axis_does_not_determine_all() {
        let mut sums = NormalEquations::default();
        for i in 0..1000 {
            let truth = Truth { own: Vector3::z() * f64::from(i % 7), other: Vector3::z() * 9.8 };
            sums.push(&truth.own, &truth);
        }
        let shape = Parameterisation::FULL_ACCELEROMETER;
        let wide = limits(shape, |_| [f64::NEG_INFINITY, f64::INFINITY]);
        assert!(matches!(sums.solve(shape, &wide, 1.0), Err(Error::Singular(_))));
    }
}
