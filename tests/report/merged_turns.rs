//! Turns of many recordings: together they determine the gyroscope, and the accelerometer's axes, as in one recording;
//! order, grouping and repetition change nothing.

use std::sync::OnceLock;

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use stillpoint::engine::{self, Engine};
use stillpoint::fit::RotationConfig;
use stillpoint::imu::{HeadingConfig, Sample};
use stillpoint::merge::{Member as _, Merge, PastTurn};
use stillpoint::messages::Triad;
use stillpoint::messages::triad::Model;
use stillpoint::report::Findings;

use crate::common::needs::randomness;
use crate::fleet::{DAY, joined, only};
use crate::hand::{self, Hand, Held};

/// Sensor with cross-axis sensitivities everywhere.
fn held() -> Held {
    Held {
        gyro_sensitivity: Matrix3::new(1.012, 0.004, -0.003, -0.006, 0.991, 0.002, 0.005, -0.004, 1.007),
        accel_sensitivity: Matrix3::new(1.004, 0.0, 0.0, 0.006, 0.997, 0.0, -0.004, 0.005, 1.002),
        accel_bias: Vector3::new(0.2, -0.1, 0.15),
        placement: 0.003,
        ..Held::default()
    }
}

/// What an engine finds in a session so many days on.
fn found(hand: &Hand, day: i64) -> Findings {
    found_with(hand, day, Vec::new())
}

fn found_with(hand: &Hand, day: i64, rotations: Vec<RotationConfig>) -> Findings {
    found_beside(hand, day, rotations, None)
}

/// The same beside headings, as they are at rest but for an error of this standard deviation, rad.
fn found_beside(hand: &Hand, day: i64, rotations: Vec<RotationConfig>, heading_std: Option<f64>) -> Findings {
    let mut config = engine::Config { accelerometer: "/imu".to_owned(), ..engine::Config::default() };
    config.gyroscope = "/imu".to_owned();
    config.fit.gravity = Some(hand::G);
    config.fit.rotations = rotations;
    config.fit.heading = heading_std.map(|std| HeadingConfig {
        topic: "/odom".to_owned(),
        std_deg: std.to_degrees(),
        ..HeadingConfig::default()
    });
    let mut random = Hand::new(Held::default(), day as u64);
    let off: Vec<f64> = (0..100).map(|_| random.normal().x * heading_std.unwrap_or(0.0)).collect();
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    for (i, (sensor, sample)) in hand.samples.iter().enumerate() {
        let stamp = sample.stamp.plus_nanos(day * DAY);
        let (_, heading, rest) = hand.headings[i / 2];
        engine.heading(stamp, heading + off[rest]);
        engine.push(*sensor, &Sample { stamp, log_time: stamp.nanos() as u64, value: sample.value }, &mut events);
    }
    engine.finish(&mut events);
    let mut findings = Findings::new("/imu", "/imu");
    events.iter().for_each(|event| findings.note(event));
    findings
}

/// Sessions of a few turns each, a day apart; the gyroscope's bias is another every day.
fn days(seed: u64, count: i64, turns: usize, walk: f64) -> Vec<Findings> {
    walking(seed, count, turns, [0.0, walk]).1
}

/// The same of a sensor whose biases walk, of both triads, and its accelerometer's bias on the last day.
fn walking(seed: u64, count: i64, turns: usize, [accel_walk, gyro_walk]: [f64; 2]) -> (Vector3<f64>, Vec<Findings>) {
    let mut held = held();
    let mut last = held.accel_bias;
    let session = |day: i64| {
        last = held.accel_bias;
        let hand = Hand::new(held.clone(), seed.wrapping_add(day as u64)).rest(3.0).through_faces(turns);
        let mut random = Hand::new(Held::default(), seed.wrapping_sub(day as u64));
        held.gyro_bias += random.normal() * gyro_walk;
        held.accel_bias += random.normal() * accel_walk;
        found(&hand, day)
    };
    let all = (0..count).map(session).collect();
    (last, all)
}

#[test]
fn turns_do_not_make_the_bias_of_a_walking_accelerometer_surer_than_it_is() {
    const SENSORS: u64 = 12;
    let seed = randomness().random_range(0..1 << 40);
    let mut scores = Vec::new();
    for sensor in 0..SENSORS {
        let (truth, all) = walking(seed + 1000 * sensor, 16, 3, [0.006, 2e-4]);
        let merged = only(&joined(&all));
        assert!(merged.history.turns >= 30, "{}", merged.history.turns);
        let calibration = merged.findings.calibration.unwrap();
        let accelerometer = calibration.accelerometer.unwrap();
        let (Some(bias), Some(std)) = (accelerometer.bias, accelerometer.bias_std) else { continue };
        scores.extend([(bias.x - truth.x) / std.x, (bias.y - truth.y) / std.y, (bias.z - truth.z) / std.z]);
    }
    let inside = scores.iter().filter(|score| score.abs() <= 1.96).count();
    let worst = scores.iter().fold(0.0_f64, |most, score| most.max(score.abs()));
    assert!(scores.len() >= 24 && inside * 100 >= scores.len() * 80 && worst < 5.0, "seed {seed}: {scores:?}");
}

fn triads(findings: &Findings) -> [&Triad; 2] {
    let calibration = findings.calibration.as_ref().unwrap();
    [calibration.accelerometer.as_ref().unwrap(), calibration.gyroscope.as_ref().unwrap()]
}

/// Errors of a sensitivity over their standard deviations.
fn scores(triad: &Triad, truth: &Matrix3<f64>) -> Vec<f64> {
    let truth = truth.transpose();
    let all = triad.sensitivity.iter().zip(&triad.sensitivity_std).zip(truth.iter());
    all.filter(|((_, std), _)| **std > 0.0).map(|((value, std), truth)| (value - truth) / std).collect()
}

#[test]
fn one_recording_alone_is_merged_to_what_its_engine_found() {
    let hand = Hand::new(held(), 3).rest(3.0).through_faces(24);
    let alone = found(&hand, 0);
    let merged = only(&joined([&alone]));
    assert!(merged.history.turns >= 20, "{}", merged.history.turns);
    // An engine keeps to the model that it published first, which near the limit decides whether rests or turns tell the
    // accelerometer's axes; otherwise both agree to the last bit.
    for ((one, other), wider) in triads(&alone).into_iter().zip(triads(&merged.findings)).zip([2.5, 1.1]) {
        assert_eq!((one.model(), one.turns, one.status()), (other.model(), other.turns, other.status()));
        assert!(!one.sensitivity.is_empty());
        let numbers = |triad: &Triad| {
            let bias = triad.bias.as_ref().map(|v| [v.x, v.y, v.z]).unwrap();
            let std = triad.bias_std.as_ref().map(|v| [v.x, v.y, v.z]).unwrap();
            let of_sensitivity = triad.sensitivity.iter().zip(&triad.sensitivity_std).map(|(a, b)| (*a, *b));
            bias.into_iter().zip(std).chain(of_sensitivity).collect::<Vec<_>>()
        };
        for ((a, std), (b, other)) in numbers(one).into_iter().zip(numbers(other)) {
            // Of two estimates, one of which knows more, the difference has the difference of their variances (Hausman 1978).
            let off = 0.3 * std.min(other) + 2.0 * (std * std - other * other).abs().sqrt();
            assert!((a - b).abs() <= off && (std / wider..=std * wider).contains(&other), "{a} ± {std}, {b} ± {other}");
        }
    }
    assert_eq!(triads(&alone)[1].model(), Model::Turns);
}

#[test]
fn recordings_of_a_few_turns_each_determine_the_gyroscope_and_the_axes_together() {
    for walk in [0.0, 2e-4] {
        let all = days(5, 8, 5, walk);
        assert!(all.iter().all(|findings| triads(findings)[1].model() == Model::Bias));
        let merged = only(&joined(&all));
        assert_eq!((merged.history.turns, merged.history.recordings), (40, 8));
        let [accelerometer, gyroscope] = triads(&merged.findings);
        assert_eq!((accelerometer.model(), gyroscope.model()), (Model::Triangular, Model::Turns), "{gyroscope:?}");
        let held = held();
        for (triad, truth) in [(accelerometer, held.accel_sensitivity), (gyroscope, held.gyro_sensitivity)] {
            let scores = scores(triad, &truth);
            let half = triad.sensitivity_std.iter().copied().fold(0.0, f64::max);
            assert!(scores.iter().all(|score| score.abs() < 4.5) && half < 2.5e-3, "{scores:?} ± {half}");
        }
    }
}

#[test]
fn what_is_no_turn_is_left_out() {
    let mut all = days(7, 1, 5, 0.0);
    let turns = |findings: &Findings| joined([findings]).sensors["/imu"].turns().len();
    let sound = turns(&all[0]);
    let spoil: [fn(&mut stillpoint::messages::Turn); 5] = [
        |turn| turn.integrals[3] = f64::NAN,
        |turn| turn.integrals.truncate(9),
        |turn| turn.integrals = vec![0.0; 100_000],
        |turn| turn.seconds = -1.0,
        |turn| turn.end = turn.start,
    ];
    let count = spoil.len();
    all[0].turns.values_mut().zip(spoil).for_each(|(turn, spoil)| spoil(turn));
    assert_eq!((sound, turns(&all[0])), (count, 0));
}

#[test]
fn turns_of_years_are_kept_in_bounded_memory_and_which_are_depends_on_no_order() {
    let mut rng = randomness();
    let base = days(rng.random(), 1, 6, 0.0).pop().unwrap();
    let moved = |day: i64| {
        let later = |time: &mut Option<prost_types::Timestamp>| {
            time.iter_mut().for_each(|time| time.seconds += day * 86_400);
        };
        let mut findings = base.clone();
        findings.rests.values_mut().for_each(|rest| [&mut rest.start, &mut rest.end].into_iter().for_each(later));
        findings.turns.values_mut().for_each(|turn| [&mut turn.start, &mut turn.end].into_iter().for_each(later));
        let key = |(start, one)| (start + day * DAY, one);
        findings.rests = findings.rests.into_iter().map(key).collect();
        findings
    };
    let mut all: Vec<_> = (0..300).map(moved).collect();
    let forwards = joined(&all);
    all.shuffle(&mut rng);
    let (left, right) = all.split_at(100);
    let mut halves = joined(right);
    halves.join(joined(left));
    assert_eq!(forwards, halves);
    let turns = forwards.sensors["/imu"].turns();
    assert!((PastTurn::MOST / 4..=PastTurn::MOST).contains(&turns.len()) && turns.is_thinned(), "{}", turns.len());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    #[test]
    fn order_and_grouping_of_turns_change_nothing(seed: u64, cuts in prop::collection::vec(0_usize..6, 0..3)) {
        static DAYS: OnceLock<Vec<Findings>> = OnceLock::new();
        let all = DAYS.get_or_init(|| days(11, 6, 5, 1e-4));
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let whole = joined(all);
        let mut shuffled = all.clone();
        shuffled.shuffle(&mut rng);
        let mut cuts = cuts;
        cuts.extend([0, 6]);
        cuts.sort_unstable();
        let groups: Vec<_> = cuts.windows(2).map(|cut| joined(&shuffled[cut[0]..cut[1]])).collect();
        let mut sum = Merge::default();
        groups.iter().rev().chain(groups.first()).for_each(|group| sum.join(group.clone()));
        prop_assert_eq!(&sum, &whole);
        let (one, other) = (only(&whole), only(&sum));
        prop_assert_eq!(triads(&one.findings)[1].model(), Model::Turns);
        for (one, other) in triads(&one.findings).into_iter().zip(triads(&other.findings)) {
            let numbers = |triad: &Triad| [triad.sensitivity.clone(), triad.sensitivity_std.clone()].concat();
            for (a, b) in numbers(one).into_iter().zip(numbers(other)) {
                prop_assert!((a - b).abs() <= 1e-9 * a.abs().max(1.0), "{} {}", a, b);
            }
        }
    }
}

#[test]
fn rotations_that_recordings_declare_are_used_in_their_merge() {
    let session = |day: i64, declared: bool| {
        let mut hand = Hand::new(held(), 20 + day as u64).rest(3.0).through_faces(8);
        let mut rotations = Vec::new();
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            hand = hand.turn_up(axis, 1.5).rest(3.0);
            let (begin_s, up) = (hand.seconds() - 1.0, hand.up());
            hand = hand.turn(up * (2.0 * std::f64::consts::TAU), 8.0).rest(3.0);
            let end_s = hand.seconds() - 1.0;
            rotations.push(RotationConfig { imu: None, begin_s, end_s, angle_deg: 720.0 });
        }
        rotations.retain(|_| declared);
        found_with(&hand, day, rotations)
    };
    let merged = |declared| {
        let all: Vec<_> = (0..4).map(|day| session(day, declared)).collect();
        let merge = joined(&all);
        let known = merge.sensors["/imu"].turns().iter().filter(|turn| turn.motion.declared.is_some()).count();
        let gyroscope = triads(&only(&merge).findings)[1].clone();
        assert_eq!(gyroscope.model(), Model::Turns, "{:?}", gyroscope.notes);
        let scores = scores(&gyroscope, &held().gyro_sensitivity);
        assert!(scores.iter().all(|score| score.abs() < 4.5), "{scores:?}");
        (known, gyroscope)
    };
    let ((known, with), (unknown, without)) = (merged(true), merged(false));
    assert_eq!((known, unknown), (12, 0));
    assert_ne!(with.sensitivity, without.sensitivity);
    assert!([0, 4, 8].iter().all(|&k| with.sensitivity_std[k] <= 1.05 * without.sensitivity_std[k]), "{with:?}");
}

#[test]
fn headings_of_many_drives_add_up_to_a_sharper_scale_about_the_vertical() {
    let drive = |day: i64| {
        let mut hand = Hand::new(Held { wobble: 0.02, ..held() }, 40 + day as u64).rest(4.0);
        for angle in [1.6, -2.0, 2.4, -1.4, 3.0, -2.6] {
            let up = hand.up();
            hand = hand.turn(up * angle, 4.0).rest(3.0);
        }
        found_beside(&hand, day, Vec::new(), Some(0.005))
    };
    let days: Vec<_> = (0..6).map(drive).collect();
    let merge = joined(&days);
    let stds = merge.sensors["/imu"].turns().iter().filter_map(|turn| turn.motion.declared_std);
    assert_eq!(stds.filter(|std| (std - 0.005 * 2_f64.sqrt()).abs() < 1e-12).count(), 36);
    let known = |findings: &Findings| match triads(findings)[1].combinations.as_slice() {
        [known] => known.clone(),
        other => panic!("{other:?}"),
    };
    let merged = known(&only(&merge).findings);
    assert!((merged.value - held().gyro_sensitivity[(2, 2)]).abs() < 3.5 * merged.std, "{merged:?}");
    for day in &days {
        assert!(merged.std < 0.6 * known(day).std, "{merged:?} {:?}", known(day));
    }
}
