//! Turns between rests: what is integrated, what is remembered, and what it says of a sensor.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::hand::{self, Hand, Held};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use stillpoint::Stamp;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit;
use stillpoint::imu::Sensor;
use stillpoint::messages::Triad;
use stillpoint::messages::triad::Model;
use stillpoint::still::{self, Outcome, Rest, Segmenter};
use stillpoint::turns::{Candidate, Ends, History, Limit, Piece, Preintegrator, predict, vertical};

/// A rate that wanders smoothly, rad/s.
#[derive(Clone, Debug)]
struct Course {
    waves: Vec<([f64; 3], f64, f64)>,
}

impl Course {
    fn rate(&self, t: f64) -> Vector3<f64> {
        let fade = (PI * t / 2.0).sin().powi(2);
        self.waves
            .iter()
            .map(|(size, rate, phase)| Vector3::from(*size) * (rate * t + phase).sin())
            .sum::<Vector3<f64>>()
            * fade
    }
}

fn course() -> impl Strategy<Value = Course> {
    let wave = (prop::array::uniform3(-1.5..1.5), 0.5..4.0, 0.0..6.0);
    prop::collection::vec(wave, 1..4).prop_map(|waves| Course { waves })
}

/// Two seconds of readings at so many Hz, preintegrated.
fn pieces(course: &Course, hz: f64, sensitivity: &Matrix3<f64>, bias: &Vector3<f64>, limit: Limit) -> Vec<Piece> {
    let mut integrator = Preintegrator::default();
    let samples = (0..=(2.0 * hz) as i64 + 1).map(|i| (i as f64 / hz, i));
    let stretches = samples.filter_map(|(t, _)| {
        let reading = sensitivity * course.rate(t.min(2.0)) + bias;
        integrator.push(Stamp::from_nanos((t * 1e9).round() as i64), &reading, &limit)
    });
    stretches.map(|stretch| stretch.piece()).collect()
}

/// Direction after, by brute force.
fn brute(course: &Course, up: Vector3<f64>, until: f64) -> Vector3<f64> {
    const STEPS: usize = 20_000;
    let step = until / STEPS as f64;
    (0..STEPS).fold(up, |up, i| {
        let rate = course.rate((i as f64 + 0.5) * step);
        nalgebra::Rotation3::from_scaled_axis(rate * step).inverse() * up
    })
}

fn small_matrix() -> impl Strategy<Value = Matrix3<f64>> {
    prop::array::uniform9(-0.03..0.03).prop_map(|entries| Matrix3::identity() + Matrix3::from_row_slice(&entries))
}

fn small_vector() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-0.05..0.05).prop_map(Vector3::from)
}

fn unit() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-1.0..1.0_f64)
        .prop_map(Vector3::from)
        .prop_filter_map("a direction", |v| v.try_normalize(0.1))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever bias and sensitivity are tried afterwards: it comes to where an integration of the truth comes.
    #[test]
    fn pieces_come_to_where_the_truth_comes(
        course in course(), sensitivity in small_matrix(), bias in small_vector(), up in unit()
    ) {
        let pieces = pieces(&course, 200.0, &sensitivity, &bias, Limit::default());
        let until: f64 = pieces.iter().map(|piece| piece.seconds).sum();
        let ends = Ends { up: [up; 2], rate: [bias; 2], by_up: Matrix3::zeros() };
        let candidate = Candidate::of_inverse(sensitivity.try_inverse().unwrap());
        let found = predict(pieces.iter(), &candidate, &ends).up;
        let expected = brute(&course, up, until);
        prop_assert!((found - expected).norm() < 3e-4, "{}", (found - expected).norm());
    }

    /// Two pieces as one are the piece that would have been integrated.
    #[test]
    fn pieces_put_together_are_one(course in course(), bias in small_vector()) {
        let fine = pieces(&course, 100.0, &Matrix3::identity(), &bias, Limit { path: 0.03, seconds: 0.04 });
        let sum = fine.iter().copied().reduce(|one, next| one.then(&next)).unwrap();
        let long = pieces(&course, 100.0, &Matrix3::identity(), &bias, Limit { path: 1e9, seconds: sum.seconds - 1e-6 });
        prop_assert_eq!(long.len(), 1);
        prop_assert!((sum.angle - long[0].angle).norm() < 2e-6);
        prop_assert!((sum.coning - long[0].coning).norm() < 2e-6);
        prop_assert!((sum.moment - long[0].moment).norm() < 2e-6);
    }

    #[test]
    fn derivatives_are_those_of_differences(
        course in course(), matrix in small_matrix(), bias in small_vector(), up in unit(), row in 0..3_usize, column in 0..3_usize
    ) {
        let pieces = pieces(&course, 100.0, &Matrix3::identity(), &bias, Limit::default());
        let at = |matrix: Matrix3<f64>, up: Vector3<f64>, rate: Vector3<f64>| {
            let ends = Ends { up: [up; 2], rate: [rate; 2], by_up: Matrix3::zeros() };
            predict(pieces.iter(), &Candidate::of_inverse(matrix), &ends)
        };
        let here = at(matrix, up, bias);
        let step = 1e-5;
        let mut moved = matrix;
        moved[(row, column)] += step;
        let by_entry = (at(moved, up, bias).up - here.up) / step;
        prop_assert!((by_entry - here.by_inverse.column(3 * row + column)).norm() < 2e-3);
        let by_start = (at(matrix, up + Vector3::ith(row, step), bias).up - here.up) / step;
        prop_assert!((by_start - here.by_up.column(row)).norm() < 1e-6);
        let by_rate = (at(matrix, up, bias - Vector3::ith(row, step)).up - here.up) / step;
        prop_assert!((by_rate - here.by_rate.column(row)).norm() < 0.05);
    }
}

/// What a history makes of a recording, and its rests.
fn followed(hand: &Hand) -> (History, Vec<Rest>) {
    let mut segmenter = Segmenter::new(&still::Config::default(), 0);
    let (mut history, mut rests) = (History::default(), Vec::new());
    for (sensor, sample) in &hand.samples {
        let outcome = segmenter.push(*sensor, sample);
        if *sensor == Sensor::Gyroscope && outcome != Outcome::Dropped {
            history.push(sample);
        }
        if let Some((since, until)) = segmenter.open_rest() {
            history.at_rest(since, until);
        }
        while let Some(rest) = segmenter.next_rest() {
            history.rest(&rest);
            rests.push(rest);
        }
    }
    segmenter.finish();
    while let Some(rest) = segmenter.next_rest() {
        history.rest(&rest);
        rests.push(rest);
    }
    (history, rests)
}

fn passage(history: &History, from: &Rest, to: &Rest) -> Option<stillpoint::turns::Passage> {
    let rate = [from, to].map(|rest| rest.gyroscope.as_ref().unwrap().mean);
    let up = [from, to].map(|rest| rest.accelerometer.mean.normalize());
    history.passage([from.start, to.start], rate, up)
}

#[test]
fn a_bump_turns_nowhere_and_a_lift_does() {
    for seed in 0..5 {
        let hand = Hand::new(Held::default(), seed).rest(3.0).bump(0.6).rest(3.0).turn(Vector3::x() * FRAC_PI_2, 1.5);
        // Lifted, tilted and put back where it was.
        let hand = hand.rest(3.0).turn(Vector3::z() * 0.5, 0.8).turn(Vector3::z() * -0.5, 0.8).rest(3.0);
        let (history, rests) = followed(&hand);
        assert_eq!(rests.len(), 4);
        let bump = passage(&history, &rests[0], &rests[1]).unwrap();
        assert!(bump.turned.unwrap() < 0.01 && bump.furthest.unwrap() < 0.02, "{bump:?}");
        let turn = passage(&history, &rests[1], &rests[2]).unwrap();
        assert!((turn.furthest.unwrap() - FRAC_PI_2).abs() < 0.4 && turn.path > 1.5, "{turn:?}");
        let lift = passage(&history, &rests[2], &rests[3]).unwrap();
        assert!(lift.turned.unwrap() < 0.02 && lift.furthest.unwrap() > 0.3, "{lift:?}");
        // Across rests in between, whatever is thought of them.
        let all = passage(&history, &rests[0], &rests[3]).unwrap();
        assert!((all.turned.unwrap() - FRAC_PI_2).abs() < 0.05, "{all:?}");
    }
}

/// Where gravity is predicted to be after a turn, against where it was found, in rad.
fn miss(history: &History, rests: &[Rest], [from, to]: [usize; 2], unit: f64) -> f64 {
    let believed = |start: Stamp| start == rests[from].start || start == rests[to].start;
    let turns = history.turns(believed);
    let turn = turns.iter().find(|turn| turn.from == rests[from].start).unwrap();
    assert_eq!((turn.to, turn.unusable(None)), (rests[to].start, None));
    assert!(turn.resolves(unit));
    let [before, after] = [&rests[from], &rests[to]];
    let up = [before, after].map(|rest| rest.accelerometer.mean.normalize());
    let rate = [before, after].map(|rest| rest.gyroscope.as_ref().unwrap().mean);
    let candidate = Candidate::of_inverse(Matrix3::identity() * unit);
    let found = predict(turn.pieces().iter(), &candidate, &Ends { up, rate, by_up: Matrix3::zeros() }).up;
    found.cross(&up[1]).norm().atan2(found.dot(&up[1]))
}

#[test]
fn turns_tell_where_gravity_went_whatever_the_unit() {
    for (per_radian, hz) in [(1.0, 100.0), (180.0 / PI, 100.0), (1000.0, 200.0), (939.65, 50.0)] {
        let held = Held { gyro_sensitivity: Matrix3::identity() * per_radian, rate_hz: hz, ..Held::default() };
        let ceiling = still::Config::default().gyro_ceiling * per_radian.max(1.0);
        let hand = Hand::new(held, 3).rest(3.0).turn(Vector3::x() * FRAC_PI_2, 1.5).rest(3.0);
        let hand = hand.turn(Vector3::new(1.0, 1.0, 0.2), 2.0).rest(1.5).turn(Vector3::y() * PI, 2.5).rest(70.0);
        let mut segmenter = Segmenter::new(&still::Config { gyro_ceiling: ceiling, ..still::Config::default() }, 0);
        let (mut history, mut rests) = (History::default(), Vec::new());
        for (sensor, sample) in &hand.samples {
            segmenter.push(*sensor, sample);
            if *sensor == Sensor::Gyroscope {
                history.push(sample);
            }
            if let Some((since, until)) = segmenter.open_rest() {
                history.at_rest(since, until);
            }
            while let Some(rest) = segmenter.next_rest() {
                history.rest(&rest);
                rests.push(rest);
            }
        }
        assert!(rests.len() >= 4, "{per_radian}: {}", rests.len());
        assert!(miss(&history, &rests, [0, 1], 1.0 / per_radian) < 0.01);
        // Across a rest that is not believed.
        assert!(miss(&history, &rests, [1, 3], 1.0 / per_radian) < 0.02);
    }
}

#[test]
fn a_history_stays_small_and_goes_on_from_where_it_was_stored() {
    let mut hand = Hand::new(Held::default(), 5);
    let mut largest = 0;
    for i in 0..60 {
        let axis = Vector3::ith(i % 3, if i % 2 == 0 { FRAC_PI_2 } else { PI });
        hand = hand.rest(2.0).turn(axis, 1.5);
        if i % 20 == 19 {
            // A walk.
            hand = (0..40).fold(hand, |hand, _| hand.turn(Vector3::z() * 3.0, 1.0));
        }
    }
    let (whole, _) = followed(&hand);
    let mut segmenter = Segmenter::new(&still::Config::default(), 0);
    let mut history = History::default();
    for (i, (sensor, sample)) in hand.samples.iter().enumerate() {
        segmenter.push(*sensor, sample);
        if *sensor == Sensor::Gyroscope {
            history.push(sample);
        }
        if let Some((since, until)) = segmenter.open_rest() {
            history.at_rest(since, until);
        }
        while let Some(rest) = segmenter.next_rest() {
            history.rest(&rest);
        }
        if i % 501 == 0 {
            let stored = rmp_serde::to_vec(&history).unwrap();
            largest = largest.max(stored.len());
            history = rmp_serde::from_slice(&stored).unwrap();
        }
    }
    segmenter.finish();
    while let Some(rest) = segmenter.next_rest() {
        history.rest(&rest);
    }
    assert_eq!(rmp_serde::to_vec(&history).unwrap(), rmp_serde::to_vec(&whole).unwrap());
    assert!(largest <= 64 << 10, "{largest} bytes");
}

#[test]
fn what_disqualifies_a_turn_is_said() {
    use stillpoint::turns::Unusable;
    let base = |seed| Hand::new(Held::default(), seed).rest(3.0).turn(Vector3::x() * FRAC_PI_2, 1.5).rest(3.0);
    let reason = |hand: &Hand, range| {
        let (history, rests) = followed(hand);
        let turns = history.turns(|start| rests.iter().any(|rest| rest.start == start));
        turns.first().and_then(|turn| turn.unusable(range))
    };
    assert_eq!(reason(&base(1), None), None);
    assert_eq!(reason(&base(1), Some(1.0)), Some(Unusable::Clipped));

    let mut clipped = base(2);
    clipped.samples.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Gyroscope).for_each(|(_, sample)| {
        sample.value = sample.value.map(|x| x.clamp(-1.2, 1.2));
    });
    assert_eq!(reason(&clipped, None), Some(Unusable::Clipped));

    let mut lost = base(3);
    lost.samples.retain(|(sensor, sample)| {
        *sensor != Sensor::Gyroscope || !(4_600_000_000..4_750_000_000).contains(&sample.stamp.nanos())
    });
    assert_eq!(reason(&lost, None), Some(Unusable::Gap));

    let slow = Hand::new(Held::default(), 4).rest(3.0).turn(Vector3::x() * FRAC_PI_2, 25.0).rest(3.0);
    assert_eq!(reason(&slow, None), Some(Unusable::TooLong));
}

#[test]
fn a_rotation_about_the_vertical_moves_with_the_scale_along_it() {
    let hand = Hand::new(Held { wobble: 0.0, ..Held::default() }, 2);
    let hand = hand.rest(3.0).turn_up(Vector3::new(0.6, 0.0, 0.8), 1.5).rest(3.0);
    let up = hand.up();
    let (history, rests) = followed(&hand.turn(up * TAU, 4.0).rest(3.0));
    let ends = [&rests[1], &rests[2]].map(|rest| rest.start);
    let turn = history.turns(|start| ends.contains(&start)).pop().unwrap();
    let (pieces, rate) = (turn.pieces(), rests[1].gyroscope.as_ref().unwrap().mean);
    let at = |matrix: Matrix3<f64>, rate: Vector3<f64>| {
        let ends = Ends { up: [up; 2], rate: [rate; 2], by_up: Matrix3::zeros() };
        vertical(pieces.iter(), &Candidate::of_inverse(matrix), &ends)
    };
    let (one, step) = (Matrix3::identity(), 1e-6);
    let here = at(one, rate);
    assert!((here.angle - TAU).abs() < 2e-3, "{}", here.angle);
    for k in 0..9 {
        let mut moved = one;
        moved[(k / 3, k % 3)] += step;
        let by = (at(moved, rate).angle - here.angle) / step;
        assert!((by - here.by_inverse[k]).abs() < 0.03, "{k}: {by} {}", here.by_inverse[k]);
    }
    for axis in 0..3 {
        let by = (at(one, rate - Vector3::ith(axis, step)).angle - here.angle) / step;
        assert!((by - here.by_rate[axis]).abs() < 0.03, "{axis}: {by} {}", here.by_rate[axis]);
    }
}

/// What an engine makes of it: accelerometer and gyroscope.
fn learned(hand: &Hand) -> (Triad, Triad) {
    learned_with(hand, fit::Config::default())
}

fn learned_with(hand: &Hand, fit: fit::Config) -> (Triad, Triad) {
    let fit = fit::Config { gravity: Some(hand::G), ..fit };
    let mut engine = Engine::new(Config { fit, ..Config::default() });
    let mut events = Vec::new();
    hand.samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let last = events.into_iter().rev().find_map(|event| match event.message {
        Message::Calibration(calibration) => Some(*calibration),
        _ => None,
    });
    let calibration = last.unwrap();
    (calibration.accelerometer.unwrap(), calibration.gyroscope.unwrap())
}

/// A sensor whose axes are skewed and scaled as a datasheet allows.
fn skewed(seed: u64) -> Held {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut off = || Matrix3::from_fn(|_, _| rng.random_range(-0.02..0.02));
    let (gyroscope, accelerometer) = (off(), off().lower_triangle());
    Held {
        gyro_sensitivity: Matrix3::identity() + gyroscope,
        accel_sensitivity: Matrix3::identity() + accelerometer,
        accel_bias: Vector3::new(0.2, -0.1, 0.15),
        placement: 0.005,
        ..Held::default()
    }
}

/// Entries of S within their 95 % intervals, and the largest error over its standard deviation.
fn within(triad: &Triad, truth: &Matrix3<f64>) -> (usize, f64) {
    let errors =
        (0..9).map(|k| (triad.sensitivity[k] - truth[(k / 3, k % 3)]).abs() / triad.sensitivity_std[k].max(1e-12));
    let errors: Vec<_> = errors.collect();
    (errors.iter().filter(|error| **error <= 1.96).count(), errors.iter().copied().fold(0.0, f64::max))
}

#[test]
fn six_faces_and_the_turns_between_them_determine_both_sensors() {
    let (mut inside, mut all) = (0, 0);
    for seed in 0..8 {
        let held = skewed(seed);
        let (gyro, accel) = (held.gyro_sensitivity, held.accel_sensitivity);
        let (accelerometer, gyroscope) = learned(&Hand::new(held, seed).rest(3.0).through_faces(24));
        assert_eq!(accelerometer.model(), Model::Triangular, "{seed}: {:?}", accelerometer.notes);
        assert_eq!(gyroscope.model(), Model::Turns, "{seed}: {:?}", gyroscope.notes);
        let worst_case = accelerometer.worst_case_error.unwrap();
        // What one wrong placement could hide is in it, too, which the turns check as other placements do.
        assert!(worst_case < 0.06, "{seed}: {worst_case}");
        assert!(gyroscope.turns >= 20 && gyroscope.row_norms.is_some());
        for (triad, truth) in [(&accelerometer, accel), (&gyroscope, gyro)] {
            let (good, worst) = within(triad, &truth);
            assert!(worst < 6.0, "{seed}: {worst} {:?} {truth}", triad.sensitivity);
            (inside, all) = (inside + good, all + 9);
        }
    }
    assert!(100 * inside > 85 * all, "{inside} of {all}");
}

#[test]
fn what_gravity_adds_to_the_rates_is_found_and_taken_out_of_the_turns() {
    let by_up = Matrix3::new(0.35, 1.0, -0.8, -1.5, 0.2, 1.1, 0.6, -0.9, 0.4) * 1.75e-3;
    let held = Held { g_sensitivity: by_up, ..skewed(3) };
    let truth = held.gyro_sensitivity;
    let (_, gyroscope) = learned(&Hand::new(held, 3).rest(3.0).through_faces(20));
    assert!(within(&gyroscope, &truth).1 < 6.0, "{:?} {truth}", gyroscope.sensitivity);
    for k in 0..9 {
        assert!(
            (gyroscope.g_sensitivity[k] * hand::G - by_up[(k / 3, k % 3)]).abs() < 2e-4,
            "{:?}",
            gyroscope.g_sensitivity
        );
    }
}

#[test]
fn turns_about_the_vertical_claim_no_scale() {
    // Six faces, and then a drive.
    let hand = Hand::new(skewed(5), 5).rest(3.0).through_faces(5);
    let hand = (0..12).fold(hand, |hand, i| {
        let up = hand.up();
        hand.turn(up * if i % 2 == 0 { 1.5 } else { -2.5 }, 2.0).rest(3.0)
    });
    let (accelerometer, gyroscope) = learned(&hand);
    assert_ne!(accelerometer.model(), Model::None);
    assert!(gyroscope.sensitivity.is_empty() && gyroscope.bias.is_some());
    assert!(gyroscope.notes.iter().any(|note| note.contains("vertical")), "{:?}", gyroscope.notes);
}

#[test]
fn whole_turns_of_a_table_sharpen_the_gyroscope_once_they_are_declared() {
    let (mut inside, mut all) = (0, 0);
    for seed in 0..8 {
        let held = skewed(seed);
        let truth = held.gyro_sensitivity;
        let mut hand = Hand::new(Held { wobble: 0.02, ..held }, seed).rest(3.0).through_faces(24);
        for (axis, turns) in [(Vector3::x(), 2.0), (Vector3::y(), -1.0), (Vector3::z(), 3.0)] {
            hand = hand.turn_up(axis, 1.5).rest(3.0);
            let up = hand.up();
            hand = hand.turn(up * (turns * TAU), 4.0 * turns.abs()).rest(3.0);
        }
        let (_, before) = learned(&hand);
        let (_, after) = learned_with(&hand, fit::Config { whole_turns: true, ..fit::Config::default() });
        assert_eq!((before.model(), after.model()), (Model::Turns, Model::Turns), "{seed}: {:?}", after.notes);
        let widest = |triad: &Triad| [0, 4, 8].map(|k| triad.sensitivity_std[k]).into_iter().fold(0.0, f64::max);
        assert!(widest(&after) <= widest(&before), "{seed}: {} {}", widest(&after), widest(&before));
        let (good, worst) = within(&after, &truth);
        assert!(worst < 6.0, "{seed}: {worst} {:?} {truth}", after.sensitivity);
        (inside, all) = (inside + good, all + 9);
    }
    assert!(100 * inside > 85 * all, "{inside} of {all}");
}

#[test]
fn a_table_that_missed_its_mark_is_left_out() {
    let held = skewed(4);
    let truth = held.gyro_sensitivity;
    let mut hand = Hand::new(Held { wobble: 0.02, ..held }, 4).rest(3.0).through_faces(24);
    for (axis, missed) in [(Vector3::x(), 0.0), (Vector3::y(), 10_f64.to_radians()), (Vector3::z(), 0.0)] {
        hand = hand.turn_up(axis, 1.5).rest(3.0);
        let up = hand.up();
        hand = hand.turn(up * (TAU - missed), 4.0).rest(3.0);
    }
    let (_, gyroscope) = learned_with(&hand, fit::Config { whole_turns: true, ..fit::Config::default() });
    assert_eq!(gyroscope.model(), Model::Turns, "{:?}", gyroscope.notes);
    assert!(within(&gyroscope, &truth).1 < 6.0, "{:?} {truth}", gyroscope.sensitivity);
}

#[test]
fn clipped_turns_are_left_out_and_said() {
    let held = skewed(6);
    let truth = held.gyro_sensitivity;
    let mut hand = Hand::new(held, 6).rest(3.0).through_faces(24);
    hand.samples.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Gyroscope).for_each(|(_, sample)| {
        sample.value = sample.value.map(|x| x.clamp(-2.6, 2.6));
    });
    let (_, gyroscope) = learned(&hand);
    assert!(gyroscope.notes.iter().any(|note| note.contains("end of the range")), "{:?}", gyroscope.notes);
    if !gyroscope.sensitivity.is_empty() {
        assert!(within(&gyroscope, &truth).1 < 6.0, "{:?} {truth}", gyroscope.sensitivity);
    }
}

#[test]
fn without_a_calibrated_accelerometer_turns_claim_nothing() {
    let hand = Hand::new(skewed(7), 7).rest(3.0).turn_up(Vector3::x(), 1.5).rest(3.0);
    let hand = (0..9).fold(hand, |hand, i| hand.turn_up([Vector3::z(), Vector3::x()][i % 2], 1.5).rest(3.0));
    let (accelerometer, gyroscope) = learned(&hand);
    assert_eq!(accelerometer.model(), Model::None);
    assert!(gyroscope.sensitivity.is_empty() && gyroscope.bias.is_some());
}
