//! Equations of the placements, and of the turns between them, on a bias that moves.

use nalgebra::{DMatrix, DVector, Matrix3, MatrixXx3, Vector3};

use crate::fit::accelerometer::{Assumptions, MagnitudeEquation, Observation};
use crate::fit::calibration::Calibration;
use crate::fit::parameterisation::Parameterisation;
use crate::fit::turn_fit::{BiasAtRest, BiasCourses};

/// Weighted equations, in which the errors are independent and, as assumed, of unit variance.
pub(super) struct BiasEquations {
    pub(super) targets: DVector<f64>,
    /// Derivatives with respect to the unknowns that do not move.
    pub(super) design: DMatrix<f64>,
    /// Inverse prior variance of each unknown.
    pub(super) prior: DVector<f64>,
    /// Number of equations of placements; those of turns come after them.
    pub(super) placements: usize,
    /// Axes of which each placement tells by its length.
    pub(super) telling: Vec<[bool; 3]>,
    /// Column of each parameter of the accelerometer, biases first.
    pub(super) columns: Vec<usize>,
    /// Derivatives with respect to the bias at some time, s, in order of time.
    pub(super) carriers: Vec<Carrier>,
}

/// Part of the equations that depends on the bias at some time.
pub(super) struct Carrier {
    pub(super) time: f64,
    /// Direction of true specific force at that time.
    pub(super) up: Vector3<f64>,
    /// First equation of the block.
    pub(super) row: usize,
    /// Derivatives with respect to the three axes.
    pub(super) block: MatrixXx3<f64>,
}

impl Carrier {
    /// Product of the blocks of two carriers over the equations that they share.
    pub(super) fn shared(&self, other: &Self) -> Matrix3<f64> {
        let first = self.row.max(other.row);
        let last = (self.row + self.block.nrows()).min(other.row + other.block.nrows()).max(first);
        let rows = |carrier: &Self| carrier.block.rows(first.saturating_sub(carrier.row), last - first).into_owned();
        if first == last { Matrix3::zeros() } else { rows(self).tr_mul(&rows(other)) }
    }
}

impl BiasEquations {
    pub(super) fn of(
        seen: &[(f64, Observation)],
        given: &Assumptions<'_>,
        calibration: &Calibration,
        turns: Option<&BiasCourses>,
    ) -> Self {
        let mut equations = match turns {
            Some(turns) => Self::with_turns(seen, given, turns),
            None => Self::of_placements(seen, given, calibration),
        };
        if given.nonlinearity > 0.0 {
            equations.allow_for_squares(given.nonlinearity);
        }
        equations
    }

    fn of_placements(seen: &[(f64, Observation)], given: &Assumptions<'_>, calibration: &Calibration) -> Self {
        let leaks: Vec<_> = given.shape.unmodelled().collect();
        let terms: Vec<_> = given.shape.terms().iter().copied().chain(leaks.iter().copied()).collect();
        let unknowns = given.shape.unknowns();
        let mut equations = Self {
            targets: DVector::zeros(seen.len()),
            design: DMatrix::zeros(seen.len(), terms.len()),
            prior: DVector::from_fn(terms.len(), |k, _| {
                if k < unknowns { 0.0 } else { 1.0 / given.leak().powi(2).max(1e-12) }
            }),
            placements: seen.len(),
            telling: Vec::new(),
            columns: (0..unknowns).collect(),
            carriers: Vec::new(),
        };
        for (row, (time, observation)) in seen.iter().enumerate() {
            let line = MagnitudeEquation::of(observation, given, calibration);
            let direction = equations.place(row, *time, &line, given);
            for (column, term) in terms.iter().enumerate() {
                equations.design[(row, column)] = direction[term.axis()] * term.regressor(&line.truth);
            }
        }
        equations
    }

    /// Without turns a diagonal S leaves off-diagonal entries open; with them they are unknowns like the others.
    fn with_turns(seen: &[(f64, Observation)], given: &Assumptions<'_>, turns: &BiasCourses) -> Self {
        let shape = Parameterisation::TRIANGULAR;
        let (before, count) = (BiasCourses::BEFORE, seen.len());
        let terms = shape.terms();
        let rows = count + turns.targets.len();
        let prior = DVector::from_fn(turns.design.ncols(), |k, _| {
            let is_known = k < before || !Parameterisation::DIAGONAL.terms().contains(&terms[k - before]);
            if is_known { BiasCourses::PRIOR.powi(-2) } else { 0.0 }
        });
        let column = |term| terms.iter().position(|known| known == term).map(|k| before + k);
        let mut equations = Self {
            targets: DVector::zeros(rows),
            design: DMatrix::zeros(rows, turns.design.ncols()),
            prior,
            placements: count,
            telling: Vec::new(),
            columns: given.shape.terms().iter().filter_map(column).collect(),
            carriers: Vec::new(),
        };
        let at = DVector::from_iterator(terms.len(), turns.at.iter().skip(before).copied());
        let calibration = shape.calibration(&at);
        for (row, (time, observation)) in seen.iter().enumerate() {
            let line = MagnitudeEquation::of(observation, given, &calibration);
            let direction = equations.place(row, *time, &line, given);
            for (k, term) in terms.iter().enumerate() {
                equations.design[(row, before + k)] = direction[term.axis()] * term.regressor(&line.truth);
            }
        }
        equations.targets.rows_mut(count, turns.targets.len()).copy_from(&turns.targets);
        equations.design.rows_mut(count, turns.targets.len()).copy_from(&turns.design);
        let of_rest = |BiasAtRest { time, up, first, by_bias }: &BiasAtRest| Carrier {
            time: *time,
            up: *up,
            row: count + first,
            block: by_bias.clone(),
        };
        let blocks = turns.rests.iter().map(of_rest);
        equations.carriers.extend(blocks);
        equations.carriers.sort_by(|a, b| a.time.total_cmp(&b.time));
        equations
    }

    /// Adds the equation of a placement but for the design, and returns its derivative with respect to the reading.
    fn place(&mut self, row: usize, time: f64, line: &MagnitudeEquation, given: &Assumptions<'_>) -> Vector3<f64> {
        let scatter = line.by_measured.norm_squared() * given.placement_std.powi(2);
        let weight = 1.0 / (scatter + line.noise).sqrt();
        let direction = -line.by_measured * weight;
        self.targets[row] = -line.residual * weight;
        self.telling.push([0, 1, 2].map(|axis| direction[axis].abs() > 0.5 * direction.norm()));
        let up = line.truth.own.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        self.carriers.push(Carrier { time, up, row, block: MatrixXx3::from_row_slice(direction.as_slice()) });
        direction
    }

    /// Adds the quadratic nonlinearity of each axis to the unknowns, with a standard deviation at 1 g, m/s²: a bias along
    /// the vertical alone, by which lengths and turns differ.
    fn allow_for_squares(&mut self, std: f64) {
        let at = self.design.ncols();
        let (design, prior) = (std::mem::take(&mut self.design), std::mem::take(&mut self.prior));
        self.design = design.insert_columns(at, 3, 0.0);
        self.prior = prior.insert_rows(at, 3, std.powi(-2));
        for Carrier { up, row, block, .. } in &self.carriers {
            for axis in 0..3 {
                let mut there = self.design.view_mut((*row, at + axis), (block.nrows(), 1));
                there += block.column(axis) * (up[axis] * up[axis]);
            }
        }
    }

    /// Divides the equations of placements and those of turns by these standard deviations.
    pub(super) fn scale(&mut self, [placements, turns]: [f64; 2]) {
        let at = |row: usize| 1.0 / if row < self.placements { placements } else { turns };
        for row in 0..self.targets.len() {
            self.targets[row] *= at(row);
            self.design.row_mut(row).scale_mut(at(row));
        }
        for carrier in &mut self.carriers {
            for row in 0..carrier.block.nrows() {
                carrier.block.row_mut(row).scale_mut(at(carrier.row + row));
            }
        }
    }
}
