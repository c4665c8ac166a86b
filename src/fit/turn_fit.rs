//! Fit of the gyroscope's sensitivity, and of the accelerometer's cross-axis sensitivities, to turns between rests.
//!
//! At both ends of a turn the accelerometer shows the direction of gravity, and in between the gyroscope shows the
//! rotation of the frame: two equations a turn. A tilt and a cross-axis sensitivity of the accelerometer look alike at
//! rest but not while turning, so both sensors are fitted together (gyroscopes alone: Tedaldi, Pretto & Menegatti, "A
//! robust and easy to implement method for IMU calibration without external equipments", ICRA 2014).
//!
//! Weighted Gauss–Newton about the entries of C = S⁻¹ of the gyroscope, and the bias and lower-triangular S of the
//! accelerometer. Neighbouring turns share the errors of the rest between them. The assumed part of the errors is
//! scaled down, or an error common to all turns is added, until χ² equals its degrees of freedom (Paule & Mandel 1982).

use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::calibration::Calibration;
use super::estimate::Estimate;
use super::parameterisation::Parameterisation;
use super::placement_scatter::stretch;
use super::student_t::{NORMAL_95, student_95};
use crate::turns::{Candidate, Ends, Piece, predict};

/// Readings of the sensors at a rest.
#[derive(Clone, Debug)]
pub struct RestSeen {
    /// Raw specific force at the start and at the end of the rest, m/s².
    pub force: [Vector3<f64>; 2],
    /// Variance of the force from noise, per axis, (m/s²)².
    pub force_noise: Vector3<f64>,
    /// Raw mean rate, rad/s.
    pub rate: Vector3<f64>,
    /// Variance of the rate from noise, per axis, (rad/s)².
    pub rate_noise: Vector3<f64>,
    /// Time of the rest, s.
    pub time: f64,
}

/// Turn between two rests.
#[derive(Clone, Debug)]
pub struct TurnSeen {
    /// Rests before and after, as indices.
    pub rests: [usize; 2],
    /// Pieces of the preintegrated raw rates.
    pub pieces: Vec<Piece>,
    /// Duration, s.
    pub seconds: f64,
    /// Angular path ∫ ‖ω‖ dt, rad.
    pub path: f64,
    /// Variance of its angle about an axis from motion faster than the samples, rad².
    pub roughness: f64,
}

/// Rests and the turns between them, both in order of time.
#[derive(Clone, Debug, Default)]
pub struct TurnSession {
    /// Rests in order.
    pub rests: Vec<RestSeen>,
    /// Turns in order.
    pub turns: Vec<TurnSeen>,
    /// Square of the gyroscope's angle random walk, rad²/s.
    pub random_walk: f64,
}

/// Entries of the accelerometer's S below the diagonal: row y column x, z x, z y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffDiagonals {
    /// Values of the entries.
    pub value: Vector3<f64>,
    /// Covariance of the entries, stretched so that 1.96 standard deviations are half of a 95 % interval.
    pub covariance: Matrix3<f64>,
}

impl OffDiagonals {
    /// Row and column of each entry.
    pub const ENTRIES: [(usize, usize); 3] = [(1, 0), (2, 0), (2, 1)];

    /// Half-width of the widest 95 % interval.
    pub fn half_width(&self) -> f64 {
        NORMAL_95 * self.covariance.diagonal().max().max(0.0).sqrt()
    }
}

/// Information from turns about an accelerometer with a lower-triangular S, in the order of its parameters, independent
/// of its rests.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Inverse covariance, reduced by Student's quantile.
    pub information: SMatrix<f64, 9, 9>,
    /// Inverse covariance times the parameters by the turns alone.
    pub moment: SVector<f64, 9>,
}

impl From<&OffDiagonals> for Told {
    /// Converts these entries, without information on the others.
    fn from(entries: &OffDiagonals) -> Self {
        let mut told = Self { information: SMatrix::zeros(), moment: SVector::zeros() };
        let Some(information) = entries.covariance.try_inverse() else { return told };
        let moment = information * entries.value;
        // Indices among the nine parameters.
        for (i, row) in OFF.map(|place| place - 9).into_iter().enumerate() {
            told.moment[row] = moment[i];
            for (j, column) in OFF.map(|place| place - 9).into_iter().enumerate() {
                told.information[(row, column)] = information[(i, j)];
            }
        }
        told
    }
}

/// G-sensitivity of a gyroscope at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct GSensitivity {
    /// Bias without specific force, rad/s.
    pub bias: Vector3<f64>,
    /// Rate for a unit vector along specific force, rad/s.
    pub by_up: Matrix3<f64>,
    /// Covariance of the bias and the row of each axis, stretched as above.
    pub covariance: [SMatrix<f64, 4, 4>; 3],
}

/// Result of a fit to turns.
#[derive(Clone, Debug)]
pub struct TurnEstimate {
    /// Sensitivity S of the gyroscope.
    pub sensitivity: Matrix3<f64>,
    /// Covariance of its entries row by row, stretched as above.
    pub covariance: SMatrix<f64, 9, 9>,
    /// Entries of the accelerometer's S below the diagonal.
    pub off_diagonals: OffDiagonals,
    /// Accelerometer by rests and turns together: bias and lower-triangular S.
    pub accelerometer: SVector<f64, 9>,
    /// Information from the turns alone about the accelerometer.
    pub told: Told,
    /// G-sensitivity, if the rests show one.
    pub g_sensitivity: Option<GSensitivity>,
    /// Angle between gravity as predicted and as measured after each turn, rad.
    pub residuals: Vec<f64>,
    /// Turn that contradicts the others, if any; it is left out of the fit.
    pub left_out: Option<usize>,
    /// Number of turns in the fit.
    pub used: usize,
    /// Chi-squared over its degrees of freedom, before anything was scaled or added.
    pub chi2_per_dof: f64,
    /// Degrees of freedom of the fit.
    pub freedom: f64,
    /// Added error common to all turns, rad.
    pub added: f64,
    /// Condition number of the information from the turns, each unknown in its own unit.
    pub condition: f64,
    /// Whether the fit without any one turn agrees.
    pub redundant: bool,
}

/// Reason why turns do not determine the sensitivity.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TooLittle {
    /// Too few turns between accepted rests.
    #[error(
        "{turned} turns by 30° or more between accepted rests, {LEAST_TURNS} are needed: turn it from face to face"
    )]
    Few {
        /// Turns that rotate gravity by 30° or more.
        turned: usize,
    },
    /// Turns whose residuals have too few degrees of freedom.
    #[error("{turns} turns do not check each other yet: turn it on from face to face, about all axes")]
    Unchecked {
        /// Turns in the fit.
        turns: usize,
    },
    /// Rotations about the vertical, which do not turn gravity.
    #[error(
        "the turns are about the vertical ({turned} of {all} tilt it by 30° or more), and such turns show no scale: turn the sensor \
         over, or declare what the rotations were"
    )]
    AboutVertical {
        /// Turns that tilt the sensor by 30° or more.
        turned: usize,
        /// All turns.
        all: usize,
    },
    /// Entry that is not precise enough.
    #[error("the turns tell {entry} to ±{:.2} %, and ±{:.1} % would do: more turns, about all axes", 100.0 * half_width, 100.0 * PRECISE)]
    Imprecise {
        /// Entry in words.
        entry: &'static str,
        /// Half-width of its 95 % interval.
        half_width: f64,
    },
    /// Condition number that is too large.
    #[error("the turns do not tell the axes apart (condition number {0:.0}): turn it about the others, too")]
    Undistinguished(f64),
    /// Equations without a solution.
    #[error("the turns contradict the rests")]
    Unsolved,
}

/// Standard gravity, m/s².
const STANDARD_GRAVITY: f64 = 9.806_65;
const UNKNOWNS: usize = 18;
/// Indices of the accelerometer's entries below the diagonal.
const OFF: [usize; 3] = [13, 15, 16];
/// Prior standard deviation of an entry of an inverse sensitivity, as of datasheets.
const DATASHEET: f64 = 0.03;
/// Angle error from a gyroscope's nonlinearity, as a share of the path of a turn.
const NONLINEARITY: f64 = 2e-4;
const LEAST_TURNS: usize = 8;
const LEAST_FREEDOM: f64 = 7.0;
/// Least angle by which a turn rotates gravity, rad.
const TURNED: f64 = std::f64::consts::FRAC_PI_6;
/// Largest accepted half-width of a 95 % interval.
const PRECISE: f64 = 0.005;
/// Largest condition numbers: of the gyroscope's entries alone, and together with the accelerometer's.
const CONDITIONED: [f64; 2] = [50.0, 100.0];

type TurnRow = SVector<f64, UNKNOWNS>;
/// Weighted residual of a turn and its derivatives.
type Whitened = (Vector2<f64>, SMatrix<f64, 2, UNKNOWNS>);
type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Fits the turns, given an accelerometer calibrated at rests whose placements scatter by `placement_std` (m/s²).
///
/// # Errors
/// If the turns do not determine the gyroscope's S.
pub fn fit(session: &TurnSession, accelerometer: &Estimate, placement_std: f64) -> Result<TurnEstimate, TooLittle> {
    let given = Given::of(accelerometer, placement_std).ok_or(TooLittle::Unsolved)?;
    let calibration = accelerometer.calibration();
    let turned = session.turns.iter().filter(|turn| {
        let [before, after] = session.ups(turn, &calibration);
        libm::atan2(before.cross(&after).norm(), before.dot(&after)) >= TURNED
    });
    let turned = turned.count();
    if turned < LEAST_TURNS {
        let all = session.turns.len();
        return Err(if all >= LEAST_TURNS {
            TooLittle::AboutVertical { turned, all }
        } else {
            TooLittle::Few { turned }
        });
    }
    let g_sensitivity = session.g_sensitivity(&calibration);
    let by_up = g_sensitivity.as_ref().map_or(Matrix3::zeros(), |g| g.by_up);
    let everything = vec![true; session.turns.len()];
    let mut all = TurnSolution::of(session, &given, by_up, &everything)?;
    let mut kept = everything;
    let left_out = all.contradicting();
    if let Some(wrong) = left_out {
        kept[wrong] = false;
        all = TurnSolution::of(session, &given, by_up, &kept)?;
    }
    all.summarise(&kept, left_out, g_sensitivity)
}

impl TurnEstimate {
    /// Whether the accelerometer's entries below the diagonal are known, too.
    pub fn completes(&self) -> bool {
        self.off_diagonals.half_width() <= PRECISE
    }

    /// Estimate of the gyroscope, with a bias from rests.
    pub fn with_bias(&self, bias: &Estimate) -> Estimate {
        let (shape, first) = match &self.g_sensitivity {
            Some(_) => (Parameterisation::GYROSCOPE_BY_TURNS, 12),
            None => (Parameterisation::MATRIX, 12),
        };
        let mut parameters = DVector::zeros(shape.unknowns());
        let mut covariance = DMatrix::zeros(shape.unknowns(), shape.unknowns());
        for axis in 0..3 {
            parameters[axis] = bias.parameters.get(axis).copied().unwrap_or(0.0);
            for other in 0..3 {
                covariance[(axis, other)] = bias.covariance[(axis, other)];
                parameters[3 + 3 * axis + other] = self.sensitivity[(axis, other)];
            }
        }
        covariance.view_mut((3, 3), (9, 9)).copy_from(&self.covariance);
        if let Some(g) = &self.g_sensitivity {
            covariance.view_mut((0, 0), (3, 3)).fill(0.0);
            for axis in 0..3 {
                parameters[axis] = g.bias[axis];
                let place = |k: usize| if k == 0 { axis } else { first + 3 * axis + k - 1 };
                for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
                    let unit = [1.0, 1.0 / STANDARD_GRAVITY];
                    covariance[(place(i), place(j))] =
                        g.covariance[axis][(i, j)] * unit[usize::from(i > 0)] * unit[usize::from(j > 0)];
                }
                // The error of the bias at rest stays.
                covariance[(axis, axis)] += bias.covariance[(axis, axis)];
                for column in 0..3 {
                    parameters[first + 3 * axis + column] = g.by_up[(axis, column)] / STANDARD_GRAVITY;
                }
            }
        }
        Estimate {
            shape,
            parameters,
            covariance,
            chi2_per_dof: Some(self.chi2_per_dof),
            freedom: self.freedom,
            condition: self.condition,
            origin: None,
            ..bias.clone()
        }
    }
}

impl TurnSession {
    /// Directions of specific force before and after a turn.
    fn ups(&self, turn: &TurnSeen, calibration: &Calibration) -> [Vector3<f64>; 2] {
        let at = |end: usize| {
            let force = self.rests.get(turn.rests[end]).map_or(Vector3::zeros(), |rest| rest.force[1 - end]);
            calibration.correct(&force).try_normalize(f64::MIN_POSITIVE).unwrap_or(Vector3::z())
        };
        [at(0), at(1)]
    }

    /// Regresses the mean rates on direction and time; `None` unless that explains their differences.
    fn g_sensitivity(&self, calibration: &Calibration) -> Option<GSensitivity> {
        /// Fewest rests, and least ratio of explained squares to those left over.
        const LEAST: usize = 8;
        const CLEAR: f64 = 8.0;
        let count = self.rests.len();
        if count < LEAST {
            return None;
        }
        let middle = self.rests.iter().map(|rest| rest.time).sum::<f64>() / count as f64;
        let span = self.rests.iter().map(|rest| (rest.time - middle).abs()).fold(1.0, f64::max);
        let regressor = |rest: &RestSeen| {
            let up = calibration.correct(&((rest.force[0] + rest.force[1]) / 2.0));
            let up = up.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
            SVector::<f64, 5>::from([1.0, up.x, up.y, up.z, (rest.time - middle) / span])
        };
        let information: SMatrix<f64, 5, 5> =
            self.rests.iter().map(|rest| regressor(rest) * regressor(rest).transpose()).sum();
        let scaled = information.symmetric_eigenvalues();
        if scaled.min() < 0.05 * count as f64 / 6.0 {
            return None;
        }
        let inverse = information.try_inverse()?;
        let freedom = (count - 5) as f64;
        let mut found =
            GSensitivity { bias: Vector3::zeros(), by_up: Matrix3::zeros(), covariance: [SMatrix::zeros(); 3] };
        let (mut explained, mut left) = (0.0, 0.0);
        for axis in 0..3 {
            let moment: SVector<f64, 5> = self.rests.iter().map(|rest| regressor(rest) * rest.rate[axis]).sum();
            let line = inverse * moment;
            let mean = self.rests.iter().map(|rest| rest.rate[axis]).sum::<f64>() / count as f64;
            let noise = self.rests.iter().map(|rest| rest.rate_noise[axis]).sum::<f64>() / count as f64;
            let of = |error: f64| error * error;
            let squares: f64 = self.rests.iter().map(|rest| of(rest.rate[axis] - regressor(rest).dot(&line))).sum();
            let total: f64 = self.rests.iter().map(|rest| of(rest.rate[axis] - mean)).sum();
            let variance = (squares / freedom).max(noise);
            explained += (total - squares) / variance / 4.0;
            left += 1.0;
            found.bias[axis] = line[0];
            found.by_up.set_row(axis, &line.fixed_rows::<3>(1).transpose());
            let stretch = (student_95(freedom) / NORMAL_95).powi(2);
            found.covariance[axis] = inverse.fixed_view::<4, 4>(0, 0) * (variance * stretch);
        }
        (explained / left > CLEAR).then_some(found)
    }
}

/// Accelerometer before the turns.
struct Given {
    /// Bias and lower-triangular S.
    mean: SVector<f64, 9>,
    /// Inverse covariance of all unknowns.
    prior: Square,
    /// Variance of specific force from placement to placement, (m/s²)².
    placement: f64,
    /// Whether its entries below the diagonal are known from spread poses.
    triangular: bool,
}

impl Given {
    fn of(accelerometer: &Estimate, placement_std: f64) -> Option<Self> {
        let shape = Parameterisation::TRIANGULAR;
        let triangular = accelerometer.shape == shape;
        if !triangular && accelerometer.shape != Parameterisation::DIAGONAL {
            return None;
        }
        let mut covariance = SMatrix::<f64, 9, 9>::identity() * DATASHEET.powi(2);
        let place = |k: usize| if triangular { k } else { [0, 1, 2, 3, 5, 8][k] };
        let count = accelerometer.parameters.len();
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            covariance[(place(i), place(j))] = accelerometer.covariance[(i, j)];
        }
        let mut prior = Square::identity() / DATASHEET.powi(2);
        prior.fixed_view_mut::<9, 9>(9, 9).copy_from(&covariance.try_inverse()?);
        let mean = shape.vector(&accelerometer.calibration());
        Some(Self {
            mean: SVector::from_iterator(mean.iter().copied()),
            prior,
            placement: placement_std * placement_std,
            triangular,
        })
    }
}

/// Linearised equations of a turn.
struct Equations {
    residual: Vector2<f64>,
    by: SMatrix<f64, 2, UNKNOWNS>,
    /// Covariance of the residual: from measured noise, and from assumed errors.
    noise: [Matrix2<f64>; 2],
    /// Covariance with the turn before, likewise, if its second rest is the first of this turn.
    shared: [Matrix2<f64>; 2],
    /// Derivatives of the residual with respect to the directions after and before.
    arrival: [Matrix2x3<f64>; 2],
}

/// Size of the errors.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// Share of the assumed variance that counts.
    share: f64,
    /// Variance added to every equation, rad².
    added: f64,
}

const AS_ASSUMED: Level = Level { share: 1.0, added: 0.0 };

/// Solution of the equations at some weights.
struct SolvedTurns {
    step: TurnRow,
    covariance: Square,
    squares: f64,
    freedom: f64,
}

/// Fit of a subset of the turns.
struct TurnSolution<'a> {
    given: &'a Given,
    at: TurnRow,
    kept: Vec<bool>,
    equations: Vec<Equations>,
    level: Level,
}

impl<'a> TurnSolution<'a> {
    fn of(session: &TurnSession, given: &'a Given, by_up: Matrix3<f64>, kept: &[bool]) -> Result<Self, TooLittle> {
        const ROUNDS: usize = 3;
        /// Largest step of an entry at convergence: less than a hundredth of the precision of any recording.
        const NEAR: f64 = 1e-6;
        let mut at = TurnRow::zeros();
        at.fixed_rows_mut::<9>(9).copy_from(&given.mean);
        let mut found = Self { given, at, kept: kept.to_vec(), equations: Vec::new(), level: AS_ASSUMED };
        for round in 0..ROUNDS {
            found.equations = linearise(session, given, by_up, &found.at);
            if round == 1 {
                // By now the residuals do not come from the linearisation.
                found.level = found.find_level().ok_or(TooLittle::Unsolved)?;
            }
            let solved = found.solve(found.level, None).ok_or(TooLittle::Unsolved)?;
            found.at += solved.step;
            for equations in &mut found.equations {
                equations.residual += equations.by * solved.step;
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
        let (of, mut low, mut high): (&dyn Fn(f64) -> Level, f64, f64) = match over(AS_ASSUMED)? > 0.0 {
            true => (&added, libm::log(1e-5), libm::log(0.3)),
            false => (&scaled, libm::log(1e-3), 0.0),
        };
        // Regula falsi, in its Illinois variant (Dowell & Jarratt, BIT 1971): the logarithms are nearly linear.
        let (mut above, mut below) = (over(of(low))?, over(of(high))?);
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

    /// Residuals and their derivatives, turn by turn, weighted so that their errors are independent and of unit
    /// variance. Errors are shared only with the turn before, so the factor of their covariance is block bidiagonal.
    fn whitened(&self, level: Level, without: Option<usize>) -> Option<Vec<Whitened>> {
        let mut white: Vec<Whitened> = Vec::with_capacity(self.equations.len());
        let mut before: Option<(usize, Matrix2<f64>)> = None;
        for (k, equations) in self.equations.iter().enumerate() {
            if !self.kept.get(k).copied().unwrap_or(false) || without == Some(k) {
                continue;
            }
            let at = |parts: &[Matrix2<f64>; 2]| parts[0] + parts[1] * level.share;
            let mut own = at(&equations.noise) + Matrix2::identity() * level.added;
            let (mut residual, mut by) = (equations.residual, equations.by);
            if let (Some((_, triangle)), Some((last, derivative))) =
                (before.filter(|(earlier, _)| earlier + 1 == k), white.last())
            {
                // Subdiagonal block of the factor: L₂₁ = B L₁⁻ᵀ.
                let shared = triangle.solve_lower_triangular(&at(&equations.shared).transpose())?.transpose();
                own -= shared * shared.transpose();
                residual -= shared * last;
                by -= shared * derivative;
            }
            let triangle = own.cholesky()?.l();
            white.push((triangle.solve_lower_triangular(&residual)?, triangle.solve_lower_triangular(&by)?));
            before = Some((k, triangle));
        }
        Some(white)
    }

    fn solve(&self, level: Level, without: Option<usize>) -> Option<SolvedTurns> {
        let white = self.whitened(level, without)?;
        let mut information = Square::zeros();
        let mut moment = TurnRow::zeros();
        for (residual, by) in &white {
            information += by.tr_mul(by);
            moment += by.tr_mul(residual);
        }
        let mut start = TurnRow::zeros();
        start.fixed_rows_mut::<9>(9).copy_from(&self.given.mean);
        let factor = (information + self.given.prior).cholesky()?;
        let step = -factor.solve(&(moment + self.given.prior * (self.at - start)));
        let covariance = factor.inverse();
        let squares = white.iter().map(|(residual, by)| (residual + by * step).norm_squared()).sum();
        // Degrees of freedom that the data determine, not the prior: tr(P I) = n − tr(P Λ).
        let known = UNKNOWNS as f64 - covariance.dot(&self.given.prior);
        Some(SolvedTurns { step, covariance, squares, freedom: 2.0 * white.len() as f64 - known })
    }

    /// Finds the turn without which the others agree, if it deviates beyond chance.
    fn contradicting(&self) -> Option<usize> {
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
        let size = |(residual, by): &Whitened| (residual + by * all.step).norm_squared();
        let mut largest: Vec<_> = kept.zip(&white).map(|(k, white)| (k, size(white))).collect();
        largest.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let without = |&(k, _): &(usize, f64)| {
            let others = self.solve(AS_ASSUMED, Some(k))?;
            let left = others.squares / others.freedom.max(1.0);
            Some((k, (all.squares - others.squares) / 2.0 / left.max(1.0)))
        };
        let worst = largest.iter().take(TRIED).filter_map(without).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        (worst.1 > BEYOND).then_some(worst.0)
    }

    fn summarise(
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
        let condition = self.condition(&solved).ok_or(TooLittle::Unsolved)?;
        let limit = CONDITIONED[usize::from(!self.given.triangular)];
        if condition > limit {
            return Err(TooLittle::Undistinguished(condition));
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
            condition,
            redundant: left_out.is_none() && self.is_redundant(&solved, &sensitivity, &half_widths),
        })
    }

    /// Information from the turns alone about the accelerometer: that of the joint fit less that of its rests.
    fn told(&self, solved: &SolvedTurns) -> Option<Told> {
        /// Errors common to all turns, such as those of fast motion and of jitter in the stamps, do not show in χ²: in
        /// simulations the errors were up to twice as large as the turns alone indicate.
        const SHARED: f64 = 2.0;
        let stretch = (SHARED * stretch(solved.freedom)).powi(2);
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
        white.iter().all(|(residual, by)| {
            let gain = solved.covariance * by.transpose();
            let left = residual + by * solved.step;
            let Some(inverse) = (Matrix2::identity() - by * gain).try_inverse() else { return false };
            let moved = gain * inverse * left;
            let covariance = of_sensitivity(sensitivity, &(solved.covariance + gain * inverse * gain.transpose()));
            let precise =
                covariance.diagonal().iter().all(|variance| NORMAL_95 * variance.max(0.0).sqrt() <= 2.0 * PRECISE);
            precise && moved.iter().zip(half_widths).all(|(moved, half)| moved.abs() <= 1.5 * half)
        })
    }
}

/// Names of the entries of S, row by row.
const ENTRIES: [&str; 9] =
    ["the x scale", "x by y", "x by z", "y by x", "the y scale", "y by z", "z by x", "z by y", "the z scale"];

/// Inverse sensitivity C of the gyroscope from the unknowns.
fn inverse_of(at: &TurnRow) -> Matrix3<f64> {
    Matrix3::identity() + Matrix3::from_fn(|row, column| at[3 * row + column])
}

/// Covariance of S from that of C: δS = −S δC S.
fn of_sensitivity(sensitivity: &Matrix3<f64>, covariance: &Square) -> SMatrix<f64, 9, 9> {
    let by =
        SMatrix::<f64, 9, 9>::from_fn(|entry, k| -sensitivity[(entry / 3, k / 3)] * sensitivity[(k % 3, entry % 3)]);
    by * covariance.fixed_view::<9, 9>(0, 0) * by.transpose()
}

/// Direction of a specific force, its derivative with respect to the accelerometer's nine parameters, and its
/// covariance from errors of the mean: from noise, and from the scatter between placements.
struct Direction {
    up: Vector3<f64>,
    by: SMatrix<f64, 3, 9>,
    noise: [Matrix3<f64>; 2],
}

impl Direction {
    fn of(rest: &RestSeen, end: usize, accelerometer: &Calibration, placement: f64) -> Self {
        let inverse = accelerometer.inverse();
        let force = accelerometer.correct(&rest.force[end]);
        let length = force.norm().max(f64::MIN_POSITIVE);
        let up = force / length;
        let across = (Matrix3::identity() - up * up.transpose()) * inverse / length;
        let mut by = SMatrix::<f64, 3, 9>::zeros();
        let terms = Parameterisation::TRIANGULAR.terms();
        let truth = super::parameterisation::Truth::of(force);
        for (k, term) in terms.iter().enumerate() {
            by.set_column(k, &(-across.column(term.axis()) * term.regressor(&truth)));
        }
        let noise = across * Matrix3::from_diagonal(&rest.force_noise) * across.transpose();
        Self { up, by, noise: [noise, across * across.transpose() * placement] }
    }
}

fn linearise(session: &TurnSession, given: &Given, by_up: Matrix3<f64>, at: &TurnRow) -> Vec<Equations> {
    let candidate = Candidate::of_inverse(inverse_of(at));
    let parameters = DVector::from_iterator(9, at.iter().skip(9).copied());
    let accelerometer = Parameterisation::TRIANGULAR.calibration(&parameters);
    let mut equations: Vec<Equations> = Vec::with_capacity(session.turns.len());
    for (k, turn) in session.turns.iter().enumerate() {
        let [Some(from), Some(to)] = turn.rests.map(|rest| session.rests.get(rest)) else { continue };
        let before = Direction::of(from, 1, &accelerometer, given.placement);
        let after = Direction::of(to, 0, &accelerometer, given.placement);
        let ends = Ends { up: [before.up, after.up], rate: [from.rate, to.rate], by_up };
        let found = predict(turn.pieces.iter(), &candidate, &ends);
        let across = perpendicular(&after.up);
        let arrival = [-across, across * found.by_up];
        let mut by = SMatrix::<f64, 2, UNKNOWNS>::zeros();
        by.fixed_columns_mut::<9>(0).copy_from(&(across * found.by_inverse));
        by.fixed_columns_mut::<9>(9).copy_from(&(arrival[0] * after.by + arrival[1] * before.by));
        let noise = |cause: usize| {
            arrival[0] * after.noise[cause] * arrival[0].transpose()
                + arrival[1] * before.noise[cause] * arrival[1].transpose()
        };
        // The bias between two rests has half the error of either.
        let by_rate = across * found.by_rate;
        let of_rate = Matrix3::from_diagonal(&((from.rate_noise + to.rate_noise) / 4.0));
        let white = session.random_walk * turn.seconds;
        let measured = noise(0) + by_rate * of_rate * by_rate.transpose() + Matrix2::identity() * white;
        // White noise adds to the roughness, too: a quarter of its sum.
        let on_the_way = (turn.roughness - white / 4.0).max(0.0) + (NONLINEARITY * turn.path).powi(2);
        let assumed = noise(1) + Matrix2::identity() * on_the_way;
        let shared = |cause: usize| match (k.checked_sub(1).and_then(|last| session.turns.get(last)), equations.last())
        {
            (Some(last), Some(earlier)) if last.rests[1] == turn.rests[0] => {
                // The turn before ended with its own reading of the same rest.
                arrival[1] * before.noise[cause] * earlier.arrival[0].transpose()
            }
            _ => Matrix2::zeros(),
        };
        let shared = [shared(0), shared(1)];
        equations.push(Equations {
            residual: across * (found.up - after.up),
            by,
            noise: [measured, assumed],
            shared,
            arrival,
        });
    }
    equations
}

/// Two unit vectors perpendicular to `up` and to each other, as rows.
fn perpendicular(up: &Vector3<f64>) -> Matrix2x3<f64> {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    Matrix2x3::from_rows(&[first.transpose(), up.cross(&first).transpose()])
}
