//! Equations of the turns, linearised: the direction of gravity after each, as predicted and as measured.

use nalgebra::{DVector, Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::session::{RestSeen, TurnSession};
use super::vertical_equation::{NONLINEARITY, VerticalEquation};
use crate::fit::calibration::Calibration;
use crate::fit::estimate::Estimate;
use crate::fit::parameterisation::{Parameterisation, Truth};
use crate::turns::{Candidate, Ends, predict};

/// Entries of C = S⁻¹ of the gyroscope less I, and the nine parameters of the accelerometer.
pub(super) const UNKNOWNS: usize = 18;

/// Prior standard deviation of an entry of an inverse sensitivity, as of datasheets.
pub(super) const DATASHEET: f64 = 0.03;

pub(super) type TurnRow = SVector<f64, UNKNOWNS>;

pub(super) type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Accelerometer before the turns.
pub(super) struct Given {
    /// Bias and lower-triangular S.
    pub(super) mean: SVector<f64, 9>,
    /// Inverse covariance of all unknowns.
    pub(super) prior: Square,
    /// Variance of specific force from placement to placement, (m/s²)².
    pub(super) placement: f64,
    /// Whether its entries below the diagonal are known from spread poses.
    pub(super) triangular: bool,
}

impl Given {
    pub(super) fn of(accelerometer: &Estimate, placement_std: f64) -> Option<Self> {
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
pub(super) struct Equations {
    pub(super) residual: Vector2<f64>,
    pub(super) by: SMatrix<f64, 2, UNKNOWNS>,
    /// Covariance of the residual: from measured noise, and from assumed errors.
    pub(super) noise: [Matrix2<f64>; 2],
    /// Covariance with the turn before, likewise, if its second rest is the first of this turn.
    pub(super) shared: [Matrix2<f64>; 2],
    /// Derivatives of the residual with respect to the accelerometer's bias after and before.
    pub(super) by_bias: [Matrix2x3<f64>; 2],
    /// Derivatives of the residual with respect to the directions after and before.
    arrival: [Matrix2x3<f64>; 2],
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
        let truth = Truth::of(force);
        for (k, term) in terms.iter().enumerate() {
            by.set_column(k, &(-across.column(term.axis()) * term.regressor(&truth)));
        }
        let noise = across * Matrix3::from_diagonal(&rest.force_noise) * across.transpose();
        Self { up, by, noise: [noise, across * across.transpose() * placement] }
    }
}

/// Linearises the turns about these unknowns.
pub(super) fn linearise(
    session: &TurnSession,
    given: &Given,
    by_up: Matrix3<f64>,
    at: &TurnRow,
) -> (Vec<Equations>, Vec<VerticalEquation>) {
    let mut known: Vec<VerticalEquation> = Vec::new();
    let candidate = Candidate::of_inverse(inverse_of(at));
    let parameters = DVector::from_iterator(9, at.iter().skip(9).copied());
    let accelerometer = Parameterisation::TRIANGULAR.calibration(&parameters);
    let mut equations: Vec<Equations> = Vec::with_capacity(session.turns.len());
    for (k, turn) in session.turns.iter().enumerate() {
        let [Some(from), Some(to)] = turn.rests.map(|rest| session.rests.get(rest)) else { continue };
        let before = Direction::of(from, 1, &accelerometer, given.placement);
        let after = Direction::of(to, 0, &accelerometer, given.placement);
        let ends = Ends { up: [before.up, after.up], rate: [from.rate, to.rate], by_up };
        known.extend(VerticalEquation::of(session, k, &candidate, &ends, known.last()));
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
            by_bias: [arrival[0] * after.by.fixed_columns::<3>(0), arrival[1] * before.by.fixed_columns::<3>(0)],
            arrival,
        });
    }
    (equations, known)
}

/// Inverse sensitivity C of the gyroscope from the unknowns.
pub(super) fn inverse_of(at: &TurnRow) -> Matrix3<f64> {
    Matrix3::identity() + Matrix3::from_fn(|row, column| at[3 * row + column])
}

/// Two unit vectors perpendicular to `up` and to each other, as rows.
fn perpendicular(up: &Vector3<f64>) -> Matrix2x3<f64> {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
    Matrix2x3::from_rows(&[first.transpose(), up.cross(&first).transpose()])
}
