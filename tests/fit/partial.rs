//! What a few placements determine of an accelerometer: which sums, and intervals that hold as often as they say.

use nalgebra::{Matrix3, SVector, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::fit::accelerometer::{Assumptions, Observation};
use stillpoint::fit::partial::{Combination, Shown, combinations};
use stillpoint::fit::{Bounds, Calibration, Estimator, Fixture, Gravity, Loss, Parameterisation};

const G: f64 = 9.80665;
/// Tilt of a face, rad, and what the entries of S and the placements scatter by: as assumed.
const TILT: f64 = 0.052;
const CROSS: f64 = 0.01;
const SCATTER: f64 = 0.01;

fn given(bounds: &Bounds, shape: Parameterisation, gravity: Gravity) -> Assumptions<'_> {
    Assumptions {
        shape,
        estimator: Estimator::Magnitude,
        gravity,
        placement_std: SCATTER,
        cross_axis_std: CROSS,
        nonlinearity: 0.0,
        loss: Loss::Square,
        bounds,
        start: Calibration::default(),
    }
}

/// A sensor drawn from what is assumed, and its readings.
struct Sensor {
    truth: Calibration,
    gravity: f64,
    random: ChaCha8Rng,
}

impl Sensor {
    fn new(seed: u64, bias: f64, gravity: Gravity) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let bias = Vector3::from_fn(|_, _| random.random_range(-bias..bias));
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let sensitivity =
            Matrix3::from_fn(|row, column| if row == column { 1.0 + 0.02 * normal() } else { CROSS * normal() });
        let gravity = gravity.value + gravity.std * normal();
        Self { truth: Calibration { bias, sensitivity }, gravity, random }
    }

    fn normal(&mut self) -> f64 {
        self.random.sample(StandardNormal)
    }

    /// Placements in one direction, off its nominal one by a tilt that they share.
    fn place(&mut self, normal: Vector3<f64>, face: Option<usize>, tilt: f64, times: usize) -> Vec<Shown> {
        let lean = Vector3::from_fn(|_, _| tilt * self.normal());
        let up = (normal + lean - normal * normal.dot(&lean)).normalize();
        let noise = 1e-3;
        let place = |_| {
            let off = Vector3::from_fn(|_, _| libm::hypot(SCATTER, noise) * self.normal());
            let mean = self.truth.measure(&(up * self.gravity)) + off;
            let observation = Observation { placement: 0, mean, noise: Vector3::repeat(noise * noise), normal };
            Shown { observation, face }
        };
        (0..times).map(place).collect()
    }

    fn error(&self, known: &Combination) -> f64 {
        let truth = SVector::from_column_slice(Parameterisation::MATRIX.vector(&self.truth).as_slice());
        known.value - known.coefficients.dot(&truth)
    }
}

/// A session: faces by index and how often each is shown, and poses on no face.
#[derive(Clone, Copy)]
struct Session {
    name: &'static str,
    faces: &'static [(usize, usize)],
    poses: &'static [[f64; 3]],
    /// Largest bias, and the bounds of bias and scale that are known.
    bias: f64,
    bounds: Option<(f64, f64)>,
    gravity: Gravity,
    shape: Parameterisation,
    /// Fewest sums that are known.
    least: usize,
}

#[test]
fn intervals_of_sums_hold_as_often_as_they_say() {
    let (standard, measured) = (Gravity::standard(), Gravity::configured(G));
    let diagonal = Parameterisation::DIAGONAL;
    let preset = Some((0.6, 0.035));
    let session = Session {
        name: "",
        faces: &[],
        poses: &[],
        bias: 0.5,
        bounds: None,
        gravity: measured,
        shape: diagonal,
        least: 1,
    };
    let sessions = [
        Session { name: "one face once", faces: &[(0, 1)], ..session },
        Session { name: "one face once, gravity unknown", faces: &[(0, 1)], gravity: standard, ..session },
        Session { name: "one face four times", faces: &[(3, 4)], ..session },
        Session { name: "one face twelve times", faces: &[(3, 12)], ..session },
        Session { name: "two opposite faces", faces: &[(0, 1), (1, 1)], least: 2, ..session },
        Session { name: "two faces", faces: &[(0, 2), (4, 1)], least: 2, ..session },
        Session { name: "five faces", faces: &[(0, 1), (1, 1), (2, 1), (3, 1), (4, 1)], least: 5, ..session },
        Session { name: "one face, large biases", faces: &[(2, 1)], bias: 1.5, ..session },
        Session { name: "one face, datasheet", faces: &[(0, 1)], bounds: preset, ..session },
        Session {
            name: "on no face, datasheet",
            poses: &[[1.0, 1.0, 0.3], [-1.0, 0.4, 0.8]],
            bounds: preset,
            ..session
        },
        Session {
            name: "exact fixture",
            faces: &[(0, 1), (3, 1)],
            shape: Parameterisation::MATRIX,
            least: 6,
            ..session
        },
    ];
    let fixture = Fixture::cube();
    let mut failures = Vec::new();
    for session in &sessions {
        let mut bounds = Bounds::default();
        if let Some((bias, scale)) = session.bounds {
            (bounds.accel_bias, bounds.accel_scale) = ([-bias, bias].into(), [1.0 - scale, 1.0 + scale].into());
        }
        let tilt = if session.shape == Parameterisation::MATRIX { 0.001 } else { TILT };
        let (mut inside, mut all, mut fewest, mut widest) = (0, 0, usize::MAX, 0.0_f64);
        const SEEDS: u64 = 1500;
        for seed in 0..SEEDS {
            let mut sensor = Sensor::new(seed, session.bias, session.gravity);
            let mut shown = Vec::new();
            for (face, times) in session.faces {
                shown.extend(sensor.place(fixture.faces()[*face].normal, Some(*face), tilt, *times));
            }
            for pose in session.poses {
                shown.extend(sensor.place(Vector3::from(*pose).normalize(), None, tilt, 1));
            }
            let given = given(&bounds, session.shape, session.gravity);
            let known = combinations(&shown, &given, tilt).unwrap();
            fewest = fewest.min(known.len());
            for known in &known {
                inside += usize::from(sensor.error(known).abs() <= 1.96 * known.std);
                all += 1;
                widest = widest.max(known.std);
            }
        }
        let share = 100.0 * inside as f64 / all as f64;
        println!("{:32} {share:5.1} % of {all}, at least {fewest} a session, std up to {widest:.4}", session.name);
        if !(93.0..=97.0).contains(&share) || fewest < session.least {
            failures.push(session.name);
        }
    }
    assert_eq!(failures, Vec::<&str>::new());
}

fn of(coefficients: &[(usize, f64)]) -> SVector<f64, 12> {
    let mut all = SVector::zeros();
    coefficients.iter().for_each(|(i, value)| all[*i] = *value);
    all
}

#[test]
fn one_face_tells_a_sum_and_opposite_faces_both_of_its_parts() {
    let bounds = Bounds::default();
    let given = given(&bounds, Parameterisation::DIAGONAL, Gravity::configured(G));
    let mut sensor = Sensor::new(3, 0.5, Gravity::configured(G));
    let fixture = Fixture::cube();
    let mut place = |face: usize| sensor.place(fixture.faces()[face].normal, Some(face), 0.01, 1);
    let (up, down, aside) = (place(0), place(1), place(3));
    let sums = |shown: &[Shown]| -> Vec<_> {
        combinations(shown, &given, TILT).unwrap().into_iter().map(|known| known.coefficients).collect()
    };
    assert_eq!(sums(&up), [of(&[(0, 1.0), (3, G)])]);
    // A sum begins with a positive coefficient.
    assert_eq!(sums(&down), [of(&[(0, 1.0), (3, -G)])]);
    let both = [up, down].concat();
    assert_eq!(sums(&both), [of(&[(0, 1.0)]), of(&[(3, 1.0)])]);
    assert_eq!(sums(&[both, aside].concat()), [of(&[(0, 1.0)]), of(&[(3, 1.0)]), of(&[(1, 1.0), (7, -G)])]);
}

#[test]
fn a_rest_on_no_face_tells_nothing_of_a_sensor_that_may_have_any_bias() {
    let bounds = Bounds::default();
    let given = given(&bounds, Parameterisation::DIAGONAL, Gravity::configured(G));
    let mut sensor = Sensor::new(3, 0.5, Gravity::configured(G));
    let shown = sensor.place(Vector3::new(1.0, 1.0, 0.3).normalize(), None, 0.0, 1);
    assert_eq!(combinations(&shown, &given, TILT), Ok(Vec::new()));
}

#[test]
fn placements_of_one_face_that_differ_contradict_each_other() {
    let bounds = Bounds::default();
    let given = given(&bounds, Parameterisation::DIAGONAL, Gravity::configured(G));
    let mut sensor = Sensor::new(3, 0.5, Gravity::configured(G));
    let mut shown = sensor.place(Vector3::x(), Some(0), 0.0, 2);
    shown[1].observation.mean.x += 0.3;
    let against = combinations(&shown, &given, TILT).unwrap_err();
    assert!(against.rms > against.limit && (0.15..0.3).contains(&against.rms), "{against:?}");
}
