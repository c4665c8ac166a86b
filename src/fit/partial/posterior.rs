//! Likeliest parameters of an accelerometer by a few placements and what is assumed of any sensor.

use nalgebra::{DMatrix, DVector, Matrix2, SVector, Vector3};

use super::shown::{Disagreement, Shown};
use crate::fit::accelerometer::{Assumptions, Observation};
use crate::fit::bound::Bounds;
use crate::fit::calibration::Calibration;
use crate::fit::parameterisation::{Parameterisation, Term};
use crate::fit::placement_scatter::{Assumed, PlacementScatter};
use crate::fit::residual_block::ResidualBlock;

/// Number of parameters in a combination: biases, then S row by row, as in [`Parameterisation::MATRIX`].
pub(super) const PARAMETERS: usize = 12;
/// Index of gravity among the unknowns, and of the first quadratic sensitivity; then one of each direction.
const GRAVITY: usize = PARAMETERS;
const SQUARES: usize = GRAVITY + 1;
const SHARED: usize = SQUARES + 3;
/// Most directions that are looked at.
const DIRECTIONS: usize = 24;
/// Largest angle between placements of one direction that lie on no face, rad.
const TOGETHER: f64 = 0.17;
/// Differences between placements below this contradict nothing, m/s².
const ALLOWANCE: f64 = 0.03;

/// Placements in one direction.
pub(super) struct Cluster {
    /// Normal of the face; `None` of placements on none.
    pub(super) normal: Option<Vector3<f64>>,
    members: Vec<Observation>,
}

impl Cluster {
    pub(super) fn mean(&self) -> Vector3<f64> {
        self.members.iter().map(|seen| seen.mean).sum::<Vector3<f64>>() / self.members.len() as f64
    }
}

/// Unknowns in units of their assumed standard deviations, about the assumed values.
pub(super) struct Problem<'a> {
    pub(super) given: &'a Assumptions<'a>,
    tilt: f64,
    pub(super) directions: Vec<Cluster>,
    centre: SVector<f64, SHARED>,
    pub(super) width: SVector<f64, SHARED>,
}

/// Linear equation `row · z = target`.
pub(super) struct Equation {
    pub(super) row: DVector<f64>,
    target: f64,
    residual: f64,
    /// Variance from noise, and what a unit of variance between placements adds to it.
    pub(super) noise: f64,
    pub(super) gain: f64,
    /// Cluster, if it is the length of a placement.
    of: Option<usize>,
}

/// Likeliest unknowns, their covariance, and the equations that they come from.
pub(super) struct Posterior {
    pub(super) z: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    pub(super) equations: Vec<Equation>,
    pub(super) scatter: PlacementScatter,
}

/// Lengthening of each direction by errors across it, m/s²: half of their squares over the length.
struct Lost {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Lost {
    fn nothing(directions: usize) -> Self {
        Self { mean: DVector::zeros(directions), covariance: DMatrix::zeros(directions, directions) }
    }

    /// Root R of the covariance, R Rᵀ.
    fn root(&self) -> DMatrix<f64> {
        if !self.covariance.iter().all(|entry| entry.is_finite()) {
            // No step follows from it.
            return self.covariance.clone();
        }
        let eigen = self.covariance.clone().symmetric_eigen();
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        eigen.eigenvectors * DMatrix::from_diagonal(&roots)
    }
}

impl<'a> Problem<'a> {
    pub(super) fn new(shown: &[Shown], given: &'a Assumptions<'a>, tilt: f64) -> Self {
        let mut directions: Vec<(Option<usize>, Cluster)> = Vec::new();
        for placement in shown {
            let seen = placement.observation;
            let is_near = |other: &Observation| other.mean.angle(&seen.mean) <= TOGETHER;
            let is_it = |(face, direction): &(Option<usize>, Cluster)| match placement.face {
                None => face.is_none() && direction.members.iter().any(is_near),
                on_face => *face == on_face,
            };
            match directions.iter().position(is_it) {
                Some(known) => directions[known].1.members.push(seen),
                None if directions.len() < DIRECTIONS => {
                    let normal = placement.face.map(|_| seen.normal);
                    directions.push((placement.face, Cluster { normal, members: vec![seen] }));
                }
                None => {}
            }
        }
        directions.sort_by_key(|(face, _)| face.unwrap_or(usize::MAX));
        let (mut centre, mut width) = (SVector::<f64, SHARED>::zeros(), SVector::<f64, SHARED>::zeros());
        for (i, term) in Parameterisation::MATRIX.terms().iter().enumerate() {
            (centre[i], width[i]) = match *term {
                Term::Own(row, column) if row != column && given.shape != Parameterisation::MATRIX => {
                    (0.0, given.cross_axis_std)
                }
                term => assumed(given.bounds, term),
            };
        }
        (centre[GRAVITY], width[GRAVITY]) = (given.gravity.value, given.gravity.std);
        width.fixed_rows_mut::<3>(SQUARES).fill(given.nonlinearity);
        let directions = directions.into_iter().map(|(_, direction)| direction).collect();
        Self { given, tilt, directions, centre, width }
    }

    pub(super) fn unknowns(&self) -> usize {
        SHARED + self.directions.len()
    }

    pub(super) fn values(&self, z: &DVector<f64>) -> SVector<f64, SHARED> {
        SVector::from_fn(|i, _| self.centre[i] + self.width[i] * z[i])
    }

    /// Solves for the unknowns. `None` if the iteration does not settle.
    pub(super) fn solve(&self) -> Result<Option<Posterior>, Disagreement> {
        const ROUNDS: usize = 24;
        const NEAR: usize = 2;
        const SETTLED: usize = 4;
        const ENOUGH: f64 = 1e-6;
        let start = Parameterisation::MATRIX.vector(&self.given.start);
        let mut z = DVector::from_fn(self.unknowns(), |i, _| match i {
            i if i < PARAMETERS && self.width[i] > 0.0 => (start[i] - self.centre[i]) / self.width[i],
            _ => 0.0,
        });
        let mut lost = Lost::nothing(self.directions.len());
        let mut scatter = PlacementScatter::assumed(self.given.placement_std);
        for round in 0..ROUNDS {
            let equations = self.equations(&z, &lost);
            match round {
                // Later, readings that contradict each other would have tilted the sensor.
                NEAR => self.agree(&equations)?,
                SETTLED => scatter = self.scatter(&equations),
                _ => {}
            }
            let Some((next, covariance)) = self.step(&equations, scatter.typical()) else { return Ok(None) };
            if !next.iter().all(|unknown| unknown.is_finite()) {
                return Ok(None);
            }
            let moved = (&next - &z).rows(0, SHARED).amax();
            z = next;
            let before = std::mem::replace(&mut lost, self.lost(&z, &covariance));
            let changed = (&lost.mean - before.mean).amax().max((&lost.covariance - before.covariance).amax());
            if round > SETTLED && moved.max(changed) < ENOUGH {
                return Ok(Some(Posterior { z, covariance, equations, scatter }));
            }
        }
        Ok(None)
    }

    /// Equations at the unknowns `z`, with what errors across each direction add to its length.
    fn equations(&self, z: &DVector<f64>, lost: &Lost) -> Vec<Equation> {
        let root = lost.root();
        let added = &lost.mean + &root * z.rows(SHARED, self.directions.len());
        let x = self.values(z);
        let calibration = calibration(&x);
        let inverse = calibration.inverse();
        let mut equations = Vec::new();
        for (d, direction) in self.directions.iter().enumerate() {
            for seen in &direction.members {
                let force = self.force(&x, &calibration, &seen.mean);
                let length = force.norm();
                let by_measured = inverse.transpose() * (force / length.max(f64::MIN_POSITIVE));
                let mut row = self.row(&by_measured, &force);
                row[GRAVITY] = -self.width[GRAVITY];
                (0..self.directions.len()).for_each(|k| row[SHARED + k] = root[(d, k)]);
                let residual = length - x[GRAVITY] + added[d];
                let noise = by_measured.component_mul(&by_measured).dot(&seen.noise);
                let target = row.dot(z) - residual;
                equations.push(Equation {
                    row,
                    target,
                    residual,
                    noise,
                    gain: by_measured.norm_squared(),
                    of: Some(d),
                });
            }
            let Some(normal) = direction.normal else { continue };
            let force = self.force(&x, &calibration, &direction.mean());
            for across in across(&normal) {
                let row = self.row(&(inverse.transpose() * across), &force);
                let residual = across.dot(&force);
                let target = row.dot(z) - residual;
                let noise = (self.given.gravity.value * self.tilt).powi(2) + self.given.placement_std.powi(2);
                equations.push(Equation { row, target, residual, noise, gain: 0.0, of: None });
            }
        }
        equations
    }

    /// True specific force of a reading.
    fn force(&self, x: &SVector<f64, SHARED>, calibration: &Calibration, measured: &Vector3<f64>) -> Vector3<f64> {
        let first = calibration.correct(measured) / self.given.gravity.value;
        let squares = x.fixed_rows::<3>(SQUARES).component_mul(&first.component_mul(&first));
        calibration.correct(&(measured - squares))
    }

    /// Derivative of `by_measured · measured` with respect to the unknowns that reading and force share. The force is as
    /// long as gravity: the errors of its reading are no regressors.
    fn row(&self, by_measured: &Vector3<f64>, force: &Vector3<f64>) -> DVector<f64> {
        let force = force * (self.given.gravity.value / force.norm().max(f64::MIN_POSITIVE));
        let mut row = DVector::zeros(self.unknowns());
        for axis in 0..3 {
            row[axis] = -by_measured[axis] * self.width[axis];
            for column in 0..3 {
                row[3 + 3 * axis + column] = -by_measured[axis] * force[column] * self.width[3 + 3 * axis + column];
            }
            let square = (force[axis] / self.given.gravity.value).powi(2);
            row[SQUARES + axis] = -by_measured[axis] * square * self.width[SQUARES + axis];
        }
        row
    }

    /// Solution of the equations beside the assumptions, and its covariance.
    fn step(&self, equations: &[Equation], between: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut information = DMatrix::identity(self.unknowns(), self.unknowns());
        let mut moment = DVector::zeros(self.unknowns());
        for equation in equations {
            let weight = 1.0 / (equation.noise + equation.gain * between);
            information.ger(weight, &equation.row, &equation.row, 1.0);
            moment.axpy(weight * equation.target, &equation.row, 1.0);
        }
        let factor = information.cholesky()?;
        Some((factor.solve(&moment), factor.inverse()))
    }

    /// Lengthening of each direction by errors across it.
    fn lost(&self, z: &DVector<f64>, covariance: &DMatrix<f64>) -> Lost {
        let x = self.values(z);
        let calibration = calibration(&x);
        let inverse = calibration.inverse();
        let of = |direction: &Cluster| {
            let force = self.force(&x, &calibration, &direction.mean());
            let length = force.norm().max(f64::MIN_POSITIVE);
            let rows = across(&(force / length)).map(|across| self.row(&(inverse.transpose() * across), &force));
            (rows, length)
        };
        let all: Vec<_> = self.directions.iter().map(of).collect();
        let error = |k: usize, l: usize| {
            Matrix2::from_fn(|i, j| all[k].0[i].dot(&(covariance * &all[l].0[j]))) / (all[k].1 * all[l].1).sqrt()
        };
        Lost {
            mean: DVector::from_fn(all.len(), |k, _| error(k, k).trace() / 2.0),
            covariance: DMatrix::from_fn(all.len(), all.len(), |k, l| error(k, l).norm_squared() / 2.0),
        }
    }

    /// Differences of the lengths of placements from their mean in each direction.
    fn differences(&self, equations: &[Equation]) -> ResidualBlock {
        let lengths: Vec<_> = equations.iter().filter_map(|equation| Some((equation, equation.of?))).collect();
        let (rows, columns) = (lengths.len(), self.directions.len());
        let column = |of: &dyn Fn(&Equation) -> f64| {
            DVector::from_iterator(rows, lengths.iter().map(|(equation, _)| of(equation)))
        };
        let design = DMatrix::from_fn(rows, columns, |r, c| if lengths[r].1 == c { 1.0 } else { 0.0 });
        let residuals = column(&|equation| equation.residual);
        let counts = design.row_sum().transpose();
        let means = design.tr_mul(&residuals).component_div(&counts);
        ResidualBlock {
            residuals: residuals - &design * means,
            design,
            leaks: DMatrix::zeros(rows, 0),
            noise: column(&|equation| equation.noise),
            gain: column(&|equation| equation.gain),
        }
    }

    /// Checks that placements in one direction agree.
    fn agree(&self, equations: &[Equation]) -> Result<(), Disagreement> {
        let block = self.differences(equations);
        let spare = block.residuals.len().saturating_sub(self.directions.len()).max(1);
        let rms = (block.residuals.norm_squared() / spare as f64).sqrt();
        let limit = (5.0 * (block.noise.mean() + self.given.placement_std.powi(2)).sqrt()).max(ALLOWANCE);
        if rms > limit { Err(Disagreement { rms, limit }) } else { Ok(()) }
    }

    /// Scatter of the placements within their directions.
    fn scatter(&self, equations: &[Equation]) -> PlacementScatter {
        let assumed = Assumed { placement: self.given.placement_std, leak: 0.0 };
        PlacementScatter::learn(&[self.differences(equations)], assumed)
    }

    /// Whether bias and scale may be such as the bounds allow.
    pub(super) fn is_within_bounds(&self, posterior: &Posterior) -> bool {
        /// Standard deviations by which a parameter may lie beyond its bound.
        const BEYOND: f64 = 2.0;
        let x = self.values(&posterior.z);
        Parameterisation::MATRIX.terms().iter().enumerate().all(|(i, term)| {
            let [low, high] = self.given.bounds.accelerometer(*term);
            let allowed = BEYOND * self.width[i] * posterior.covariance[(i, i)].max(0.0).sqrt();
            let is_cross = matches!(term, Term::Own(row, column) if row != column);
            is_cross || (low - allowed..=high + allowed).contains(&x[i])
        })
    }
}

/// Middle of the bounds of a parameter, and the standard deviation of a value that may be anywhere between them.
fn assumed(bounds: &Bounds, term: Term) -> (f64, f64) {
    let [low, high] = bounds.accelerometer(term);
    let [low, high] =
        if low.is_finite() && high.is_finite() { [low, high] } else { Bounds::default().accelerometer(term) };
    ((low + high) / 2.0, (high - low).max(0.0) / 12_f64.sqrt())
}

fn calibration(x: &SVector<f64, SHARED>) -> Calibration {
    Parameterisation::MATRIX.calibration(&DVector::from_column_slice(&x.as_slice()[..PARAMETERS]))
}

/// Two directions across a third one, and across each other.
fn across(up: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    [first, up.cross(&first)]
}
