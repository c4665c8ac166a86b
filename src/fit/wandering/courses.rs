//! Courses of a bias: what the equations say of a step, a drift or a wrong placement.

use nalgebra::{Cholesky, DVector, Dyn, Matrix3, MatrixXx3, Vector3};

use super::bias_equations::{BiasEquations, Carrier};
use crate::fit::accelerometer::{Assumptions, Observation};
use crate::fit::calibration::Calibration;
use crate::fit::turn_fit::BiasCourses;

/// Degrees of freedom that the assumed scatter is worth.
pub(super) const TRUST: f64 = 4.0;

/// Squares that two further unknowns explain by chance.
pub(super) const FURTHER: f64 = 4.0;

/// Solved equations, with what they say of a bias that moves.
pub(super) struct Courses {
    equations: BiasEquations,
    /// Times of the placements, s, in order.
    pub(super) times: Vec<f64>,
    factor: Cholesky<f64, Dyn>,
    left: DVector<f64>,
    /// Sums over the block of each carrier.
    sums: Vec<BlockSums>,
    /// Degrees of freedom of the residuals.
    pub(super) freedom: f64,
    /// Placement that deviates most, and by how much the squares decrease without it.
    pub(super) outlier: (usize, f64),
    by_outlier: DVector<f64>,
}

/// Products of a block, transposed, with the design (transposed: unknowns × 3), with itself, and with the residuals.
struct BlockSums {
    passed: MatrixXx3<f64>,
    gram: Matrix3<f64>,
    moment: Vector3<f64>,
}

impl Courses {
    pub(super) fn of(
        seen: &[(f64, Observation)],
        given: &Assumptions<'_>,
        calibration: &Calibration,
        turns: Option<&BiasCourses>,
    ) -> Option<Self> {
        let mut seen = seen.to_vec();
        seen.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let times: Vec<_> = seen.iter().map(|(time, _)| *time).collect();
        let solved = Self::solved(BiasEquations::of(&seen, given, calibration, turns), times)?;
        // The scatter that is left once the likeliest explanation is taken away.
        let step = solved.steps().into_iter().max_by(|a, b| a.explained.total_cmp(&b.explained));
        let likeliest = match step.filter(|step| step.explained > solved.outlier.1) {
            Some(Step { axis, at, .. }) => solved.columns(|time| is_after(time, solved.times[at])).column(axis).into(),
            None => solved.by_outlier.clone(),
        };
        let spread = solved.spread(&likeliest);
        let Self { mut equations, times, .. } = solved;
        equations.scale(spread);
        Self::solved(equations, times)
    }

    fn solved(equations: BiasEquations, times: Vec<f64>) -> Option<Self> {
        let BiasEquations { design, targets, prior, .. } = &equations;
        let mut information = design.tr_mul(design);
        prior.iter().enumerate().for_each(|(k, prior)| information[(k, k)] += prior);
        let factor = information.cholesky()?;
        let left = targets - design * factor.solve(&design.tr_mul(targets));
        let known: f64 = factor.inverse().diagonal().component_mul(prior).sum();
        let freedom = left.len() as f64 - (prior.len() as f64 - known);
        let by_outlier = DVector::zeros(left.len());
        let sums = equations.carriers.iter().map(|Carrier { row, block, .. }| BlockSums {
            passed: design.rows(*row, block.nrows()).tr_mul(block),
            gram: block.tr_mul(block),
            moment: block.tr_mul(&left.rows(*row, block.nrows())),
        });
        let sums = sums.collect();
        let mut courses = Self { equations, times, factor, left, sums, freedom, outlier: (0, 0.0), by_outlier };
        for at in 0..courses.times.len() {
            let (explained, course) = courses.as_outlier(at);
            if explained > courses.outlier.1 {
                (courses.outlier, courses.by_outlier) = ((at, explained), course);
            }
        }
        Some(courses)
    }

    /// Squares that an error of one placement explains, less what chance explains with the additional unknowns, and its
    /// course.
    fn as_outlier(&self, at: usize) -> (f64, DVector<f64>) {
        let passed = self.equations.design.row(at).transpose();
        let of_length =
            self.left_of(1.0, passed).map_or(0.0, |information| self.left[at] * self.left[at] / information);
        if self.equations.placements < self.left.len() {
            let next = self.times.get(at + 1).copied().unwrap_or(f64::INFINITY);
            let (first, last) = (self.times[at] - SAME, next - SAME);
            let (information, moment) = self.told_between(first, last);
            let ridge = Matrix3::identity() * 1e-9 * (1.0 + information.trace());
            if let Some(size) = (information + ridge).try_inverse().map(|inverse| inverse * moment) {
                let explained = moment.dot(&size) - FURTHER;
                if explained > of_length {
                    let within = |time: f64| f64::from(u8::from(first < time && time < last));
                    return (explained, self.columns(within) * size);
                }
            }
        }
        (of_length, DVector::from_fn(self.left.len(), |row, _| f64::from(u8::from(row == at))))
    }

    /// Standard deviations of the residuals of placements and of turns, if such a course explains a part of them.
    fn spread(&self, course: &DVector<f64>) -> [f64; 2] {
        let BiasEquations { design, placements, .. } = &self.equations;
        let passed = course - design * self.factor.solve(&design.tr_mul(course));
        let information = course.dot(&passed);
        let size = if information > 1e-9 { course.dot(&self.left) / information } else { 0.0 };
        let left = &self.left - &passed * size;
        let taken = self.factor.solve(&design.transpose());
        let of = |rows: std::ops::Range<usize>| {
            let squares: f64 = rows.clone().map(|row| left[row] * left[row]).sum();
            let freedom: f64 = rows
                .map(|row| {
                    let by_course = if information > 1e-9 { passed[row] * passed[row] / information } else { 0.0 };
                    1.0 - design.row(row).transpose().dot(&taken.column(row)) - by_course
                })
                .sum();
            ((squares + TRUST) / (freedom.max(0.0) + TRUST)).sqrt()
        };
        [of(0..*placements), of(*placements..left.len())]
    }

    /// Course of the equations if each axis of the bias has moved by a share that depends on time.
    fn columns(&self, share: impl Fn(f64) -> f64) -> MatrixXx3<f64> {
        let mut columns = MatrixXx3::zeros(self.left.len());
        for Carrier { time, row, block, .. } in &self.equations.carriers {
            let share = share(*time);
            if share != 0.0 {
                let mut there = columns.rows_mut(*row, block.nrows());
                there.zip_apply(block, |sum, entry| *sum += entry * share);
            }
        }
        columns
    }

    /// Information on a change of each axis that follows `share`, and that information times the change.
    pub(super) fn told(&self, share: impl Fn(f64) -> f64) -> (Matrix3<f64>, Vector3<f64>) {
        let columns = self.columns(share);
        let passed = self.equations.design.tr_mul(&columns);
        let information = columns.tr_mul(&columns) - passed.tr_mul(&self.factor.solve(&passed));
        (Matrix3::from_fn(|i, j| information[(i, j)]), columns.tr_mul(&self.left))
    }

    /// The same of a change that lasts from `first` to `last`, both excluded.
    fn told_between(&self, first: f64, last: f64) -> (Matrix3<f64>, Vector3<f64>) {
        let carriers = &self.equations.carriers;
        let start = carriers.partition_point(|carrier| carrier.time <= first);
        let within = start..start.max(carriers.partition_point(|carrier| carrier.time < last));
        let mut passed = MatrixXx3::zeros(self.equations.design.ncols());
        let (mut gram, mut moment) = (Matrix3::zeros(), Vector3::zeros());
        for at in within.clone() {
            passed += &self.sums[at].passed;
            gram += self.sums[at].gram;
            moment += self.sums[at].moment;
            for other in within.start..at {
                let shared = carriers[at].shared(&carriers[other]);
                gram += shared + shared.transpose();
            }
        }
        self.factor.l_dirty().solve_lower_triangular_mut(&mut passed);
        (gram - passed.tr_mul(&passed), moment)
    }

    /// Information that is left of a course of this square once the unknowns have followed it, from the design, transposed,
    /// times the course; `None` if nothing is.
    fn left_of(&self, square: f64, mut passed: DVector<f64>) -> Option<f64> {
        self.factor.l_dirty().solve_lower_triangular_mut(&mut passed);
        let information = square - passed.norm_squared();
        (information > 1e-6 * square).then_some(information)
    }

    /// Whether a placement tells about an axis by its own length.
    pub(super) fn tells(&self, at: usize, axis: usize) -> bool {
        self.equations.telling.get(at).is_some_and(|telling| telling[axis])
    }

    /// Steps of each axis between two placements, where the equations tell about one.
    pub(super) fn steps(&self) -> Vec<Step> {
        /// Least share of a step that no other unknown follows.
        const LEAST: f64 = 1e-3;
        let count = self.times.len();
        let has_turns = self.equations.placements < self.left.len();
        let mut steps = Vec::new();
        for axis in 0..3 {
            let mut course = DVector::<f64>::zeros(self.left.len());
            let mut passed = DVector::<f64>::zeros(self.equations.design.ncols());
            let (mut square, mut moment) = (0.0, 0.0);
            let mut carriers = self.equations.carriers.iter().zip(&self.sums).rev().peekable();
            let mut behind = false;
            for at in (1..count).rev() {
                let joins = |(carrier, _): &(&Carrier, _)| is_after(carrier.time, self.times[at]) > 0.0;
                while let Some((Carrier { row, block, .. }, own)) = carriers.next_if(joins) {
                    let block = block.column(axis);
                    let mut there = course.rows_mut(*row, block.nrows());
                    square += 2.0 * there.dot(&block) + own.gram[(axis, axis)];
                    there += block;
                    moment += own.moment[axis];
                    passed += own.passed.column(axis);
                }
                // Without turns only placements along an axis tell about it.
                behind |= self.tells(at, axis);
                let before = (0..at).filter(|row| self.tells(*row, axis)).take(2).count();
                if !has_turns && (!behind || before < 2 || !self.tells(at, axis)) {
                    continue;
                }
                if let Some(information) = self.left_of(square, passed.clone()).filter(|left| *left >= LEAST * square) {
                    let explained = moment * moment / information;
                    steps.push(Step { axis, at, moment, information, explained });
                }
            }
        }
        steps
    }

    /// Shift of the accelerometer's parameters by a course of the equations.
    pub(super) fn shift(&self, axis: usize, share: impl Fn(f64) -> f64) -> DVector<f64> {
        let course = self.columns(share).column(axis).into_owned();
        let moved = self.factor.solve(&self.equations.design.tr_mul(&course));
        DVector::from_iterator(self.equations.columns.len(), self.equations.columns.iter().map(|at| moved[*at]))
    }
}

/// Stamps of the same rest differ by less, s.
const SAME: f64 = 1e-6;

/// One at and after the time of a rest, zero before.
fn is_after(time: f64, rest: f64) -> f64 {
    f64::from(u8::from(time > rest - SAME))
}

/// Step of an axis between two placements.
pub(super) struct Step {
    pub(super) axis: usize,
    /// First placement after it.
    pub(super) at: usize,
    pub(super) moment: f64,
    pub(super) information: f64,
    /// Squares that it explains.
    pub(super) explained: f64,
}
