//! Test whether the bias of an accelerometer moved during its placements: a step of one axis between two of them, or a
//! drift of all three over the whole time.
//!
//! Each hypothesis adds unknowns to the fit, whose size follows from the residuals (a conventional alternative
//! hypothesis, Baarda 1968). It is accepted if that size exceeds the scatter of placements, given the number of
//! hypotheses tried, and if no single wrong placement would explain the residuals better.
//!
//! A placement shows the bias along the vertical. Turns show it across: a bias that moved tilts gravity as the
//! accelerometer sees it, and not as the gyroscope predicts it.

mod bias_equations;
mod courses;

use nalgebra::{DVector, Matrix3, Vector3};

use self::courses::{Courses, FURTHER, Step, TRUST};
use super::accelerometer::{Assumptions, Observation};
use super::calibration::Calibration;
use super::student_t::{normal_beyond, student};
use super::turn_fit::BiasCourses;

/// Movement of a bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wandering {
    /// Start and end of the movement, s; it is linear in between.
    pub span: [f64; 2],
    /// Change of the bias, m/s².
    pub change: Vector3<f64>,
    /// Standard deviation of the change, m/s².
    pub std: Vector3<f64>,
    /// Whether no single wrong placement explains the residuals as well.
    pub is_certain: bool,
    /// Ratio of what it explains to what chance may explain.
    pub over: f64,
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
const FALSE_ALARM: f64 = 0.02;
/// Excess of explained squares that makes a wrong placement the likelier explanation: e^−3 is 1 in 20.
const LIKELIER: f64 = 6.0;

impl Wandering {
    /// Share of the change that has happened by a time.
    pub fn share(&self, time: f64) -> f64 {
        let [from, to] = self.span;
        ((time - from) / (to - from).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
    }

    /// Whether it explains more than chance may.
    pub fn is_beyond_chance(&self) -> bool {
        self.over > 1.0
    }

    /// Whether the movement is a step: it takes less than half of the time between the first and the last placement.
    pub fn is_step(&self, first: f64, last: f64) -> bool {
        self.span[1] - self.span[0] < 0.5 * (last - first)
    }
}

/// Movement with what speaks for it.
struct Hypothesis {
    /// Squares that it explains, less what further unknowns explain by chance.
    explained: f64,
    wandering: Wandering,
}

impl Courses {
    /// Student's quantile with a two-sided probability of `tail`.
    fn critical(&self, unknowns: f64, tail: f64) -> f64 {
        student((self.freedom - unknowns).max(0.0) + TRUST, tail, normal_beyond(tail / 2.0))
    }

    /// Tests a drift of all three axes from the first placement to the last.
    fn ramp(&self, slope: Option<&Slope>) -> Option<Hypothesis> {
        let (&first, &last) = (self.times.first()?, self.times.last()?);
        let length = (last - first).max(f64::MIN_POSITIVE);
        let (information, moment) = self.told(|time| (time - first) / length);
        let ridge = Matrix3::identity() * 1e-9 * (1.0 + information.trace());
        let explained = moment.dot(&((information + ridge).try_inverse()? * moment)).max(0.0);
        let (mut all, mut answer) = (information, moment);
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
        let all_explained = change.dot(&answer).max(0.0);
        let over = all_explained.sqrt() / (three.sqrt() * heavier);
        let std = covariance.diagonal().map(f64::sqrt);
        let wandering = Wandering { span: [first, last], change, std, is_certain: true, over };
        let told_by_slope = slope.is_some() && explained < 0.5 * all_explained;
        let likelier = told_by_slope || self.outlier.1 - explained < LIKELIER;
        likelier.then_some(Hypothesis { explained: all_explained - FURTHER, wandering })
    }

    /// Tests a step of one axis between two placements. A step that a single wrong placement explains better is taken
    /// for one; the last placement of an axis may show the new bias as well.
    fn step(&self) -> Option<Hypothesis> {
        let count = self.times.len();
        let critical = self.critical(1.0, FALSE_ALARM / 2.0 / (1.5 * count as f64).max(1.0));
        let wanders = |Step { axis, at, moment, information, explained, .. }: Step| {
            let is_last = !(self.outlier.0 + 1..count).any(|row| self.tells(row, axis));
            let lead = self.outlier.1 - explained;
            let (mut change, mut std) = (Vector3::zeros(), Vector3::zeros());
            (change[axis], std[axis]) = (moment / information, information.sqrt().recip());
            let is_certain = lead < -LIKELIER || is_last;
            let span = [self.times[at - 1], self.times[at]];
            let wandering = Wandering { span, change, std, is_certain, over: explained.sqrt() / critical };
            (lead < LIKELIER).then_some(Hypothesis { explained, wandering })
        };
        self.steps().into_iter().filter_map(wanders).max_by(|a, b| a.explained.total_cmp(&b.explained))
    }

    /// Whether the equations contradict a hinted step.
    fn excludes(&self, hint: &Hint) -> bool {
        /// Odds of 20 to 1, as a logarithm.
        const AGAINST: f64 = 3.0;
        let (information, moment) = self.told(|time| f64::from(u8::from(time > hint.time)));
        let (information, moment) = (information[(hint.axis, hint.axis)], moment[hint.axis]);
        if information < 1e-9 {
            return false;
        }
        let found = moment / information;
        let spread = 1.0 / information + hint.std * hint.std;
        ((found - hint.change).powi(2) - found * found) / (2.0 * spread) > AGAINST
    }

    /// Largest shift of the unknowns by a step of an axis, in their standard deviations.
    fn moves(&self, hint: &Hint, stds: &[f64]) -> f64 {
        let mut moved = self.shift(hint.axis, |time| if time > hint.time { hint.change } else { 0.0 });
        let over = |moved: &DVector<f64>| {
            moved.iter().zip(stds).map(|(moved, std)| moved.abs() / std.max(f64::MIN_POSITIVE)).fold(0.0, f64::max)
        };
        let before = over(&moved);
        // The biases come first.
        moved[hint.axis] -= hint.change;
        before.max(over(&moved))
    }
}

/// Finds the likeliest movement of the bias, beyond chance if there is one, from placements with their times (s) and a
/// calibration of them, and from the turns between them.
pub fn wandering(
    seen: &[(f64, Observation)],
    given: &Assumptions<'_>,
    calibration: &Calibration,
    slope: Option<&Slope>,
    turns: Option<&BiasCourses>,
) -> Option<Wandering> {
    let courses = Courses::of(seen, given, calibration, turns)?;
    let likelier = |a: &Hypothesis, b: &Hypothesis| {
        let accepted = |found: &Hypothesis| found.wandering.is_beyond_chance();
        accepted(a).cmp(&accepted(b)).then(a.explained.total_cmp(&b.explained))
    };
    courses.ramp(slope).into_iter().chain(courses.step()).max_by(likelier).map(|found| found.wandering)
}

/// Largest hint that the placements do not exclude as a step of the bias and that would move an unknown by more than
/// its standard deviation.
pub fn unexcluded(
    seen: &[(f64, Observation)],
    given: &Assumptions<'_>,
    calibration: &Calibration,
    hints: &[Hint],
    stds: &[f64],
    turns: Option<&BiasCourses>,
) -> Option<Hint> {
    // A change within the scatter of placements is in the bars.
    let scatter = 2.0 * given.placement_std;
    if hints.iter().all(|hint| hint.change.abs() <= scatter) {
        return None;
    }
    let courses = Courses::of(seen, given, calibration, turns)?;
    let counts =
        |hint: &&Hint| hint.change.abs() > scatter && courses.moves(hint, stds) > 1.0 && !courses.excludes(hint);
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
        wandering(&seen, &given, &Calibration::default(), None, None).filter(Wandering::is_beyond_chance)
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
