//! Solution of the equations of the turns, with weights under which χ² equals its degrees of freedom.

use nalgebra::{DMatrix, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::equations::{DATASHEET, Equations, Given, Square, TurnRow, UNKNOWNS, inverse_of, linearise};
use super::g_sensitivity::GSensitivity;
use super::information::{OffDiagonals, Told};
use super::inverse_errors::{by_inverse, of_sensitivity};
use super::session::TurnSession;
use super::too_little::{ENTRIES, PRECISE, TooLittle};
use super::turn_estimate::TurnEstimate;
use super::vertical_equation::{VerticalEquation, WhitenedVertical, whitened};
use crate::fit::placement_scatter::stretch;
use crate::fit::student_t::{NORMAL_95, student_95};

/// Indices of the accelerometer's entries below the diagonal among the unknowns.
const OFF: [usize; 3] = [13, 15, 16];

const LEAST_FREEDOM: f64 = 7.0;

/// Weighted residual of a turn and its derivatives.
pub(super) type Whitened = (Vector2<f64>, SMatrix<f64, 2, UNKNOWNS>);

/// Two rows of the factor L of the covariance of the residuals: those of one turn.
pub(super) struct Factor {
    pub(super) turn: usize,
    /// Block below the diagonal, if errors are shared with the turn before.
    pub(super) shared: Option<Matrix2<f64>>,
    /// Block on the diagonal, lower triangular.
    pub(super) triangle: Matrix2<f64>,
}

/// Size of the errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    /// Share of the assumed variance that counts.
    share: f64,
    /// Variance added to every equation, rad².
    pub(super) added: f64,
}

pub(super) const AS_ASSUMED: Level = Level { share: 1.0, added: 0.0 };

/// Solution of the equations at some weights.
struct SolvedTurns {
    step: TurnRow,
    covariance: Square,
    squares: f64,
    freedom: f64,
}

/// Fit of a subset of the turns.
pub(super) struct TurnSolution<'a> {
    given: &'a Given,
    pub(super) at: TurnRow,
    kept: Vec<bool>,
    pub(super) equations: Vec<Equations>,
    known: Vec<VerticalEquation>,
    pub(super) level: Level,
}

impl<'a> TurnSolution<'a> {
    pub(super) fn of(
        session: &TurnSession,
        given: &'a Given,
        by_up: Matrix3<f64>,
        kept: &[bool],
    ) -> Result<Self, TooLittle> {
        const ROUNDS: usize = 3;
        /// Largest last step of an entry: what it leaves is of second order, and far below the precision of any recording.
        const NEAR: f64 = 3e-4;
        let mut at = TurnRow::zeros();
        at.fixed_rows_mut::<9>(9).copy_from(&given.mean);
        let mut found =
            Self { given, at, kept: kept.to_vec(), equations: Vec::new(), known: Vec::new(), level: AS_ASSUMED };
        for round in 0..ROUNDS {
            (found.equations, found.known) = linearise(session, given, by_up, &found.at);
            if round == 1 {
                // By now the residuals do not come from the linearisation.
                found.level = found.find_level().ok_or(TooLittle::Unsolved)?;
            }
            let solved = found.solve(found.level, None).ok_or(TooLittle::Unsolved)?;
            found.at += solved.step;
            for equations in &mut found.equations {
                equations.residual += equations.by * solved.step;
            }
            for known in &mut found.known {
                known.residual += known.by_inverse.dot(&solved.step.fixed_rows::<9>(0));
            }
            if round > 0 && solved.step.amax() < NEAR {
                break;
            }
        }
        found.at.iter().all(|x| x.is_finite()).then_some(found).ok_or(TooLittle::Unsolved)
    }

    /// Finds the weights at which χ² equals its degrees of freedom.
    fn find_level(&self) -> Option<Level> {
        const STEPS: usize = 12;
        /// Tolerance of a logarithm: such an error of the weights changes no digit that is shown.
        const NEAR: f64 = 1e-3;
        let over = |level: Level| {
            self.solve(level, None)
                .map(|solved| libm::log(solved.squares.max(f64::MIN_POSITIVE) / solved.freedom.max(1e-3)))
        };
        let scaled = |log: f64| Level { share: libm::exp(log), added: 0.0 };
        let added = |log: f64| Level { share: 1.0, added: libm::exp(2.0 * log) };
        // Brackets: an added error of 0.01 mrad to more than any real one, or a share of almost none to all of the
        // assumed one.
        let as_assumed = over(AS_ASSUMED)?;
        let (of, mut low, mut high): (&dyn Fn(f64) -> Level, f64, f64) = match as_assumed > 0.0 {
            true => (&added, libm::log(1e-5), libm::log(0.3)),
            false => (&scaled, libm::log(1e-3), 0.0),
        };
        // Regula falsi, in its Illinois variant (Dowell & Jarratt, BIT 1971): the logarithms are nearly linear.
        let (mut above, mut below) = (over(of(low))?, if as_assumed > 0.0 { over(of(high))? } else { as_assumed });
        let mut middle = if above > 0.0 { high } else { low };
        let mut side = 0;
        for _ in 0..STEPS {
            if above <= 0.0 || below >= 0.0 || high - low < NEAR {
                break;
            }
            middle = (low * below - high * above) / (below - above);
            let at = over(of(middle))?;
            if at.abs() < NEAR {
                break;
            }
            if at > 0.0 {
                (low, above) = (middle, at);
                below = if side == 1 { below / 2.0 } else { below };
                side = 1;
            } else {
                (high, below) = (middle, at);
                above = if side == -1 { above / 2.0 } else { above };
                side = -1;
            }
        }
        Some(of(middle))
    }

    /// Factor of the covariance of the residuals, turn by turn. Errors are shared only with the turn before, so it is
    /// block bidiagonal.
    pub(super) fn factors(&self, level: Level, without: Option<usize>) -> Option<Vec<Factor>> {
        let mut factors: Vec<Factor> = Vec::with_capacity(self.equations.len());
        for (turn, equations) in self.equations.iter().enumerate() {
            if !self.kept.get(turn).copied().unwrap_or(false) || without == Some(turn) {
                continue;
            }
            let at = |parts: &[Matrix2<f64>; 2]| parts[0] + parts[1] * level.share;
            let mut own = at(&equations.noise) + Matrix2::identity() * level.added;
            let shared = match factors.last().filter(|before| before.turn + 1 == turn) {
                // Subdiagonal block of the factor: L₂₁ = B L₁⁻ᵀ.
                Some(before) => {
                    Some(before.triangle.solve_lower_triangular(&at(&equations.shared).transpose())?.transpose())
                }
                None => None,
            };
            own -= shared.map_or(Matrix2::zeros(), |shared| shared * shared.transpose());
            factors.push(Factor { turn, shared, triangle: own.cholesky()?.l() });
        }
        Some(factors)
    }

    /// Residuals and their derivatives, turn by turn, weighted so that their errors are independent and of unit
    /// variance.
    pub(super) fn whitened(&self, level: Level, without: Option<usize>) -> Option<Vec<Whitened>> {
        let mut white: Vec<Whitened> = Vec::with_capacity(self.equations.len());
        for Factor { turn, shared, triangle } in self.factors(level, without)? {
            let equations = &self.equations[turn];
            let (mut residual, mut by) = (equations.residual, equations.by);
            if let (Some(shared), Some((last, derivative))) = (shared, white.last()) {
                residual -= shared * last;
                by -= shared * derivative;
            }
            white.push((triangle.solve_lower_triangular(&residual)?, triangle.solve_lower_triangular(&by)?));
        }
        Some(white)
    }

    /// Residuals of the known rotations and their derivatives, weighted likewise.
    fn whitened_known(&self, without: Option<usize>) -> Vec<WhitenedVertical> {
        let counts = |turn: usize| self.kept.get(turn).copied().unwrap_or(false) && without != Some(turn);
        whitened(&self.known, counts)
    }

    fn solve(&self, level: Level, without: Option<usize>) -> Option<SolvedTurns> {
        let white = self.whitened(level, without)?;
        let mut information = Square::zeros();
        let mut moment = TurnRow::zeros();
        let mut add = |row: &TurnRow, residual: f64| {
            for (mut column, factor) in information.column_iter_mut().zip(row.iter()) {
                column.axpy(*factor, row, 1.0);
            }
            moment.axpy(residual, row, 1.0);
        };
        for (residual, by) in &white {
            by.row_iter().zip(residual.iter()).for_each(|(row, residual)| add(&row.transpose(), *residual));
        }
        let known = self.whitened_known(without);
        known.iter().for_each(|known| add(&row_of(known), known.residual));
        let mut start = TurnRow::zeros();
        start.fixed_rows_mut::<9>(9).copy_from(&self.given.mean);
        let factor = (information + self.given.prior).cholesky()?;
        let step = -factor.solve(&(moment + self.given.prior * (self.at - start)));
        let covariance = factor.inverse();
        let of_turns: f64 = white.iter().map(|(residual, by)| (residual + by * step).norm_squared()).sum();
        let of_known: f64 = known.iter().map(|known| left_of(known, &step).powi(2)).sum();
        let seen = (2 * white.len() + known.len()) as f64;
        // Degrees of freedom that the data determine, not the prior: tr(P I) = n − tr(P Λ).
        let known = UNKNOWNS as f64 - covariance.dot(&self.given.prior);
        Some(SolvedTurns { step, covariance, squares: of_turns + of_known, freedom: seen - known })
    }

    /// Finds the turn without which the others agree, if it deviates beyond chance.
    pub(super) fn contradicting(&self) -> Option<usize> {
        /// Least excess of the squares of one turn over those of the others, each over its degrees of freedom.
        const BEYOND: f64 = 12.0;
        /// Number of most deviating turns that are tried.
        const TRIED: usize = 3;
        let all = self.solve(AS_ASSUMED, None)?;
        if all.squares < 1.5 * all.freedom {
            return None;
        }
        let white = self.whitened(AS_ASSUMED, None)?;
        let kept = (0..self.equations.len()).filter(|k| self.kept[*k]);
        let known = self.whitened_known(None);
        let of_known = |k: usize| known.iter().filter(move |known| known.turn == k);
        let size = |k: usize, (residual, by): &Whitened| {
            let known = of_known(k).map(|known| left_of(known, &all.step).powi(2));
            (residual + by * all.step).norm_squared() + known.sum::<f64>()
        };
        let mut largest: Vec<_> = kept.zip(&white).map(|(k, white)| (k, size(k, white))).collect();
        largest.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let without = |&(k, _): &(usize, f64)| {
            let others = self.solve(AS_ASSUMED, Some(k))?;
            let left = others.squares / others.freedom.max(1.0);
            let equations = 2.0 + of_known(k).count() as f64;
            Some((k, (all.squares - others.squares) / equations / left.max(1.0)))
        };
        let worst = largest.iter().take(TRIED).filter_map(without).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        (worst.1 > BEYOND).then_some(worst.0)
    }

    pub(super) fn summarise(
        &self,
        kept: &[bool],
        left_out: Option<usize>,
        g_sensitivity: Option<GSensitivity>,
    ) -> Result<TurnEstimate, TooLittle> {
        let solved = self.solve(self.level, None).ok_or(TooLittle::Unsolved)?;
        let used = kept.iter().filter(|kept| **kept).count();
        if solved.freedom < LEAST_FREEDOM {
            return Err(TooLittle::Unchecked { turns: used });
        }
        let sensitivity = inverse_of(&self.at).try_inverse().ok_or(TooLittle::Unsolved)?;
        let stretch = (student_95(solved.freedom) / NORMAL_95).powi(2);
        let covariance = of_sensitivity(&sensitivity, &solved.covariance) * stretch;
        let half_widths = covariance.diagonal().map(|variance| NORMAL_95 * variance.max(0.0).sqrt());
        let widest = half_widths.imax();
        if half_widths[widest] > PRECISE {
            return Err(TooLittle::Imprecise { entry: ENTRIES[widest], half_width: half_widths[widest] });
        }
        let off = |i: usize, j: usize| solved.covariance[(OFF[i], OFF[j])] * stretch;
        let first = self.solve(AS_ASSUMED, None).ok_or(TooLittle::Unsolved)?;
        Ok(TurnEstimate {
            sensitivity,
            covariance,
            off_diagonals: OffDiagonals {
                value: Vector3::from_fn(|i, _| self.at[OFF[i]]),
                covariance: Matrix3::from_fn(off),
            },
            accelerometer: self.at.fixed_rows::<9>(9).into_owned(),
            told: self.told(&solved).ok_or(TooLittle::Unsolved)?,
            g_sensitivity,
            residuals: self.equations.iter().map(|equations| equations.residual.norm()).collect(),
            left_out,
            used,
            chi2_per_dof: first.squares / first.freedom.max(1.0),
            freedom: solved.freedom,
            added: self.level.added.sqrt(),
            condition: self.condition(&solved).ok_or(TooLittle::Unsolved)?,
            redundant: left_out.is_none() && self.is_redundant(&solved, &sensitivity, &half_widths),
        })
    }

    /// Information from the turns alone about the accelerometer: that of the joint fit less that of its rests.
    fn told(&self, solved: &SolvedTurns) -> Option<Told> {
        let stretch = stretch(solved.freedom).powi(2);
        let all = solved.covariance.fixed_view::<9, 9>(9, 9).try_inverse()?;
        let rests = self.given.prior.fixed_view::<9, 9>(9, 9);
        let moment = all * self.at.fixed_rows::<9>(9) - rests * self.given.mean;
        Some(Told { information: (all - rests) / stretch, moment: moment / stretch })
    }

    /// Condition number of the information from the turns alone on the gyroscope, and on the accelerometer's entries
    /// below the diagonal if these are not known otherwise.
    fn condition(&self, solved: &SolvedTurns) -> Option<f64> {
        let wanted: Vec<usize> = (0..9).chain(OFF.into_iter().filter(|_| !self.given.triangular)).collect();
        let marginal = DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| solved.covariance[(wanted[i], wanted[j])]);
        let mut information = marginal.try_inverse()?;
        (0..wanted.len()).for_each(|i| information[(i, i)] -= 1.0 / DATASHEET.powi(2));
        let scale = information.diagonal().map(|entry| 1.0 / entry.max(f64::MIN_POSITIVE).sqrt());
        let scaled = DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| information[(i, j)] * scale[i] * scale[j]);
        let eigen = scaled.symmetric_eigenvalues();
        Some((eigen.max() / eigen.min().max(1e-12)).min(1e12))
    }

    /// Whether the fit without any one turn gives the same result, with the required precision. Turns are removed by
    /// the deletion formula (Cook and Weisberg, "Residuals and influence in regression", 1982).
    fn is_redundant(&self, solved: &SolvedTurns, sensitivity: &Matrix3<f64>, half_widths: &SVector<f64, 9>) -> bool {
        let Some(white) = self.whitened(self.level, None) else { return false };
        let by_inverse = by_inverse(sensitivity);
        let variances = of_sensitivity(sensitivity, &solved.covariance).diagonal();
        let holds_without = |gain: &SMatrix<f64, UNKNOWNS, 2>, moved: &TurnRow, inverse: &Matrix2<f64>| {
            let widened = by_inverse * gain.fixed_rows::<9>(0);
            let more = (widened * inverse).component_mul(&widened).column_sum();
            let precise =
                (variances + more).iter().all(|variance| NORMAL_95 * variance.max(0.0).sqrt() <= 2.0 * PRECISE);
            precise && moved.iter().zip(half_widths).all(|(moved, half)| moved.abs() <= 1.5 * half)
        };
        // A turn is asked for its direction and for its known rotation, one after the other.
        let of_turns = white.iter().map(|(residual, by)| (*residual, *by));
        let of_known = self.whitened_known(None).into_iter().map(|known| {
            let mut by = SMatrix::<f64, 2, UNKNOWNS>::zeros();
            by.set_row(0, &row_of(&known).transpose());
            (Vector2::new(known.residual, 0.0), by)
        });
        of_turns.chain(of_known).all(|(residual, by)| {
            let gain = solved.covariance * by.transpose();
            let left = residual + by * solved.step;
            let Some(inverse) = (Matrix2::identity() - by * gain).try_inverse() else { return false };
            holds_without(&gain, &(gain * inverse * left), &inverse)
        })
    }
}

/// Derivatives of a known rotation with respect to all unknowns.
fn row_of(known: &WhitenedVertical) -> TurnRow {
    let mut row = TurnRow::zeros();
    row.fixed_rows_mut::<9>(0).copy_from(&known.by_inverse);
    row
}

/// Residual of a known rotation after a step.
fn left_of(known: &WhitenedVertical, step: &TurnRow) -> f64 {
    known.residual + known.by_inverse.dot(&step.fixed_rows::<9>(0))
}
