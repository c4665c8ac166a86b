//! Evidence on the dependence of a bias on regressors: powers of the temperature and of time.

use nalgebra::{DMatrix, DVector, Vector3};

use super::bias_course::Scale;
use super::points::{WarmReading, mean, pooled};
use crate::fit::Calibration;
use crate::fit::accelerometer::{Assumptions, MagnitudeEquation, Observation};
use crate::fit::placement_scatter::{Assumed, PlacementScatter};
use crate::fit::residual_block::ResidualBlock;

/// Evidence from the comparison of placements.
#[derive(Clone, Copy, Debug)]
pub enum Between<'a> {
    /// The readings themselves, as of a gyroscope at rest.
    Readings,
    /// The lengths of the readings, as of an accelerometer.
    Lengths(&'a [LengthEquation]),
}

/// Linearised equation ‖S⁻¹(m − b)‖ = g of one placement.
#[derive(Clone, Debug)]
pub struct LengthEquation {
    /// Time, s.
    time: f64,
    /// Mean temperature, °C.
    celsius: f64,
    /// Shortfall of the length from gravity, m/s².
    target: f64,
    /// Derivative of the length with respect to the bias.
    by_bias: Vector3<f64>,
    /// Derivatives with respect to the unknowns of the accelerometer, the bias included, and to its leaks.
    by_terms: Vec<f64>,
    /// Number of leaks at the end of these, and their standard deviation.
    leaks: (usize, f64),
    /// Variance from noise, (m/s²)².
    noise: f64,
}

impl LengthEquation {
    /// Equation of a placement, linearised about a calibration.
    pub fn of(seen: &Observation, given: &Assumptions<'_>, calibration: &Calibration, celsius: f64, time: f64) -> Self {
        let line = MagnitudeEquation::of(seen, given, calibration);
        let leaks: Vec<_> = given.shape.unmodelled().filter(|_| given.leak() > 0.0).collect();
        let terms = given.shape.terms().iter().chain(&leaks);
        let by_terms = terms.map(|term| -line.by_measured[term.axis()] * term.regressor(&line.truth)).collect();
        let (by_bias, target) = (-line.by_measured, -line.residual);
        Self { time, celsius, target, by_bias, by_terms, leaks: (leaks.len(), given.leak()), noise: line.noise }
    }
}

/// Powers of temperature and of time that a bias is to depend on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Regressors {
    pub(super) temperature: usize,
    pub(super) time: usize,
    /// Whether the bias drifts beside them: evenly with time, over half of the session by about as much as the rests of a
    /// placement are assumed to scatter.
    pub(super) drift: bool,
}

/// Coefficients of regressors, x, y, z of the first one, then of the second, and so on.
#[derive(Clone, Debug)]
pub(super) struct Estimated {
    pub(super) coefficients: DVector<f64>,
    /// Stretched so that 1.96 standard deviations are half of a 95 % interval.
    pub(super) covariance: DMatrix<f64>,
    /// Squares of the residuals of each set of equations, and their degrees of freedom; sets go by number.
    left: Vec<(usize, f64, f64)>,
}

impl Estimated {
    /// Logarithm of the likelihood relative to that of another estimate from the same equations.
    pub(super) fn likelihood_over(&self, other: &Self) -> f64 {
        let of = |(set, own, freedom): &(usize, f64, f64)| {
            let (_, others, _) = other.left.iter().find(|(known, ..)| known == set)?;
            Some(0.5 * freedom * libm::log((others / own.max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE)))
        };
        self.left.iter().filter_map(of).sum()
    }
}

/// Evidence from rests.
pub(super) struct Evidence<'a> {
    /// Readings by placement.
    placements: Vec<Vec<WarmReading>>,
    between: Between<'a>,
    temperature: Scale,
    time: Scale,
    /// Scatter between the rests of a placement, and between placements, until they show otherwise.
    assumed: [f64; 2],
}

/// Largest number of placements whose insides are compared: those with the largest ranges of temperature.
const MOST_INSIDE: usize = 12;
/// Least information of a set of equations about a regressor, relative to the largest.
const NOTHING: f64 = 1e-9;

impl<'a> Evidence<'a> {
    pub(super) fn new(readings: &[WarmReading], between: Between<'a>, range: [f64; 2], assumed: [f64; 2]) -> Self {
        let times = || readings.iter().map(|reading| reading.time);
        let time = [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)];
        let placements = pooled(readings, range[1] - range[0]);
        Self { placements, between, temperature: Scale::of(range), time: Scale::of(time), assumed }
    }

    /// Values of the regressors.
    fn values(&self, of: Regressors, celsius: f64, time: f64) -> Vec<f64> {
        let (u, v) = (self.temperature.at(celsius), self.time.at(time));
        let warmth = (1..=of.temperature).map(|degree| u.powi(degree as i32));
        warmth.chain((1..=of.time).map(|degree| v.powi(degree as i32))).collect()
    }

    /// Estimate of the coefficients; `None` if the rests do not determine them.
    pub(super) fn estimate(&self, of: Regressors) -> Option<Estimated> {
        let count = of.temperature + of.time;
        let within = self.within(of);
        let between = match self.between {
            Between::Readings => self.between_readings(of),
            Between::Lengths(lines) => self.between_lengths(of, lines),
        };
        let parts: Vec<_> = within.into_iter().chain(between).collect();
        let mut information = DMatrix::zeros(3 * count, 3 * count);
        let mut moment = DVector::zeros(3 * count);
        let mut left = Vec::new();
        for Estimated { coefficients, covariance, left: own } in parts {
            let own_information = covariance.try_inverse()?;
            moment += &own_information * coefficients;
            information += own_information;
            left.extend(own);
        }
        let covariance = information.cholesky()?.inverse();
        Some(Estimated { coefficients: &covariance * moment, covariance, left })
    }

    /// Changes inside placements, on all axes.
    fn within(&self, of: Regressors) -> Option<Estimated> {
        let span = |placement: &[WarmReading]| {
            let celsius = placement.iter().map(|point| point.celsius);
            celsius.clone().fold(f64::NEG_INFINITY, f64::max) - celsius.fold(f64::INFINITY, f64::min)
        };
        let mut inside: Vec<_> = self.placements.iter().filter(|placement| placement.len() > 1).collect();
        inside.sort_by(|a, b| span(b).total_cmp(&span(a)));
        inside.truncate(MOST_INSIDE);
        let points: Vec<_> =
            inside.iter().enumerate().flat_map(|(own, points)| points.iter().map(move |point| (own, point))).collect();
        let drift = usize::from(of.drift);
        let first = inside.len() + drift;
        let count = of.temperature + of.time;
        // One offset for each placement.
        let mut design = DMatrix::zeros(points.len(), first + count);
        for (row, (own, point)) in points.iter().enumerate() {
            design[(row, *own)] = 1.0;
            if of.drift {
                design[(row, inside.len())] = self.time.at(point.time);
            }
            let values = self.values(of, point.celsius, point.time);
            values.iter().enumerate().for_each(|(k, value)| design[(row, first + k)] = *value);
        }
        let reading = |row: usize, axis| (points[row].1.mean[axis], points[row].1.noise[axis]);
        self.by_axis(&design, (first, drift), count, reading, 0)
    }

    /// Means of placements, axis by axis.
    fn between_readings(&self, of: Regressors) -> Option<Estimated> {
        let means: Vec<_> = self.placements.iter().map(|points| mean(points)).collect();
        let count = of.temperature + of.time;
        let drift = usize::from(of.drift);
        let first = 1 + drift;
        let mut design = DMatrix::zeros(means.len(), first + count);
        for (row, (placement, whole)) in self.placements.iter().zip(&means).enumerate() {
            design[(row, 0)] = 1.0;
            if of.drift {
                design[(row, 1)] = self.time.at(whole.time);
            }
            for point in placement {
                // As the reading is pooled, so are the powers.
                let share = whole.noise.sum() / point.noise.sum().max(f64::MIN_POSITIVE);
                let values = self.values(of, point.celsius, point.time);
                values.iter().enumerate().for_each(|(k, value)| design[(row, first + k)] += share * value);
            }
        }
        self.by_axis(&design, (first, drift), count, |row, axis| (means[row].mean[axis], means[row].noise[axis]), 1)
    }

    /// Solves for each axis by itself; the regressors come after `first` other unknowns, the last of which may be a drift.
    fn by_axis(
        &self,
        design: &DMatrix<f64>,
        (first, drift): (usize, usize),
        count: usize,
        reading: impl Fn(usize, usize) -> (f64, f64),
        kind: usize,
    ) -> Option<Estimated> {
        let mut all = Estimated {
            coefficients: DVector::zeros(3 * count),
            covariance: DMatrix::zeros(3 * count, 3 * count),
            left: Vec::new(),
        };
        for axis in 0..3 {
            let equations = CourseEquations {
                design: design.clone(),
                targets: DVector::from_fn(design.nrows(), |row, _| reading(row, axis).0),
                noise: DVector::from_fn(design.nrows(), |row, _| reading(row, axis).1),
                gain: DVector::repeat(design.nrows(), 1.0),
                first,
                leaks: (drift, self.assumed[0]),
                set: 3 * kind + axis,
            };
            let own = equations.solve(self.assumed[kind])?;
            for i in 0..count {
                all.coefficients[3 * i + axis] = own.coefficients[i];
                for j in 0..count {
                    all.covariance[(3 * i + axis, 3 * j + axis)] = own.covariance[(i, j)];
                }
            }
            all.left.extend(own.left);
        }
        Some(all)
    }

    /// Lengths of an accelerometer's readings, beside its other unknowns.
    fn between_lengths(&self, of: Regressors, lines: &[LengthEquation]) -> Option<Estimated> {
        let count = of.temperature + of.time;
        let (terms, (leaks, leak)) = lines.first().map(|line| (line.by_terms.len(), line.leaks))?;
        let drifts = if of.drift { 3 } else { 0 };
        // Leaks and drifts have one standard deviation, that of the leaks if there are any.
        let (leak, drift) = if leaks > 0 { (leak, self.assumed[0] / leak) } else { (self.assumed[0], 1.0) };
        let first = terms + drifts;
        let design = DMatrix::from_fn(lines.len(), first + 3 * count, |row, column| {
            let line = &lines[row];
            match (column.checked_sub(terms), column.checked_sub(first)) {
                (None, _) => line.by_terms[column],
                (Some(axis), None) => line.by_bias[axis] * self.time.at(line.time) * drift,
                (_, Some(at)) => line.by_bias[at % 3] * self.values(of, line.celsius, line.time)[at / 3],
            }
        });
        let leaks = (leaks + drifts, leak);
        let equations = CourseEquations {
            design,
            targets: DVector::from_iterator(lines.len(), lines.iter().map(|line| line.target)),
            noise: DVector::from_iterator(lines.len(), lines.iter().map(|line| line.noise)),
            gain: DVector::from_iterator(lines.len(), lines.iter().map(|line| line.by_bias.norm_squared())),
            first,
            leaks,
            set: 6,
        };
        equations.solve(self.assumed[1])
    }
}

/// Linear equations about unknowns, of which the coefficients come last.
struct CourseEquations {
    design: DMatrix<f64>,
    targets: DVector<f64>,
    /// Variances from noise alone.
    noise: DVector<f64>,
    /// Variances that a unit of scatter adds.
    gain: DVector<f64>,
    /// Number of the other unknowns, the leaks included.
    first: usize,
    /// Number of leaks at the end of the other unknowns, and their standard deviation.
    leaks: (usize, f64),
    /// Number of the set.
    set: usize,
}

/// Fewest degrees of freedom that say how far to believe the equations.
const LEAST_FREEDOM: usize = 2;

impl CourseEquations {
    /// Solves for the coefficients, with the scatter that the residuals show.
    fn solve(self, assumed: f64) -> Option<Estimated> {
        let (rows, unknowns) = self.design.shape();
        let free = unknowns - self.leaks.0;
        if rows < free + LEAST_FREEDOM {
            return None;
        }
        let (start, ..) = self.weighted(assumed * assumed)?;
        let residuals = &self.targets - &self.design * &start;
        let leak_columns = self.first - self.leaks.0..self.first;
        let others: Vec<_> = (0..unknowns).filter(|column| !leak_columns.contains(column)).collect();
        let leaking: Vec<_> = leak_columns.collect();
        let leaked: DVector<f64> = self.design.select_columns(&leaking)
            * DVector::from_iterator(leaking.len(), leaking.iter().map(|k| start[*k]));
        let block = ResidualBlock {
            design: self.design.select_columns(&others),
            leaks: self.design.select_columns(&leaking),
            residuals: residuals + leaked,
            noise: self.noise.clone(),
            gain: self.gain.clone(),
        };
        let assumed = Assumed { placement: assumed, leak: self.leaks.1 };
        let scatter = PlacementScatter::learn(&[block], assumed);
        let typical = scatter.typical();
        let (solution, inverse, weights) = self.weighted(typical)?;
        let count = unknowns - self.first;
        let coefficients = solution.rows(self.first, count).into_owned();
        let mut covariance = inverse.view((self.first, self.first), (count, count)).into_owned();
        let stretch = DVector::from_fn(count, |k, _| {
            let row = inverse.row(self.first + k) * self.design.transpose();
            let gain: f64 = row
                .iter()
                .zip(&weights)
                .zip(&self.gain)
                .map(|((entry, weight), gain)| (entry * weight).powi(2) * gain)
                .sum();
            let whole = covariance[(k, k)].max(f64::MIN_POSITIVE);
            scatter.std(gain, (whole - gain * typical).max(0.0), 0.0) / whole.sqrt()
        });
        for i in 0..count {
            for j in 0..count {
                covariance[(i, j)] *= stretch[i] * stretch[j];
            }
        }
        // The same weights for every hypothesis, so that their squares compare.
        let usual = self.noise.mean();
        let left = &self.targets - &self.design * &solution;
        let squares = left.iter().zip(&self.noise).map(|(left, noise)| left * left / (noise + usual)).sum();
        Some(Estimated { coefficients, covariance, left: vec![(self.set, squares, (rows - free) as f64)] })
    }

    /// Weighted least squares at a variance of the scatter: solution, inverse of the information, weights.
    fn weighted(&self, between: f64) -> Option<(DVector<f64>, DMatrix<f64>, DVector<f64>)> {
        let weights = self.noise.zip_map(&self.gain, |noise, gain| 1.0 / (noise + gain * between));
        if !weights.iter().all(|weight| weight.is_finite() && *weight > 0.0) {
            return None;
        }
        let mut weighted = self.design.clone();
        weighted.row_iter_mut().zip(&weights).for_each(|(mut row, weight)| row *= *weight);
        let mut information = weighted.tr_mul(&self.design);
        for k in self.first - self.leaks.0..self.first {
            information[(k, k)] += self.leaks.1.max(1e-9).powi(-2);
        }
        // Columns may differ by orders of magnitude.
        let scale = information.diagonal().map(|entry| entry.max(f64::MIN_POSITIVE).sqrt());
        let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| information[(i, j)] / (scale[i] * scale[j]));
        let eigen = scaled.clone().symmetric_eigenvalues();
        if eigen.min() < NOTHING * eigen.max() {
            return None;
        }
        let inverse = scaled.cholesky()?.inverse();
        let inverse = DMatrix::from_fn(scale.len(), scale.len(), |i, j| inverse[(i, j)] / (scale[i] * scale[j]));
        let solution = &inverse * weighted.tr_mul(&self.targets);
        Some((solution, inverse, weights))
    }
}
