//! Bars that mean what they say: against brute force, and against rests that the fit has not seen.

use std::collections::BTreeMap;

use crate::common::needs::recording;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::config::{Config, Layer};
use stillpoint::fit::accelerometer::{self, Assumptions, Observation};
use stillpoint::fit::{Bounds, Calibration, Estimate, Estimator, Gravity, Loss, Parameterisation, Truth};
use stillpoint::run::{self, Input};

const G: f64 = 9.80665;

/// `None` if they do not determine the parameters.
fn fit(observations: &[Observation], shape: Parameterisation, gravity: f64, start: Calibration) -> Option<Estimate> {
    let bounds = Bounds::default();
    let given = Assumptions {
        shape,
        estimator: Estimator::Magnitude,
        gravity: Gravity::configured(gravity),
        placement_std: 0.01,
        cross_axis_std: 0.01,
        nonlinearity: 0.0,
        bounds: &bounds,
        loss: Loss::Square,
        start,
    };
    accelerometer::fit(observations, &given).ok()
}

/// Errors over published standard deviations, of sensors drawn from what the model assumes but for the placement scatter.
fn deviations(seeds: u64, visits: usize, scatter: f64) -> Vec<f64> {
    const NOISE: f64 = 0.0017;
    let mut all = Vec::new();
    for seed in 0..seeds {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = |std: f64| std * random.sample::<f64, _>(StandardNormal);
        let truth = Calibration {
            bias: Vector3::from_fn(|_, _| normal(0.3)),
            sensitivity: Matrix3::from_fn(|r, c| if r == c { 1.0 + normal(0.02) } else { normal(0.01) }),
        };
        let observations: Vec<_> = (0..6 * visits)
            .map(|k| {
                let normal_of_face = Vector3::ith(k % 3, if k % 6 > 2 { -1.0 } else { 1.0 });
                let tilt = Rotation3::from_scaled_axis(Vector3::from_fn(|_, _| normal(0.02)));
                let placed = Vector3::from_fn(|_, _| normal(scatter) + normal(NOISE));
                let mean = truth.measure(&(tilt * normal_of_face * G)) + placed;
                Observation { placement: k as u32, mean, noise: Vector3::repeat(NOISE * NOISE), normal: normal_of_face }
            })
            .collect();
        let fit = fit(&observations, Parameterisation::DIAGONAL, G, Calibration::default()).unwrap();
        let error = fit.shape.vector(&fit.calibration()) - fit.shape.vector(&truth);
        all.extend((0..6).map(|i| error[i] / fit.std(i)));
    }
    all
}

#[test]
fn intervals_of_simulated_sensors_hold_the_truth_as_often_as_they_say() {
    for (visits, scatter) in [(1, 0.01), (2, 0.03), (3, 0.0033), (4, 0.03)] {
        let all = deviations(250, visits, scatter);
        let inside = 100.0 * all.iter().filter(|z| z.abs() <= 1.96).count() as f64 / all.len() as f64;
        println!("{visits} visits, scatter {scatter}: {inside:.1} % of {}", all.len());
        // Few degrees of freedom about another scatter than the assumed one cost width.
        let most = if scatter == 0.01 { 97.5 } else { 99.1 };
        assert!((92.5..most).contains(&inside), "{visits} visits, scatter {scatter}: {inside:.1} %");
    }
}

/// The accepted rests of a recording, those of one placement as one observation.
fn placements(name: &str, settings: &[&str]) -> Option<Vec<Observation>> {
    let input = recording(name)?;
    let layers: Vec<_> = settings.iter().map(|setting| Layer::set(setting).unwrap()).collect();
    let config = Config::load(&layers).unwrap();
    let opened = Input::open(&input).unwrap();
    let report = run::calibrate(&opened, &config, &|_| Ok(())).unwrap();
    /// Sums over the samples of a placement, and its face.
    #[derive(Default)]
    struct Pool {
        count: f64,
        mean: Vector3<f64>,
        variance: Vector3<f64>,
        normal: Vector3<f64>,
    }
    let mut placements: BTreeMap<u32, Pool> = BTreeMap::new();
    for rest in report.imus[0].rests.values().filter(|rest| rest.accepted) {
        let seen = rest.means.iter().find(|mean| mean.sensor == "accelerometer").unwrap();
        let mean = seen.mean.as_ref().map(|v| Vector3::new(v.x, v.y, v.z)).unwrap();
        let variance = Matrix3::from_row_slice(&seen.covariance).diagonal();
        let of_face = |axis: usize| match rest.face.as_bytes() {
            [sign, name] if usize::from(name - b'X') == axis => {
                if *sign == b'+' {
                    1.0
                } else {
                    -1.0
                }
            }
            _ => 0.0,
        };
        let pool = placements.entry(rest.placement).or_default();
        pool.count += seen.effective_samples;
        pool.mean += mean * seen.effective_samples;
        pool.variance += variance * seen.effective_samples;
        pool.normal = Vector3::from_fn(|axis, _| of_face(axis));
    }
    let observation = |(placement, Pool { count, mean, variance, normal })| Observation {
        placement,
        mean: mean / count,
        noise: variance / (count * count),
        normal,
    };
    Some(placements.into_iter().map(observation).collect())
}

/// How many of the placements read a length of gravity that the fit of all others expects, and of how many: without the
/// only one on a face the others determine nothing.
fn expected_by_the_others(seen: &[Observation], shape: Parameterisation, gravity: f64) -> (usize, usize) {
    let start = fit(seen, shape, gravity, stillpoint::fit::guess(seen.iter().map(|seen| &seen.mean), gravity)).unwrap();
    let verdicts = (0..seen.len()).filter_map(|held| {
        let others: Vec<_> = seen.iter().enumerate().filter(|(i, _)| *i != held).map(|(_, seen)| *seen).collect();
        let fit = fit(&others, shape, gravity, start.calibration())?;
        let held = &seen[held];
        let calibration = fit.calibration();
        let corrected = calibration.correct(&held.mean);
        let by_measured = calibration.inverse().transpose() * corrected.normalize();
        let truth = Truth::of(corrected);
        let by_parameters = fit.shape.jacobian(&truth).tr_mul(&by_measured);
        let unmodelled: f64 =
            fit.shape.unmodelled().map(|term| (by_measured[term.axis()] * term.regressor(&truth)).powi(2)).sum();
        let [_, between, _] = fit.origin.as_ref().unwrap().between;
        let variance = by_parameters.dot(&(&fit.covariance * &by_parameters))
            + unmodelled * fit.unmodelled_std.powi(2)
            + by_measured.component_mul(&by_measured).dot(&held.noise.add_scalar(between));
        let off = corrected.norm() - gravity;
        let holds = off.abs() <= 1.96 * variance.sqrt();
        println!("{:?} {off:+.4} ± {:.4} {holds}", held.placement, 1.96 * variance.sqrt());
        Some(holds)
    });
    let verdicts: Vec<_> = verdicts.collect();
    (verdicts.iter().filter(|holds| **holds).count(), verdicts.len())
}

#[test]
fn rests_of_real_recordings_that_a_fit_has_not_seen_read_what_it_expects() {
    let recordings = [
        ("xsens_38_poses.ros2.mcap", Parameterisation::TRIANGULAR, 9.81744, "fit.model=triangular"),
        ("mpu9150_0_19_poses.ros2.mcap", Parameterisation::TRIANGULAR, G, "fit.model=triangular"),
        ("nilspod_six_face.ros2.mcap", Parameterisation::DIAGONAL, G, "fit.model=bias-scale"),
    ];
    let (mut inside, mut all) = (0, 0);
    for (name, shape, gravity, model) in recordings {
        let Some(seen) = placements(name, &[model, &format!("fit.gravity={gravity}")]) else { return };
        let (held, of) = expected_by_the_others(&seen, shape, gravity);
        println!("{name}: {held} of {of}");
        inside += held;
        all += of;
    }
    let share = 100.0 * inside as f64 / all as f64;
    assert!((90.0..=99.0).contains(&share), "{inside} of {all}: {share:.1} %");
}
