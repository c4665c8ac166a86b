//! Test whether the bias of an accelerometer moved during its placements: a step of one axis between two of them, or a
//! drift of all three over the whole time.
//!
//! Each hypothesis adds unknowns to the fit, whose size follows from the residuals (a conventional alternative
//! hypothesis, Baarda 1968). It is accepted if that size exceeds the scatter of placements, given the number of
//! hypotheses tried, and if no single wrong placement would explain the residuals better.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};

use super::accelerometer::{Assumptions, MagnitudeEquation, Observation};
use super::calibration::Calibration;
use super::student_t::{normal_beyond, student};

/// Movement of a bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wandering {
    /// Start and end of the movement, s; it is linear in between.
    pub span: [f64; 2],
    /// Change of the bias, m/s².
    pub change: Vector3<f64>,
    /// Standard deviation of the change, m/s².
    pub std: Vector3<f64>,
}

/// Rate of change of the readings at rest, m/s² per second, with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Rate of each axis.
    pub rate: Vector3<f64>,
    /// Standard deviation of each axis.
    pub std: Vector3<f64>,
    /// Degrees of freedom of the standard deviation.
    pub freedom: f64,
}

/// Observed change of an axis: a step of its bias or a tilt of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hint {
    /// Time of the change, s.
    pub time: f64,
    /// Axis that changed.
    pub axis: usize,
    /// Size of the change, m/s².
    pub change: f64,
    /// Standard deviation of the change, m/s².
    pub std: f64,
}

/// Probability that a session of correct placements is accused.
const FALSE_ALARM: f64 = 0.01;
/// Degrees of freedom that the assumed scatter is worth.
const TRUST: f64 = 4.0;
/// Excess of explained squares that makes a wrong placement the likelier explanation: e^−3 is 1 in 20.
const LIKELIER: f64 = 6.0;

impl Wandering {
    /// Share of the change that has happened by a time.
    pub fn share(&self, time: f64) -> f64 {
        let [from, to] = self.span;
        ((time - from) / (to - from).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }

    /// Whether the movement is a step: it takes less than half of the time between the first and the last placement.
    pub fn is_step(&self, first: f64, last: f64) -> bool {
        self.span[1] - self.span[0] < 0.5 * (last - first)
    }
}

/// Equations of the placements, in order of time, with the unknowns solved for.
struct Courses {
    times: Vec<f64>,
    /// Derivatives of the weighted targets with respect to the bias of each axis.
    by_bias: Vec<Vector3<f64>>,
    design: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
    left: DVector<f64>,
    squares: f64,
    /// Placement that deviates most, and by how much the squares decrease without it.
    outlier: usize,
    by_outlier: f64,
    freedom: f64,
}

impl Courses {
    fn of(seen: &[(f64, Observation)], given: &Assumptions<'_>, calibration: &Calibration) -> Option<Self> {
        let mut seen = seen.to_vec();
        seen.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let leaks: Vec<_> = given.shape.unmodelled().collect();
        let terms: Vec<_> = given.shape.terms().iter().copied().chain(leaks.iter().copied()).collect();
        let unknowns = given.shape.unknowns();
        let mut design = DMatrix::zeros(seen.len(), terms.len());
        let mut targets = DVector::zeros(seen.len());
        let mut by_bias = Vec::with_capacity(seen.len());
        for (row, (_, observation)) in seen.iter().enumerate() {
            let line = MagnitudeEquation::of(observation, given, calibration);
            let scatter = line.by_measured.norm_squared() * given.placement_std.powi(2);
            let weight = 1.0 / (scatter + line.noise).sqrt();
            let direction = -line.by_measured * weight;
            for (column, term) in terms.iter().enumerate() {
                design[(row, column)] = direction[term.axis()] * term.regressor(&line.truth);
            }
            targets[row] = -line.residual * weight;
            by_bias.push(direction);
        }
        let mut information = design.tr_mul(&design);
        for k in unknowns..terms.len() {
            information[(k, k)] += 1.0 / given.leak().powi(2).max(1e-12);
        }
        let factor = information.cholesky()?;
        let solution = factor.solve(&design.tr_mul(&targets));
        let left = &targets - &design * &solution;
        let leaked: f64 = (unknowns..terms.len()).map(|k| (solution[k] / given.leak().max(1e-6)).powi(2)).sum();
        let own = |row: usize| {
            let regressors = design.row(row).transpose();
            (1.0 - regressors.dot(&factor.solve(&regressors))).max(1e-9)
        };
        let explained = (0..left.len()).filter(|row| own(*row) > 1e-6).map(|row| (row, left[row].powi(2) / own(row)));
        let (outlier, by_outlier) = explained.max_by(|(_, a), (_, b)| a.total_cmp(b)).unwrap_or((0, 0.0));
        Some(Self {
            times: seen.iter().map(|(time, _)| *time).collect(),
            by_bias,
            squares: left.norm_squared() + leaked,
            freedom: seen.len() as f64 - unknowns as f64,
            design,
            factor,
            left,
            outlier,
            by_outlier,
        })
    }

    /// Information on a change of each axis that follows `share`, and that information times the change.
    fn told(&self, share: impl Fn(usize) -> f64) -> (Matrix3<f64>, Vector3<f64>) {
        let columns = DMatrix::from_fn(self.times.len(), 3, |row, axis| self.by_bias[row][axis] * share(row));
        let passed = self.design.tr_mul(&columns);
        let information = columns.tr_mul(&columns) - passed.tr_mul(&self.factor.solve(&passed));
        let moment = columns.tr_mul(&self.left);
        (Matrix3::from_fn(|i, j| information[(i, j)]), Vector3::from_fn(|i, _| moment[i]))
    }

    /// Variance of a weighted residual if hypotheses with `unknowns` explain so much of the squares.
    fn variance(&self, explained: f64, unknowns: f64) -> f64 {
        let freedom = (self.freedom - unknowns).max(0.0);
        ((self.squares - explained).max(0.0) + TRUST) / (freedom + TRUST)
    }

    /// Student's quantile with a two-sided probability of `tail`.
    fn critical(&self, unknowns: f64, tail: f64) -> f64 {
        student((self.freedom - unknowns).max(0.0) + TRUST, tail, normal_beyond(tail / 2.0))
    }

    /// Excess of squares that one wrong placement explains, in units of 2 ln of the odds.
    fn outlier_lead(&self, explained: f64) -> f64 {
        (self.by_outlier - explained) / self.variance(self.by_outlier.max(explained), 1.0)
    }

    /// Tests a drift of all three axes from the first placement to the last.
    fn ramp(&self, slope: Option<&Slope>) -> Option<(f64, Wandering)> {
        let (&first, &last) = (self.times.first()?, self.times.last()?);
        let length = (last - first).max(f64::MIN_POSITIVE);
        let (information, moment) = self.told(|row| (self.times[row] - first) / length);
        let ridge = Matrix3::identity() * 1e-9 * (1.0 + information.trace());
        let explained = moment.dot(&((information + ridge).try_inverse()? * moment)).max(0.0);
        let variance = self.variance(explained, 3.0);
        let (mut all, mut answer) = (information / variance, moment / variance);
        let mut freedom = (self.freedom - 3.0).max(0.0) + TRUST;
        if let Some(slope) = slope {
            let told = slope.std.map(|std| (std * length).powi(-2));
            // The less certain of the two counts by its share.
            let share = told.sum() / (told.sum() + all.trace()).max(f64::MIN_POSITIVE);
            freedom += (slope.freedom - freedom) * share;
            all += Matrix3::from_diagonal(&told);
            answer += told.component_mul(&(slope.rate * length));
        }
        let covariance = (all + Matrix3::identity() * 1e-9 * (1.0 + all.trace())).try_inverse()?;
        let change = covariance * answer;
        // Three squares at once (Wilson and Hilferty 1931), with Student's tail.
        let tail = FALSE_ALARM / 2.0;
        let normal = normal_beyond(tail);
        let v = 2.0_f64 / 27.0;
        let three = 3.0 * libm::pow(1.0 - v + normal * v.sqrt(), 3.0);
        let heavier = student(freedom, 2.0 * tail, normal) / normal;
        let over = change.dot(&answer).max(0.0).sqrt() / (three.sqrt() * heavier);
        let wandering = Wandering { span: [first, last], change, std: covariance.diagonal().map(f64::sqrt) };
        let told_by_slope = slope.is_some() && explained < 0.5 * change.dot(&answer) * variance;
        (told_by_slope || self.outlier_lead(explained) < LIKELIER).then_some((over, wandering))
    }

    /// Tests a step of one axis between two placements. A step that a single wrong placement explains as well is taken
    /// for one, unless that placement is the last of its axis, which may show the new bias.
    fn step(&self) -> Option<(f64, Wandering)> {
        let count = self.times.len();
        let tells = |row: usize, axis: usize| {
            let direction = &self.by_bias[row];
            direction[axis].abs() > 0.5 * direction.norm()
        };
        let critical = self.critical(1.0, FALSE_ALARM / 2.0 / (1.5 * count as f64).max(1.0));
        let mut best: Option<(f64, Wandering)> = None;
        for axis in 0..3 {
            let size = self.design.ncols();
            let (mut passed, mut own, mut moment) = (DVector::<f64>::zeros(size), 0.0, 0.0);
            let is_last = !(self.outlier + 1..count).any(|row| tells(row, axis));
            let mut behind = 0;
            for row in (1..count).rev() {
                let by = self.by_bias[row][axis];
                passed += self.design.row(row).transpose() * by;
                own += by * by;
                moment += by * self.left[row];
                behind += usize::from(tells(row, axis));
                let before = (0..row).filter(|row| tells(*row, axis)).count();
                // Only between placements that tell about the axis.
                if behind == 0 || before < 2 || !tells(row, axis) {
                    continue;
                }
                let information = own - passed.dot(&self.factor.solve(&passed));
                if information < 1e-3 * own {
                    continue;
                }
                let explained = moment * moment / information;
                let variance = self.variance(explained, 1.0);
                let over = (explained / variance).sqrt() / critical;
                let lead = self.outlier_lead(explained);
                let likelier = lead < -LIKELIER || is_last && lead < LIKELIER;
                if best.as_ref().is_none_or(|(most, _)| over > *most) && likelier {
                    let mut change = Vector3::zeros();
                    change[axis] = moment / information;
                    let mut std = Vector3::zeros();
                    std[axis] = (variance / information).sqrt();
                    best = Some((over, Wandering { span: [self.times[row - 1], self.times[row]], change, std }));
                }
            }
        }
        best
    }

    /// Whether the placements contradict a hinted step.
    fn excludes(&self, hint: &Hint) -> bool {
        /// Odds of 20 to 1, as a logarithm.
        const AGAINST: f64 = 3.0;
        let (information, moment) = self.told(|row| f64::from(u8::from(self.times[row] > hint.time)));
        let (information, moment) = (information[(hint.axis, hint.axis)], moment[hint.axis]);
        if information < 1e-9 {
            return false;
        }
        let variance = self.variance(0.0, 0.0);
        let found = moment / information;
        let spread = variance / information + hint.std * hint.std;
        ((found - hint.change).powi(2) - found * found) / (2.0 * spread) > AGAINST
    }

    /// Largest shift of the unknowns by a step of an axis, in their standard deviations.
    fn moves(&self, hint: &Hint, bars: &[f64]) -> f64 {
        let column = DVector::from_fn(self.times.len(), |row, _| {
            if self.times[row] > hint.time { self.by_bias[row][hint.axis] * hint.change } else { 0.0 }
        });
        let mut moved = self.factor.solve(&self.design.tr_mul(&column));
        let over = |moved: &DVector<f64>| {
            moved.iter().zip(bars).map(|(moved, bar)| moved.abs() / bar.max(f64::MIN_POSITIVE)).fold(0.0, f64::max)
        };
        let before = over(&moved);
        // The biases come first.
        moved[hint.axis] -= hint.change;
        before.max(over(&moved))
    }
}

/// Finds the likeliest movement of the bias beyond chance, if any, from placements with their times (s) and a
/// calibration of them.
pub fn wandering(
    seen: &[(f64, Observation)],
    given: &Assumptions<'_>,
    calibration: &Calibration,
    slope: Option<&Slope>,
) -> Option<Wandering> {
    let courses = Courses::of(seen, given, calibration)?;
    let found = courses.ramp(slope).into_iter().chain(courses.step());
    let (over, wandering) = found.max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    (over > 1.0).then_some(wandering)
}

/// Largest hint that the placements do not exclude as a step of the bias and that would move an unknown by more than
/// its bar (one standard deviation).
pub fn unexcluded(
    seen: &[(f64, Observation)],
    given: &Assumptions<'_>,
    calibration: &Calibration,
    hints: &[Hint],
    bars: &[f64],
) -> Option<Hint> {
    // A change within the scatter of placements is in the bars.
    let scatter = 2.0 * given.placement_std;
    if hints.iter().all(|hint| hint.change.abs() <= scatter) {
        return None;
    }
    let courses = Courses::of(seen, given, calibration)?;
    let counts =
        |hint: &&Hint| hint.change.abs() > scatter && courses.moves(hint, bars) > 1.0 && !courses.excludes(hint);
    hints.iter().filter(counts).max_by(|a, b| a.change.abs().total_cmp(&b.change.abs())).copied()
}

/// Weighted mean of the rates of several rests, each with its standard deviation, m/s² per second.
pub fn slope(rates: &[(Vector3<f64>, f64)]) -> Option<Slope> {
    let freedom = rates.len().checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    let weights: f64 = rates.iter().map(|(_, std)| std.powi(-2)).sum();
    let rate = rates.iter().map(|(rate, std)| rate / (std * std)).sum::<Vector3<f64>>() / weights;
    // Hand-placed sensors settle, each in its own way.
    let scatter = rates.iter().map(|(own, std)| (own - rate).map(|off| (off / std).powi(2))).sum::<Vector3<f64>>();
    let std = scatter.map(|squares| ((squares / freedom).max(1.0) / weights).sqrt());
    (weights.is_finite() && weights > 0.0).then_some(Slope { rate, std, freedom })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    use super::super::{Bounds, Estimator, Gravity, Loss, Parameterisation};
    use super::*;

    const G: f64 = 9.80665;

    /// Result for `visits` placements on each face, four seconds apart, with a bias that moves by `moved`.
    fn found(seed: u64, visits: usize, scatter: f64, moved: impl Fn(f64) -> Vector3<f64>) -> Option<Wandering> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |std: f64| Vector3::from_fn(|_, _| std * random.sample::<f64, _>(StandardNormal));
        let seen: Vec<_> = (0..6 * visits)
            .map(|k| {
                let up = Vector3::ith(k % 3, if k % 6 > 2 { -1.0 } else { 1.0 });
                let (time, tilt) = (4.0 * k as f64, normal(0.02));
                let force = (up + tilt - up * tilt.dot(&up)).normalize() * G;
                let mean = force + normal(scatter) + moved(time / (24.0 * visits as f64));
                (time, Observation { placement: k as u32, mean, noise: Vector3::repeat(3e-6), normal: up })
            })
            .collect();
        let bounds = Bounds::default();
        let given = Assumptions {
            shape: Parameterisation::DIAGONAL,
            estimator: Estimator::Magnitude,
            gravity: Gravity::configured(G),
            placement_std: 0.01,
            cross_axis_std: 0.01,
            nonlinearity: 0.0,
            bounds: &bounds,
            loss: Loss::Square,
            start: Calibration::default(),
        };
        wandering(&seen, &given, &Calibration::default(), None)
    }

    #[test]
    fn placements_that_only_scatter_are_seldom_accused() {
        let accused = (0..400).filter(|seed| found(*seed, 2, 0.01, |_| Vector3::zeros()).is_some()).count();
        assert!(accused <= 12, "{accused} of 400");
        // Nor if they scatter by more than assumed.
        let accused = (0..400).filter(|seed| found(*seed, 3, 0.02, |_| Vector3::zeros()).is_some()).count();
        assert!(accused <= 20, "{accused} of 400");
    }

    #[test]
    fn a_warming_sensor_is_found_out_and_by_how_much() {
        let course = |share: f64| Vector3::new(0.1, -0.08, 0.09) * share;
        let found: Vec<_> = (0..100).filter_map(|seed| found(seed, 3, 0.01, course)).collect();
        assert!(found.len() >= 97, "{}", found.len());
        let near = found.iter().filter(|wandering| (wandering.change - course(1.0)).amax() < 0.07).count();
        assert!(near >= 90, "{near}");
    }

    #[test]
    fn a_step_between_visits_is_found_where_it_was() {
        let step = |share: f64| if share > 0.5 { Vector3::y() * 0.1 } else { Vector3::zeros() };
        let found: Vec<_> = (0..100).filter_map(|seed| found(seed, 4, 0.01, step)).collect();
        assert!(found.len() >= 95, "{}", found.len());
        assert!(found.iter().all(|wandering| (wandering.change.y - 0.1).abs() < 0.06));
    }

    #[test]
    fn the_rate_of_rests_that_settle_each_in_its_own_way_is_uncertain() {
        let rates = [1.0, -1.0, 1.0, -1.0].map(|sign| (Vector3::x() * (0.01 * sign), 1e-4));
        let slope = slope(&rates).unwrap();
        assert!(slope.rate.x.abs() < 1e-9 && slope.std.x > 0.004 && slope.std.y < 1e-4, "{slope:?}");
    }
}
