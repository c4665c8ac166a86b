//! The gyroscope's sensitivity, and the accelerometer's off the diagonal, from turns between rests. Which rests and turns are
//! to be believed is left to the caller.
//!
//! At both ends of a turn the accelerometer says where gravity is, and in between the gyroscope says how the frame turned:
//! two equations a turn. A tilt and a cross-axis sensitivity of the accelerometer look alike at rest, and not while turning,
//! so both sensors are fitted together (gyroscopes alone: Tedaldi, Pretto & Menegatti, "A robust and easy to implement method
//! for IMU calibration without external equipments", ICRA 2014).
//!
//! Weighted Gauss–Newton about the entries of C = S⁻¹ of the gyroscope and all of a lower-triangular S of the accelerometer.
//! Neighbouring turns share what the rest between them errs by. What is only assumed of the errors is scaled down, or an
//! error common to all turns is added, until χ² is as large as its degrees of freedom (Paule & Mandel 1982).

use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::calibration::Calibration;
use super::estimate::Estimate;
use super::parameterisation::Parameterisation;
use super::placement_scatter::stretch;
use super::student_t::{NORMAL_95, student_95};
use crate::turns::{Candidate, Ends, Piece, predict};

/// What the sensors read at a rest.
#[derive(Clone, Debug)]
pub struct RestSeen {
    /// Raw specific force at its start and at its end, m/s².
    pub force: [Vector3<f64>; 2],
    /// Variance of that by noise, per axis.
    pub force_noise: Vector3<f64>,
    /// Raw mean rate, rad/s.
    pub rate: Vector3<f64>,
    /// Variance of that by noise, per axis.
    pub rate_noise: Vector3<f64>,
    /// When it was, s.
    pub time: f64,
}

/// A turn between two of the rests.
#[derive(Clone, Debug)]
pub struct TurnSeen {
    /// Before and after, by their places.
    pub rests: [usize; 2],
    /// Of the raw rates.
    pub pieces: Vec<Piece>,
    /// How long it took.
    pub seconds: f64,
    /// ∫ ‖ω‖ dt, rad.
    pub path: f64,
    /// Variance of its angle about an axis by what is faster than the samples, rad².
    pub roughness: f64,
}

/// Rests and the turns between them, both in order.
#[derive(Clone, Debug, Default)]
pub struct TurnSession {
    /// The rests.
    pub rests: Vec<RestSeen>,
    /// The turns.
    pub turns: Vec<TurnSeen>,
    /// Angle random walk of the gyroscope squared, rad²/s.
    pub random_walk: f64,
}

/// Entries of the accelerometer's S below the diagonal: row y column x, z x, z y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffDiagonals {
    /// Their values.
    pub value: Vector3<f64>,
    /// Their covariance, stretched so that 1.96 standard deviations are half of a 95 % interval.
    pub covariance: Matrix3<f64>,
}

impl OffDiagonals {
    /// Row and column of each.
    pub const ENTRIES: [(usize, usize); 3] = [(1, 0), (2, 0), (2, 1)];

    /// Half of the widest 95 % interval.
    pub fn half_width(&self) -> f64 {
        NORMAL_95 * self.covariance.diagonal().max().max(0.0).sqrt()
    }
}

/// What turns say of an accelerometer whose S is lower-triangular, in the order of its parameters, whatever its rests say.
#[derive(Clone, Debug, PartialEq)]
pub struct Told {
    /// Inverse covariance, shrunk by Student's quantile.
    pub information: SMatrix<f64, 9, 9>,
    /// That times the parameters that the turns alone would have.
    pub moment: SVector<f64, 9>,
}

impl From<&OffDiagonals> for Told {
    /// These entries, and nothing of the others.
    fn from(entries: &OffDiagonals) -> Self {
        let mut told = Self { information: SMatrix::zeros(), moment: SVector::zeros() };
        let Some(information) = entries.covariance.try_inverse() else { return told };
        let moment = information * entries.value;
        // Their places among the nine.
        for (i, row) in OFF.map(|place| place - 9).into_iter().enumerate() {
            told.moment[row] = moment[i];
            for (j, column) in OFF.map(|place| place - 9).into_iter().enumerate() {
                told.information[(row, column)] = information[(i, j)];
            }
        }
        told
    }
}

/// What a gyroscope makes of specific force at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct GSensitivity {
    /// Bias where there is no specific force, rad/s.
    pub bias: Vector3<f64>,
    /// By a unit vector along specific force, rad/s.
    pub by_up: Matrix3<f64>,
    /// Of each axis: covariance of its bias and its row, stretched likewise.
    pub covariance: [SMatrix<f64, 4, 4>; 3],
}

/// What the turns say.
#[derive(Clone, Debug)]
pub struct TurnEstimate {
    /// S of the gyroscope.
    pub sensitivity: Matrix3<f64>,
    /// Of its entries row by row, stretched likewise.
    pub covariance: SMatrix<f64, 9, 9>,
    /// Of the accelerometer.
    pub off_diagonals: OffDiagonals,
    /// The accelerometer as rests and turns together have it: bias and a lower-triangular S.
    pub accelerometer: SVector<f64, 9>,
    /// What the turns say of it by themselves.
    pub told: Told,
    /// Where the rests show one.
    pub g_sensitivity: Option<GSensitivity>,
    /// Angle between gravity as predicted and as seen, of each turn, rad.
    pub residuals: Vec<f64>,
    /// The turn that contradicts the others, if one does; it does not count.
    pub left_out: Option<usize>,
    /// Turns that count.
    pub used: usize,
    /// χ² over its degrees of freedom before anything was scaled or added.
    pub chi2_per_dof: f64,
    /// Its degrees of freedom.
    pub freedom: f64,
    /// Error common to all turns that had to be added, rad.
    pub added: f64,
    /// Condition number of what the turns say, each unknown in its own unit.
    pub condition: f64,
    /// Whether any one turn less says the same.
    pub redundant: bool,
}

/// Why turns say too little.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TooLittle {
    /// Turns between accepted rests.
    #[error(
        "{turned} turns by 30° or more between accepted rests, {LEAST_TURNS} are needed: turn it from face to face"
    )]
    Few {
        /// Of gravity by so much.
        turned: usize,
    },
    /// Turns that leave next to nothing over once their unknowns are fitted.
    #[error("{turns} turns do not check each other yet: turn it on from face to face, about all axes")]
    Unchecked {
        /// Turns that count.
        turns: usize,
    },
    /// Rotations that gravity does not feel.
    #[error(
        "the turns are about the vertical ({turned} of {all} tilt it by 30° or more), and such turns show no scale: turn the sensor \
         over, or declare what the rotations were"
    )]
    AboutVertical {
        /// Turns that tilt it.
        turned: usize,
        /// All turns.
        all: usize,
    },
    /// Half of a 95 % interval, and which entry.
    #[error("the turns tell {entry} to ±{:.2} %, and ±{:.1} % would do: more turns, about all axes", 100.0 * half_width, 100.0 * PRECISE)]
    Imprecise {
        /// In words.
        entry: &'static str,
        /// Of its 95 % interval.
        half_width: f64,
    },
    /// The condition number.
    #[error("the turns do not tell the axes apart (condition number {0:.0}): turn it about the others, too")]
    Undistinguished(f64),
    /// The equations have no solution.
    #[error("the turns contradict the rests")]
    Unsolved,
}

/// m/s².
const STANDARD_GRAVITY: f64 = 9.806_65;
const UNKNOWNS: usize = 18;
/// Places of the accelerometer's entries below the diagonal.
const OFF: [usize; 3] = [13, 15, 16];
/// Entries of an inverse sensitivity are off by this by the datasheet, one standard deviation.
const DATASHEET: f64 = 0.03;
/// Of the path of a turn: what a gyroscope's nonlinearity makes of it.
const NONLINEARITY: f64 = 2e-4;
const LEAST_TURNS: usize = 8;
const LEAST_FREEDOM: f64 = 7.0;
/// Gravity must turn by so much, rad.
const TURNED: f64 = std::f64::consts::FRAC_PI_6;
/// Half of a 95 % interval.
const PRECISE: f64 = 0.005;
/// Of the gyroscope's entries alone, and of the accelerometer's with them.
const CONDITIONED: [f64; 2] = [50.0, 100.0];

type TurnRow = SVector<f64, UNKNOWNS>;
/// Residual and derivatives of a turn, weighted.
type Whitened = (Vector2<f64>, SMatrix<f64, 2, UNKNOWNS>);
type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Fits the turns beside an accelerometer that is known from its rests, whose placements scatter by `placement_std` (m/s²).
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

    /// The gyroscope with a bias that rests tell.
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
                // What the bias may be off by all the same.
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
    /// Directions of specific force before and after.
    fn ups(&self, turn: &TurnSeen, calibration: &Calibration) -> [Vector3<f64>; 2] {
        let at = |end: usize| {
            let force = self.rests.get(turn.rests[end]).map_or(Vector3::zeros(), |rest| rest.force[1 - end]);
            calibration.correct(&force).try_normalize(f64::MIN_POSITIVE).unwrap_or(Vector3::z())
        };
        [at(0), at(1)]
    }

    /// Regression of the mean rates on direction and time, if it explains what they differ by.
    fn g_sensitivity(&self, calibration: &Calibration) -> Option<GSensitivity> {
        /// Fewest rests, and by how much the explained squares exceed those left over.
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

/// The accelerometer before the turns.
struct Given {
    /// Of a lower-triangular S.
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

/// The equations of a turn, linearised.
struct Equations {
    residual: Vector2<f64>,
    by: SMatrix<f64, 2, UNKNOWNS>,
    /// Covariance by what was measured, and by what is assumed.
    noise: [Matrix2<f64>; 2],
    /// The same with the turn before, whose second rest is the first of this one.
    shared: [Matrix2<f64>; 2],
    /// How the errors of the directions after and before arrive.
    arrival: [Matrix2x3<f64>; 2],
}

/// How large errors are.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// Of what is assumed.
    share: f64,
    /// Variance added to every equation, rad².
    added: f64,
}

const AS_ASSUMED: Level = Level { share: 1.0, added: 0.0 };

/// Equations solved at some weights.
struct SolvedTurns {
    step: TurnRow,
    covariance: Square,
    squares: f64,
    freedom: f64,
}

/// A fit of some of the turns.
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
        /// Of an entry: less than a hundredth of what any recording tells.
        const NEAR: f64 = 1e-6;
        let mut at = TurnRow::zeros();
        at.fixed_rows_mut::<9>(9).copy_from(&given.mean);
        let mut found = Self { given, at, kept: kept.to_vec(), equations: Vec::new(), level: AS_ASSUMED };
        for round in 0..ROUNDS {
            found.equations = linearise(session, given, by_up, &found.at);
            if round == 1 {
                // What is left over by now is no fault of the linearisation.
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

    /// The weights at which χ² is as large as its degrees of freedom.
    fn find_level(&self) -> Option<Level> {
        const STEPS: usize = 12;
        /// Of a logarithm: weights that are off by this change no digit that is shown.
        const NEAR: f64 = 1e-3;
        let over = |level: Level| {
            self.solve(level, None)
                .map(|solved| libm::log(solved.squares.max(f64::MIN_POSITIVE) / solved.freedom.max(1e-3)))
        };
        let scaled = |log: f64| Level { share: libm::exp(log), added: 0.0 };
        let added = |log: f64| Level { share: 1.0, added: libm::exp(2.0 * log) };
        // From a hundredth of a mrad to more than anybody errs by; or from next to nothing to all that is assumed.
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

    /// Residuals and their derivatives, weighted so that their errors are independent and of unit variance; turn by turn.
    /// Errors are shared with the turn before alone, so the factor of their covariance has two diagonals of blocks.
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
                // own row of the factor: L₂₁ = B L₁⁻ᵀ.
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
        // What the prior does not make known: tr(P I) = n - tr(P Λ).
        let known = UNKNOWNS as f64 - covariance.dot(&self.given.prior);
        Some(SolvedTurns { step, covariance, squares, freedom: 2.0 * white.len() as f64 - known })
    }

    /// The turn without which the others agree, if there is one beyond chance.
    fn contradicting(&self) -> Option<usize> {
        /// What the squares of one turn exceed those of the others by, each over its degrees of freedom.
        const BEYOND: f64 = 12.0;
        /// So many that stand out are tried.
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

    /// Of what all say of the accelerometer, what its rests said is taken out again.
    fn told(&self, solved: &SolvedTurns) -> Option<Told> {
        /// What all turns share, as fast motion and stamps that jitter make it, shows in no χ²: of simulated sensors the errors
        /// were up to twice as large as the turns say by themselves.
        const SHARED: f64 = 2.0;
        let stretch = (SHARED * stretch(solved.freedom)).powi(2);
        let all = solved.covariance.fixed_view::<9, 9>(9, 9).try_inverse()?;
        let rests = self.given.prior.fixed_view::<9, 9>(9, 9);
        let moment = all * self.at.fixed_rows::<9>(9) - rests * self.given.mean;
        Some(Told { information: (all - rests) / stretch, moment: moment / stretch })
    }

    /// Of what the turns alone say of the gyroscope, and of the accelerometer's entries where they are not known otherwise.
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

    /// Whether the others say the same without any one turn, and as precisely as is asked for. What a turn adds to those
    /// before it is taken out again (the deletion formula of Cook and Weisberg, "Residuals and influence in regression", 1982).
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

/// The entries of S row by row, in words.
const ENTRIES: [&str; 9] =
    ["the x scale", "x by y", "x by z", "y by x", "the y scale", "y by z", "z by x", "z by y", "the z scale"];

/// C of the unknowns.
fn inverse_of(at: &TurnRow) -> Matrix3<f64> {
    Matrix3::identity() + Matrix3::from_fn(|row, column| at[3 * row + column])
}

/// Covariance of S by that of C: δS = −S δC S.
fn of_sensitivity(sensitivity: &Matrix3<f64>, covariance: &Square) -> SMatrix<f64, 9, 9> {
    let by =
        SMatrix::<f64, 9, 9>::from_fn(|entry, k| -sensitivity[(entry / 3, k / 3)] * sensitivity[(k % 3, entry % 3)]);
    by * covariance.fixed_view::<9, 9>(0, 0) * by.transpose()
}

/// Direction of a specific force and how it moves with the accelerometer's nine parameters, and the covariance that errors
/// of the mean give it: by noise, and by a unit of variance between placements.
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
        // A bias between two rests errs by half of what either does.
        let by_rate = across * found.by_rate;
        let of_rate = Matrix3::from_diagonal(&((from.rate_noise + to.rate_noise) / 4.0));
        let white = session.random_walk * turn.seconds;
        let measured = noise(0) + by_rate * of_rate * by_rate.transpose() + Matrix2::identity() * white;
        // White noise is rough, too: a quarter of what it adds up to.
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

/// Two unit vectors perpendicular to one and to each other, as rows.
fn perpendicular(up: &Vector3<f64>) -> Matrix2x3<f64> {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    Matrix2x3::from_rows(&[first.transpose(), up.cross(&first).transpose()])
}
