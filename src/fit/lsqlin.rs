//! Bounded linear least squares, like MATLAB's `lsqlin` with bounds only, by the interior-point solver clarabel.
//!
//! The solver reports a singular problem as solved and invents its values, so rank and optimality are checked here. It
//! runs only where the active bounds are not obvious. An unbounded minimiser inside the bounds is the minimiser, and
//! the decomposition that the rank check needs anyway gives it to the last digit. Clipped to the bounds, it mostly
//! shows which of them are active; the Karush–Kuhn–Tucker conditions tell whether it did.

use nalgebra::{DMatrix, DVector};

use super::error::Error;
use super::quadratic_program::QuadraticProgram;

/// Minimiser of a bounded least squares.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Values at the minimum.
    pub x: DVector<f64>,
    /// Upper triangle of the design, its columns scaled to unit length.
    triangle: DMatrix<f64>,
    /// Unknowns held back by a bound.
    pub active: Vec<usize>,
}

impl Solution {
    /// Condition number of the design, its columns scaled to unit length.
    pub fn condition(&self) -> f64 {
        condition(&self.triangle.singular_values())
    }
}

/// Largest condition number: beyond it, twelve of sixteen digits would be lost to the design alone.
const MAX_CONDITION: f64 = 1e6;

/// Minimises ‖a x − b‖² with `lower ≤ x ≤ upper`. The caller weights the rows.
///
/// `a` is m × n with m ≥ n, `b` has m rows, the bounds have n; an infinite bound is no bound.
///
/// # Errors
/// See [`Error`].
pub fn lsqlin(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    lower: &DVector<f64>,
    upper: &DVector<f64>,
) -> Result<Solution, Error> {
    let finite = a.iter().chain(b.iter()).all(|v| v.is_finite());
    let fits = b.nrows() == a.nrows() && lower.nrows() == a.ncols() && upper.nrows() == a.ncols();
    if !finite || !fits || lower.iter().zip(upper).any(|(l, u)| l.is_nan() || u.is_nan() || l > u) {
        return Err(Error::Invalid);
    }
    // Columns of unit length and a residual of order one make one tolerance fit every problem.
    let scale = DVector::from_iterator(a.ncols(), a.column_iter().map(|c| c.norm()));
    if scale.iter().any(|s| *s <= 0.0) {
        return Err(Error::Singular(f64::INFINITY));
    }
    if a.nrows() < a.ncols() {
        return Err(Error::Singular(f64::INFINITY));
    }
    let mut design = a.clone();
    for (mut column, s) in design.column_iter_mut().zip(&scale) {
        column /= *s;
    }
    let magnitude = b.amax().max(f64::MIN_POSITIVE);
    let mut target = b / magnitude;
    // Reduces the rows to as many as there are unknowns.
    let triangle = design.qr();
    triangle.q_tr_mul(&mut target);
    let design = triangle.unpack_r();
    let target = target.rows(0, design.ncols()).into_owned();
    check_rank(&design)?;
    let (low, high) = (lower.component_mul(&scale) / magnitude, upper.component_mul(&scale) / magnitude);

    let free = design.solve_upper_triangular(&target).ok_or(Error::Singular(f64::INFINITY))?;
    let inside = free.iter().zip(low.iter().zip(&high)).all(|(x, (l, u))| *l <= *x && *x <= *u);
    let scaled = if inside {
        free
    } else {
        let cut = free.zip_zip_map(&low, &high, |x, l, u| x.clamp(l, u));
        polish(&design, &target, &low, &high, cut)
            .or_else(|_| polish(&design, &target, &low, &high, interior_point(&design, &target, &low, &high)?))?
    };

    let active = (0..scaled.len()).filter(|&i| scaled[i] <= low[i] || scaled[i] >= high[i]).collect();
    Ok(Solution { x: scaled.component_div(&scale) * magnitude, triangle: design, active })
}

/// Checks that a triangle determines the unknowns.
fn check_rank(triangle: &DMatrix<f64>) -> Result<(), Error> {
    let inverse = triangle.solve_upper_triangular(&DMatrix::identity(triangle.nrows(), triangle.ncols()));
    // Frobenius norms never make the condition number smaller than it is, and are cheaper.
    if inverse.is_some_and(|inverse| triangle.norm() * inverse.norm() <= MAX_CONDITION) {
        return Ok(());
    }
    let condition = condition(&triangle.singular_values());
    if condition <= MAX_CONDITION { Ok(()) } else { Err(Error::Singular(condition)) }
}

/// Condition number: ratio of the largest to the smallest singular value.
fn condition(singular_values: &DVector<f64>) -> f64 {
    singular_values.max() / singular_values.min()
}

fn interior_point(
    design: &DMatrix<f64>,
    target: &DVector<f64>,
    low: &DVector<f64>,
    high: &DVector<f64>,
) -> Result<DVector<f64>, Error> {
    // A bound that far from a solution of order one only spoils the scaling.
    const FAR: f64 = 1e3;
    let linear: Vec<f64> = (-design.tr_mul(target)).iter().copied().collect();
    let mut program = QuadraticProgram::new(rows(&design.tr_mul(design)), linear);
    program.bound(low, high, FAR);
    program.minimise()
}

/// Refines a point near the minimiser to the minimiser: the bounds it is at become equations, the rest is solved by
/// decomposition, and the Karush–Kuhn–Tucker conditions are checked. A bound whose gradient has the wrong sign is
/// released.
fn polish(
    design: &DMatrix<f64>,
    target: &DVector<f64>,
    low: &DVector<f64>,
    high: &DVector<f64>,
    start: DVector<f64>,
) -> Result<DVector<f64>, Error> {
    const NEAR: f64 = 1e-5;
    const GRADIENT: f64 = 1e-9;
    let n = design.ncols();
    let mut at: Vec<Option<f64>> = (0..n)
        .map(|i| match start[i] {
            x if x - low[i] < NEAR => Some(low[i]),
            x if high[i] - x < NEAR => Some(high[i]),
            _ => None,
        })
        .collect();
    for _ in 0..3 * n {
        let x = solve_with(design, target, &at)?;
        if let Some(i) = (0..n).find(|&i| at[i].is_none() && (x[i] < low[i] || x[i] > high[i])) {
            at[i] = Some(if x[i] < low[i] { low[i] } else { high[i] });
            continue;
        }
        let gradient = design.tr_mul(&(design * &x - target));
        // At a lower bound the objective must not decrease inwards, that is, upwards.
        let inward = |i: usize| if at[i] == Some(low[i]) { -gradient[i] } else { gradient[i] };
        let wrong = |i: &usize| at[*i].is_some() && low[*i] < high[*i] && inward(*i) > GRADIENT;
        match (0..n).filter(wrong).max_by(|&i, &j| inward(i).total_cmp(&inward(j))) {
            Some(i) => at[i] = None,
            None => return Ok(x),
        }
    }
    Err(Error::NotConverged)
}

/// Least squares with some unknowns given.
fn solve_with(design: &DMatrix<f64>, target: &DVector<f64>, given: &[Option<f64>]) -> Result<DVector<f64>, Error> {
    let mut x = DVector::from_iterator(given.len(), given.iter().map(|g| g.unwrap_or(0.0)));
    let free: Vec<usize> = (0..given.len()).filter(|&i| given[i].is_none()).collect();
    if !free.is_empty() {
        let rest = target - design * &x;
        let triangle = design.select_columns(&free).qr();
        let mut target = rest;
        triangle.q_tr_mul(&mut target);
        let target = target.rows(0, free.len());
        let solved = triangle.unpack_r().solve_upper_triangular(&target).ok_or(Error::NotConverged)?;
        free.iter().zip(&solved).for_each(|(&i, value)| x[i] = *value);
    }
    Ok(x)
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Minimiser found by trying every combination of active bounds.
    fn brute_force(a: &DMatrix<f64>, b: &DVector<f64>, low: &DVector<f64>, high: &DVector<f64>) -> DVector<f64> {
        let n = a.ncols();
        let mut best: Option<(f64, DVector<f64>)> = None;
        for code in 0..3_usize.pow(n as u32) {
            let given: Vec<_> =
                (0..n).map(|i| [None, Some(low[i]), Some(high[i])][code / 3_usize.pow(i as u32) % 3]).collect();
            let x = solve_with(a, b, &given).unwrap();
            let feasible = (0..n).all(|i| x[i] >= low[i] - 1e-12 && x[i] <= high[i] + 1e-12);
            let objective = (a * &x - b).norm_squared();
            if feasible && best.as_ref().is_none_or(|(least, _)| objective < *least) {
                best = Some((objective, x));
            }
        }
        best.unwrap().1
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn agrees_with_every_combination_of_active_bounds(
            a in proptest::collection::vec(-1.0..1.0, 10 * 4),
            b in proptest::collection::vec(-3.0..3.0, 10),
            low in proptest::collection::vec(-1.0..0.1, 4),
            width in proptest::collection::vec(0.0..1.5, 4),
        ) {
            let (a, b) = (DMatrix::from_vec(10, 4, a), DVector::from_vec(b));
            let low = DVector::from_vec(low);
            let high = &low + DVector::from_vec(width);
            prop_assume!(condition(&a.singular_values()) < 100.0);
            let solution = lsqlin(&a, &b, &low, &high).unwrap();
            let exact = brute_force(&a, &b, &low, &high);
            prop_assert!((&solution.x - &exact).amax() < 1e-9, "{} {exact}", solution.x);
        }
    }

    #[test]
    fn a_singular_problem_is_refused() {
        let a = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 2.0, 4.0, 3.0, 6.0]);
        let wide = DVector::repeat(2, f64::INFINITY);
        let result = lsqlin(&a, &DVector::from_vec(vec![1.0, 2.0, 3.0]), &-&wide, &wide);
        assert!(matches!(result, Err(Error::Singular(_))), "{result:?}");
    }

    #[test]
    fn contradicting_bounds_are_refused() {
        let (a, b) = (DMatrix::identity(2, 2), DVector::zeros(2));
        let result = lsqlin(&a, &b, &DVector::repeat(2, 1.0), &DVector::repeat(2, 0.0));
        assert_eq!(result.unwrap_err(), Error::Invalid);
    }

    #[test]
    fn an_active_bound_is_named() {
        let (a, b) = (DMatrix::identity(2, 2), DVector::from_vec(vec![3.0, 0.5]));
        let solution = lsqlin(&a, &b, &DVector::repeat(2, -1.0), &DVector::repeat(2, 1.0)).unwrap();
        assert_eq!(solution.active, [0]);
        assert!((solution.x - DVector::from_vec(vec![1.0, 0.5])).amax() < 1e-12);
    }
}
