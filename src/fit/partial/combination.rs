//! Combinations that are known: single parameters, then what each direction tells of the others.

use nalgebra::{DVector, SVector};

use super::posterior::{Cluster, PARAMETERS, Posterior, Problem};
use super::shown::{Disagreement, Shown};
use crate::fit::accelerometer::Assumptions;
use crate::fit::parameterisation::{Parameterisation, Term};

/// Sum of parameters that is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Combination {
    /// Coefficients of the biases, then of S row by row.
    pub coefficients: SVector<f64, PARAMETERS>,
    /// Sum of coefficients times parameters, m/s²; dimensionless without a bias in it.
    pub value: f64,
    /// Standard deviation: 1.96 of them are half of the 95 % interval.
    pub std: f64,
}

/// Largest share of the assumed standard deviation, and largest standard deviation in m/s², with which a combination is
/// known by its placements.
const KNOWN: f64 = 1.0 / 3.0;
const MOST: f64 = 0.2;
/// Least share of a combination that the others do not tell already.
const NEW: f64 = 0.2;
/// Parts of a direction below this are left out of its combination; its interval allows for them.
const SMALL: f64 = 0.05;

/// Finds the combinations that the placements determine. The normals of faces are off by `tilt` about each of two axes,
/// rad, one standard deviation.
///
/// # Errors
/// If placements in one direction contradict each other.
pub fn combinations(shown: &[Shown], given: &Assumptions<'_>, tilt: f64) -> Result<Vec<Combination>, Disagreement> {
    let problem = Problem::new(shown, given, tilt);
    if problem.directions.is_empty() {
        return Ok(Vec::new());
    }
    match problem.solve()? {
        Some(posterior) if problem.is_within_bounds(&posterior) => Ok(problem.known(&posterior)),
        _ => Ok(Vec::new()),
    }
}

impl Problem<'_> {
    /// Combinations that are known: single parameters, then what each direction tells of the others.
    fn known(&self, posterior: &Posterior) -> Vec<Combination> {
        let has = |term: Term| match term {
            Term::Own(row, column) => row == column || self.given.shape == Parameterisation::MATRIX,
            _ => true,
        };
        let mut found = Vec::new();
        let mut alone = [false; PARAMETERS];
        for (i, term) in Parameterisation::MATRIX.terms().iter().enumerate().filter(|(_, term)| has(**term)) {
            let mut coefficients = SVector::<f64, PARAMETERS>::zeros();
            coefficients[i] = 1.0;
            let most = if matches!(term, Term::Bias(_)) { MOST } else { MOST / self.given.gravity.value };
            let known = self.sum(posterior, coefficients, most);
            alone[i] = known.is_some();
            found.extend(known);
        }
        let mut basis: Vec<SVector<f64, PARAMETERS>> = Vec::new();
        for direction in &self.directions {
            for mut coefficients in self.told(direction) {
                (0..PARAMETERS).filter(|i| alone[*i]).for_each(|i| coefficients[i] = 0.0);
                let whole = coefficients.component_mul(&self.width.fixed_rows::<PARAMETERS>(0));
                let new = basis.iter().fold(whole, |left, known| left - known * known.dot(&left));
                if new.norm() <= NEW * whole.norm() {
                    continue;
                }
                if let Some(known) = self.sum(posterior, coefficients, MOST) {
                    basis.push(new.normalize());
                    found.push(known);
                }
            }
        }
        found
    }

    /// Evidence of placements in a direction: the length of gravity; on an accurate fixture, each axis' part of it.
    fn told(&self, direction: &Cluster) -> Vec<SVector<f64, PARAMETERS>> {
        let gravity = self.given.gravity.value;
        let up =
            direction.normal.or(self.given.start.correct(&direction.mean()).try_normalize(0.0)).unwrap_or_default();
        let up = up.map(|part| if part.abs() < SMALL { 0.0 } else { part });
        if self.given.shape == Parameterisation::MATRIX {
            let axis = |axis: usize| {
                let mut coefficients = SVector::<f64, PARAMETERS>::zeros();
                coefficients[axis] = 1.0;
                (0..3).for_each(|column| coefficients[3 + 3 * axis + column] = up[column] * gravity + 0.0);
                coefficients
            };
            return (0..3).map(axis).collect();
        }
        let mut coefficients = SVector::<f64, PARAMETERS>::zeros();
        // The first coefficient is positive.
        let sign = up.iter().find(|part| **part != 0.0).map_or(1.0, |part| part.signum());
        for axis in 0..3 {
            // Zeros have no sign.
            coefficients[axis] = sign * up[axis] + 0.0;
            coefficients[3 + 4 * axis] = sign * up[axis] * up[axis] * gravity + 0.0;
        }
        vec![coefficients]
    }

    /// Sum of parameters, if it is known to `most`, and better than it is assumed.
    fn sum(&self, posterior: &Posterior, coefficients: SVector<f64, PARAMETERS>, most: f64) -> Option<Combination> {
        let Posterior { z, covariance, equations, scatter } = posterior;
        let mut weights = DVector::zeros(self.unknowns());
        (0..PARAMETERS).for_each(|i| weights[i] = coefficients[i] * self.width[i]);
        let influence = covariance * &weights;
        let between = scatter.typical();
        let by_placements = equations.iter().map(|equation| {
            (equation.row.dot(&influence) / (equation.noise + equation.gain * between)).powi(2) * equation.gain
        });
        let gain: f64 = by_placements.sum();
        let rest = (weights.dot(&influence) - gain * between).max(0.0);
        // Only what placements add was estimated, and has the quantile of Student.
        let std = libm::hypot(scatter.std(gain, 0.0, 0.0), rest.sqrt());
        let value = coefficients.dot(&self.values(z).fixed_rows::<PARAMETERS>(0));
        (std <= most && std <= KNOWN * weights.norm()).then_some(Combination { coefficients, value, std })
    }
}
