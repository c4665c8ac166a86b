//! Rests of many recordings as one calibration: order and grouping change nothing, and a fleet of simulated sensors, none of
//! whose recordings suffices, is calibrated with honest intervals and its shocks are found.

use nalgebra::Vector3;
use proptest::prelude::*;
use rand::seq::{IndexedRandom as _, SliceRandom as _};
use rand::{Rng, SeedableRng as _};
use rand_distr::{Distribution as _, StandardNormal};
use stillpoint::Stamp;
use stillpoint::config::Config;
use stillpoint::merge::{ChangeKind, MOST_RESTS, Merge, Merged, outcome};
use stillpoint::messages::{self, Segment, TriadMean, segment::Reason};
use stillpoint::report::Findings;

use crate::common::needs::randomness;

const GRAVITY: f64 = 9.80665;
const DAY: i64 = 86_400_000_000_000;
/// Scatter from placement to placement, m/s² and rad/s.
const SCATTER: f64 = 0.01;
const RATE_SCATTER: f64 = 2e-4;

/// What a sensor is like at one time.
#[derive(Clone, Copy, Debug)]
struct Truth {
    bias: Vector3<f64>,
    scale: Vector3<f64>,
    gyro: Vector3<f64>,
}

fn normal(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(rng))
}

fn config() -> Config {
    let mut config = Config::default();
    config.fit.gravity = Some(GRAVITY);
    config
}

impl Truth {
    fn new(rng: &mut impl Rng) -> Self {
        Self { bias: normal(rng) * 0.15, scale: Vector3::repeat(1.0) + normal(rng) * 0.01, gyro: normal(rng) * 0.005 }
    }

    /// A rest on a face (axis and sign) that begins so many seconds after `recording`.
    fn rest(&self, rng: &mut impl Rng, recording: i64, number: u32, (axis, sign): (usize, f64)) -> Segment {
        let mut up = normal(rng) * 0.03;
        up[axis] = sign;
        let force = up.normalize() * GRAVITY + normal(rng) * SCATTER;
        let accel = self.bias + self.scale.component_mul(&force) + normal(rng) * 0.001;
        let gyro = self.gyro + normal(rng) * RATE_SCATTER;
        let mean = |sensor: &str, mean: Vector3<f64>, std: f64| TriadMean {
            sensor: sensor.to_owned(),
            samples: 400,
            effective_samples: 400.0,
            mean: Some(messages::Vector3 { x: mean.x, y: mean.y, z: mean.z }),
            covariance: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].map(|one| one * std * std).to_vec(),
            std: None,
        };
        let start = Stamp::from_nanos(recording + i64::from(number) * 10_000_000_000);
        Segment {
            start: Some(start.into()),
            end: Some(start.plus_nanos(4_000_000_000).into()),
            accepted: true,
            reason: Reason::Accepted.into(),
            means: vec![mean("accelerometer", accel, 0.02), mean("gyroscope", gyro, 0.001)],
            placement: number,
            ..Segment::default()
        }
    }

    /// A recording of so many different faces.
    fn recording(&self, rng: &mut impl Rng, at: i64, faces: usize) -> Findings {
        let mut all: Vec<_> = (0..6).map(|k| (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 })).collect();
        all.shuffle(rng);
        let mut findings = Findings::new("/imu", "/imu");
        for (i, face) in all.into_iter().take(faces).enumerate() {
            let rest = self.rest(rng, at, i as u32 + 1, face);
            let start = rest.start.unwrap();
            findings.rests.insert(start.seconds * 1_000_000_000 + i64::from(start.nanos), rest);
        }
        findings
    }

    /// As it is after a day of drift; over forty days its bias walks by about twice the scatter of a placement.
    fn drift(&mut self, rng: &mut impl Rng) {
        let step = 2.0 * SCATTER / 40_f64.sqrt();
        self.bias += normal(rng) * step;
        self.scale += normal(rng) * (0.3 * step / GRAVITY);
        self.gyro += normal(rng) * (RATE_SCATTER / 40_f64.sqrt());
    }
}

fn joined<'a>(all: impl IntoIterator<Item = &'a Findings>) -> Merge {
    all.into_iter().fold(Merge::default(), |mut sum, findings| {
        sum.join(Merge::of("/imu", findings));
        sum
    })
}

fn only(merge: &Merge) -> Merged {
    let mut merged = outcome(merge, &config());
    assert_eq!(merged.len(), 1);
    merged.pop().unwrap()
}

/// Every number that is published.
fn numbers(merged: &Merged) -> Vec<f64> {
    let triads = merged.findings.calibration.iter().flat_map(|c| c.accelerometer.iter().chain(&c.gyroscope));
    let xyz = |v: &Option<messages::Vector3>| v.iter().flat_map(|v| [v.x, v.y, v.z]).collect::<Vec<_>>();
    let of_triad = triads.flat_map(|triad| {
        [xyz(&triad.bias), xyz(&triad.bias_std), triad.sensitivity.clone(), triad.sensitivity_std.clone()].concat()
    });
    let curve = merged.history.curve.iter().flat_map(|point| [point.bias, point.scale].concat().concat());
    of_triad.chain(curve).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn order_and_grouping_change_nothing(seed: u64, cuts in prop::collection::vec(0_usize..12, 0..4)) {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut truth = Truth::new(&mut rng);
        let mut all = Vec::new();
        for day in 0..12 {
            let faces = rng.random_range(1..=3);
            all.push(truth.recording(&mut rng, day * DAY, faces));
            truth.drift(&mut rng);
        }
        let whole = joined(&all);
        let mut shuffled = all.clone();
        shuffled.shuffle(&mut rng);
        // Groups between the cuts, joined from the last to the first, and the first of them once more.
        let mut cuts = cuts;
        cuts.extend([0, 12]);
        cuts.sort_unstable();
        let groups: Vec<_> = cuts.windows(2).map(|cut| joined(&shuffled[cut[0]..cut[1]])).collect();
        let mut sum = Merge::default();
        groups.iter().rev().chain(groups.first()).for_each(|group| sum.join(group.clone()));
        prop_assert_eq!(&sum, &whole);
        let (one, other) = (numbers(&only(&whole)), numbers(&only(&sum)));
        prop_assert!(one.len() > 12 * 12 && one.len() == other.len());
        for (a, b) in one.iter().zip(&other) {
            prop_assert!((a - b).abs() <= 1e-9 * a.abs().max(1.0), "{} {}", a, b);
        }
    }
}

#[test]
fn years_of_rests_are_kept_in_bounded_memory_and_which_are_depends_on_no_order() {
    let mut rng = randomness();
    let truth = Truth::new(&mut rng);
    let mut all: Vec<_> = (0..2500).map(|day| truth.recording(&mut rng, day * DAY, 2)).collect();
    let forwards = joined(&all);
    all.shuffle(&mut rng);
    let (left, right) = all.split_at(900);
    let mut halves = joined(right);
    halves.join(joined(left));
    assert_eq!(forwards, halves);
    let rests = forwards.sensors["/imu"].rests();
    assert!(rests.len() <= MOST_RESTS && rests.len() > MOST_RESTS / 4 && rests.is_thinned(), "{}", rests.len());
}

#[test]
fn what_is_no_reading_is_left_out() {
    let mut rng = randomness();
    let truth = Truth::new(&mut rng);
    let sound = truth.recording(&mut rng, 0, 3);
    let mut broken = truth.recording(&mut rng, DAY, 3);
    let break_it: [fn(&mut Segment); 3] = [
        |rest| rest.means[0].mean = Some(messages::Vector3 { x: f64::NAN, y: 0.0, z: 9.8 }),
        |rest| rest.means[0].covariance = vec![f64::INFINITY; 9],
        |rest| rest.end = Some(prost_types::Timestamp { seconds: i64::MAX, nanos: 0 }),
    ];
    broken.rests.values_mut().zip(break_it).for_each(|(rest, break_it)| break_it(rest));
    assert_eq!(joined([&sound, &broken]).sensors["/imu"].rests().len(), 3);
    let nothing = only(&joined([&Findings::new("/imu", "/imu")]));
    assert_eq!((nothing.history.rests, nothing.findings.calibration), (0, None));
}

#[test]
fn another_sensor_under_an_old_name_is_told() {
    let mut rng = randomness();
    let mut all = Vec::new();
    for sensor in 0..2 {
        let mut truth = Truth::new(&mut rng);
        truth.scale = Vector3::repeat(if sensor == 0 { 0.99 } else { 1.01 });
        all.extend((0..15).map(|day| truth.recording(&mut rng, (sensor * 15 + day) * DAY, 3)));
    }
    let merged = only(&joined(&all));
    let [change] = merged.history.changes.as_slice() else { panic!("{:#?}", merged.history.changes) };
    assert_eq!(change.kind, ChangeKind::Replaced);
    let found = change.before.nanos() / DAY;
    assert!((14..=16).contains(&found), "{found}");
    let scale = merged.findings.calibration.unwrap().accelerometer.unwrap().scale.unwrap();
    assert!((scale.x - 1.01).abs() < 0.005, "the numbers are those of the sensor that is there now: {scale:?}");
}

/// What became of a fleet.
#[derive(Default, Debug)]
struct Tally {
    calibrated: usize,
    /// Errors over their standard deviations.
    scores: Vec<f64>,
    shocks: usize,
    found: usize,
    false_alarms: usize,
}

fn fleet(sensors: usize, recordings: i64) -> Tally {
    let mut rng = randomness();
    let mut tally = Tally::default();
    for sensor in 0..sensors {
        let mut truth = Truth::new(&mut rng);
        let shock = (sensor % 2 == 0).then(|| rng.random_range(8..recordings - 15));
        let mut merge = Merge::default();
        for day in 0..recordings {
            if shock == Some(day) {
                // Three to ten standard deviations of what a placement says.
                let mut by = |scatter: f64| {
                    let size = rng.random_range(3.0..10.0) * scatter;
                    Vector3::from_fn(|_, _| *[-size, size].choose(&mut rng).unwrap())
                };
                truth.bias += by(SCATTER);
                truth.gyro += by(RATE_SCATTER);
            }
            let faces = rng.random_range(1..=3);
            merge.join(Merge::of("/imu", &truth.recording(&mut rng, day * DAY, faces)));
            if day + 1 < recordings {
                truth.drift(&mut rng);
            }
        }
        let merged = only(&merge);
        let at = |change: &stillpoint::merge::Change| change.before.nanos() / DAY;
        let near = |change: &&stillpoint::merge::Change| shock.is_some_and(|day| (at(change) - day).abs() <= 1);
        tally.shocks += usize::from(shock.is_some());
        tally.found += usize::from(merged.history.changes.iter().any(|change| near(&change)));
        tally.false_alarms += merged.history.changes.iter().filter(|change| !near(change)).count();
        let Some(calibration) = merged.findings.calibration else { continue };
        let triad = calibration.accelerometer.unwrap();
        let (Some(bias), Some(scale)) = (triad.bias, triad.scale) else { continue };
        let (bias_std, scale_std) = (triad.bias_std.unwrap(), triad.scale_std.unwrap());
        tally.calibrated += 1;
        let list = |v: &messages::Vector3| [v.x, v.y, v.z];
        for axis in 0..3 {
            tally.scores.push((list(&bias)[axis] - truth.bias[axis]) / list(&bias_std)[axis]);
            tally.scores.push((list(&scale)[axis] - truth.scale[axis]) / list(&scale_std)[axis]);
        }
    }
    tally
}

#[test]
fn a_fleet_whose_recordings_show_one_to_three_faces_is_calibrated() {
    let sensors = std::env::var("STILLPOINT_FLEET").map_or(12, |sensors| sensors.parse().unwrap());
    let tally = fleet(sensors, 40);
    let rms = (tally.scores.iter().map(|score| score * score).sum::<f64>() / tally.scores.len() as f64).sqrt();
    let covered = tally.scores.iter().filter(|score| score.abs() <= 1.96).count() as f64 / tally.scores.len() as f64;
    eprintln!(
        "{sensors} sensors × 40 recordings: {} calibrated, rms of error ÷ std {rms:.3}, coverage {:.1} %, {} of {} shocks found \
         within ±1 recording, {} false alarms",
        tally.calibrated,
        100.0 * covered,
        tally.found,
        tally.shocks,
        tally.false_alarms
    );
    // A dozen sensors by chance: the numbers of 50 are in the CHANGELOG.
    assert!(tally.calibrated * 10 >= sensors * 8, "{tally:?}");
    assert!(rms < 1.5 && covered > 0.85, "{rms} {covered}");
    assert!(tally.found * 10 >= tally.shocks * 8 && tally.false_alarms <= 1 + sensors / 12, "{tally:?}");
}
