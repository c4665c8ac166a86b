//! Bounded regression with Huber's loss: rows beyond a threshold count by their distance, not by its square, so that a
//! few wrong ones cannot carry the solution away (Huber, "Robust estimation of a location parameter", 1964).
//!
//! Solved as a conic program (Mangasarian and Musicant 2000): minimise ½‖u‖² + δ Σ v over x, u, v with −v ≤ A x − b − u
//! ≤ v. The interior-point solver finds the rows beyond the threshold; with those known, a least squares gives the last
//! digits, and its residuals are checked to select the same rows.

use nalgebra::{DMatrix, DVector};

use super::error::Error;
use super::lsqlin::{Solution, lsqlin};
use super::quadratic_program::QuadraticProgram;

/// Minimises Σ ρ(a x − b) with `lower ≤ x ≤ upper`, where ρ(r) is r²/2 up to `delta` and δ(|r| − δ/2) beyond.
///
/// # Errors
/// As [`lsqlin`]; the rows within the threshold alone must determine the unknowns.
pub fn huber(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
    delta: f64,
) -> Result<Solution, Error> {
    let squares = lsqlin(a, b, lower, upper)?;
    let residuals = a * &squares.x - b;
    if residuals.amax() <= delta {
        return Ok(squares);
    }
    let start = conic(a, b, lower, upper, delta)?;
    match polish(a, b, lower, upper, delta, start.clone()) {
        // Bounds may hold the solution where too few rows are within the threshold to solve.
        Err(Error::Singular(_) | Error::NotConverged) => reweighted(a, b, lower, upper, delta, start),
        solved => solved,
    }
}

/// Weight of each row, one within the threshold: that of a least squares with the same minimum.
pub fn weights(residuals: &DVector<f64>, delta: f64) -> DVector<f64> {
    residuals.map(|residual| if residual.abs() <= delta { 1.0 } else { delta / residual.abs() })
}

/// Solves with the rows beyond the threshold known, until they stay the same.
fn polish(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
    delta: f64,
    start: DVector<f64>,
) -> Result<Solution, Error> {
    const ROUNDS: usize = 50;
    // Rows at the threshold may fall on either side without moving the solution.
    const AT: f64 = 1e-9;
    let side = |r: f64, margin: f64| if r.abs() <= delta + margin { 0.0 } else { r.signum() };
    let mut sides = (a * &start - b).map(|residual| side(residual, 0.0));
    for _ in 0..ROUNDS {
        // Quadratic within the threshold; a row beyond it pulls with a constant force.
        let within: Vec<usize> = (0..sides.len()).filter(|&i| sides[i] == 0.0).collect();
        let (inner, target) = (a.select_rows(&within), b.select_rows(&within));
        if inner.nrows() < inner.ncols() {
            return Err(Error::Singular(f64::INFINITY));
        }
        let pull = inner.tr_mul(&target) - a.tr_mul(&sides) * delta;
        let triangle = inner.qr().unpack_r();
        let target = triangle.tr_solve_upper_triangular(&pull).ok_or(Error::Singular(f64::INFINITY))?;
        let solution = lsqlin(&triangle, &target, lower, upper)?;
        let residuals = a * &solution.x - b;
        let agrees = residuals.iter().zip(&sides).all(|(residual, was)| {
            let (strict, loose) = (side(*residual, -AT * delta), side(*residual, AT * delta));
            *was == strict || *was == loose
        });
        if agrees {
            return Ok(solution);
        }
        sides = residuals.map(|residual| side(residual, 0.0));
    }
    Err(Error::NotConverged)
}

/// Iteratively reweighted least squares: slow from afar, but the start is near.
fn reweighted(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
    delta: f64,
    start: DVector<f64>,
) -> Result<Solution, Error> {
    const ROUNDS: usize = 500;
    const ENOUGH: f64 = 1e-12;
    let mut x = start;
    for _ in 0..ROUNDS {
        let weights = weights(&(a * &x - b), delta).map(f64::sqrt);
        let (mut design, target) = (a.clone(), b.component_mul(&weights));
        design.row_iter_mut().zip(&weights).for_each(|(mut row, weight)| row *= *weight);
        let solution = lsqlin(&design, &target, lower, upper)?;
        if (&solution.x - &x).amax() <= ENOUGH * x.amax() {
            return Ok(solution);
        }
        x = solution.x;
    }
    Err(Error::NotConverged)
}

fn conic(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
    delta: f64,
) -> Result<DVector<f64>, Error> {
    let (rows, unknowns) = a.shape();
    // Columns of unit length and residuals in units of the threshold let one tolerance fit every problem.
    let scale = DVector::from_iterator(unknowns, a.column_iter().map(|column| column.norm()));
    let total = unknowns + 2 * rows;
    let mut quadratic = vec![vec![0.0; total]; total];
    let mut linear = vec![0.0; total];
    for i in 0..rows {
        quadratic[unknowns + i][unknowns + i] = 1.0;
        linear[unknowns + rows + i] = 1.0;
    }
    let mut program = QuadraticProgram::new(quadratic, linear);
    for i in 0..rows {
        for sign in [1.0, -1.0] {
            // ±(a x − b − u) ≤ v.
            let mut row = vec![0.0; total];
            (0..unknowns).for_each(|j| row[j] = sign * a[(i, j)] / scale[j]);
            row[unknowns + i] = -sign;
            row[unknowns + rows + i] = -1.0;
            program.push(row, sign * b[i] / delta);
        }
    }
    // A bound further away than any solution only spoils the scaling.
    const FAR: f64 = 1e6;
    program.bound(&(lower.component_mul(&scale) / delta), &(upper.component_mul(&scale) / delta), FAR);
    let found = program.minimise()?;
    Ok(found.rows(0, unknowns).component_div(&scale) * delta)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn objective(a: &DMatrix<f64>, b: &DVector<f64>, x: &DVector<f64>, delta: f64) -> f64 {
        let cost = |r: f64| if r.abs() <= delta { r * r / 2.0 } else { delta * (r.abs() - delta / 2.0) };
        (a * x - b).iter().map(|r| cost(*r)).sum()
    }

    /// Reweighted least squares from the plain one on.
    fn from_afar(
        a: &DMatrix<f64>,
        b: &DVector<f64>,
        low: &DVector<f64>,
        high: &DVector<f64>,
        delta: f64,
    ) -> DVector<f64> {
        let mut x = lsqlin(a, b, low, high).unwrap().x;
        for _ in 0..2000 {
            let weights = weights(&(a * &x - b), delta).map(f64::sqrt);
            let (mut design, target) = (a.clone(), b.component_mul(&weights));
            design.row_iter_mut().zip(&weights).for_each(|(mut row, weight)| row *= *weight);
            x = lsqlin(&design, &target, low, high).unwrap().x;
        }
        x
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn agrees_with_reweighted_least_squares(
            a in proptest::collection::vec(-1.0..1.0, 14 * 3),
            noise in proptest::collection::vec(-0.2..0.2, 14),
            gross in proptest::collection::vec(-5.0..5.0, 3),
            half in 0.2..3.0_f64,
        ) {
            let a = DMatrix::from_vec(14, 3, a);
            let mut b: DVector<f64> = &a * DVector::from_vec(vec![0.5, -1.0, 1.5]) + DVector::from_vec(noise);
            (0..3).for_each(|i| b[4 * i] += gross[i]);
            let (low, high) = (DVector::repeat(3, -half), DVector::repeat(3, half));
            prop_assume!(a.singular_values().min() > 0.5);
            let solution = huber(&a, &b, &low, &high, 0.1).unwrap();
            let expected = from_afar(&a, &b, &low, &high, 0.1);
            prop_assert!((&solution.x - &expected).amax() < 1e-6, "{} {expected}", solution.x);
            prop_assert!(objective(&a, &b, &solution.x, 0.1) <= objective(&a, &b, &expected, 0.1) + 1e-12);
        }
    }

    #[test]
    fn one_wrong_row_hardly_moves_the_solution() {
        let a = DMatrix::from_fn(8, 1, |_, _| 1.0);
        let mut b = DVector::from_fn(8, |i, _| 0.01 * i as f64);
        b[0] = 50.0;
        let wide = DVector::repeat(1, f64::INFINITY);
        let robust = huber(&a, &b, &-&wide, &wide, 0.05).unwrap().x[0];
        let squares = lsqlin(&a, &b, &-&wide, &wide).unwrap().x[0];
        assert!((robust - 0.04).abs() < 0.02 && squares > 6.0, "{robust} {squares}");
    }
}
