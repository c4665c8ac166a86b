//! A sensor that is pushed, knocked or lifted at one edge lies where it lay: what was wrong with its placement still is.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit;
use stillpoint::imu::{Sample, Sensor};
use stillpoint::messages::Calibration;
use stillpoint::messages::triad::Status;

use crate::hand::{G, Hand, Held};

/// Last calibration of a session.
fn learned(samples: &[(Sensor, Sample)]) -> Calibration {
    let fit = fit::Config { gravity: Some(G), ..fit::Config::default() };
    let mut engine = Engine::new(Config { fit, ..Config::default() });
    let mut events = Vec::new();
    samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let mut calibrations = events.into_iter().filter_map(|event| match event.message {
        Message::Calibration(calibration) => Some(*calibration),
        _ => None,
    });
    calibrations.next_back().unwrap()
}

/// Turns it by two to six degrees about any axis, where it may stay.
fn push(hand: Hand, rng: &mut ChaCha8Rng, stays: bool) -> Hand {
    let axis = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
    let turn = axis.normalize() * rng.random_range(2.0_f64..6.0).to_radians();
    let hand = hand.turn(turn, 0.3);
    if stays { hand } else { hand.turn(-turn, 0.3) }
}

/// Two visits of each face, the placement `wrong` off by `off` along the vertical and pushed four times.
fn session(rng: &mut ChaCha8Rng, wrong: usize, off: f64, stays: bool) -> Vec<(Sensor, Sample)> {
    let held = Held { placement: 0.005, wobble: 0.01, ..Held::default() };
    let mut hand = Hand::new(held, rng.random()).rest(1.0);
    let mut faulty = 0..0;
    let mut along = Vector3::zeros();
    for k in 0..12 {
        let up = Vector3::ith(k % 3, if k % 6 < 3 { -1.0 } else { 1.0 });
        hand = hand.turn_up(up, 1.5).rest(2.5);
        if k == wrong {
            let from = hand.samples.len() - 500;
            along = hand.up() * off;
            for _ in 0..4 {
                hand = push(hand, rng, stays).rest(2.2);
            }
            faulty = from..hand.samples.len();
        }
    }
    for (sensor, sample) in &mut hand.samples[faulty] {
        if *sensor == Sensor::Accelerometer {
            sample.value += along;
        }
    }
    hand.samples
}

#[test]
fn a_wrong_placement_that_is_pushed_again_and_again_does_not_outvote_the_right_one() {
    for stays in [false, true] {
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let off = rng.random_range(0.12..0.3) * if rng.random() { 1.0 } else { -1.0 };
            let wrong = rng.random_range(0..12);
            let accelerometer = learned(&session(&mut rng, wrong, off, stays)).accelerometer.unwrap();
            if accelerometer.status() != Status::Confirmed {
                continue;
            }
            let (bias, std) = (accelerometer.bias.unwrap(), accelerometer.bias_std.unwrap());
            for (error, std) in [(bias.x, std.x), (bias.y, std.y), (bias.z, std.z)] {
                assert!(error.abs() < 3.29 * std, "seed {seed}, stays {stays}: off by {error} ± {std}");
            }
        }
    }
}

#[test]
fn a_push_is_no_drift() {
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
        let accelerometer = learned(&session(&mut rng, 3, 0.0, true)).accelerometer.unwrap();
        let notes = accelerometer.notes.join("\n");
        assert!(!notes.contains("drift") && !notes.contains("changed by"), "seed {seed}: {notes}");
    }
}

#[test]
fn a_sensor_in_one_pose_on_a_slow_turntable_has_no_narrow_bias() {
    for degrees in [0.5_f64, 0.7, 1.0] {
        let held = Held::default();
        let bias = held.gyro_bias;
        let mut hand = Hand::new(held, 7).rest(10.0).turn(Vector3::z() * 1.0, 1.0).rest(10.0);
        for (sensor, sample) in &mut hand.samples {
            if *sensor == Sensor::Gyroscope {
                sample.value.z += degrees.to_radians();
            }
        }
        let gyroscope = learned(&hand.samples).gyroscope.unwrap();
        if let (Some(found), Some(std)) = (gyroscope.bias, gyroscope.bias_std) {
            assert!((found.z - bias.z).abs() < 3.29 * std.z, "{degrees} °/s: {} ± {}", found.z, std.z);
        }
    }
}

#[test]
fn sensors_in_turn_a_few_times_the_noise_apart_are_not_confirmed() {
    let held = Held { placement: 0.005, ..Held::default() };
    let alone = Hand::new(held, 5).rest(3.0).through_faces(24).samples;
    assert_eq!(learned(&alone).accelerometer.unwrap().status(), Status::Confirmed);
    let mut two = alone;
    let accelerometer = two.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Accelerometer);
    accelerometer.step_by(2).for_each(|(_, sample)| sample.value += Vector3::new(0.04, -0.03, 0.05));
    let learned = learned(&two);
    let accelerometer = learned.accelerometer.unwrap();
    assert!(
        accelerometer.notes.iter().any(|note| note.contains("take turns on one topic")),
        "{:?}",
        accelerometer.notes
    );
    for triad in [accelerometer, learned.gyroscope.unwrap()] {
        assert_ne!(triad.status(), Status::Confirmed);
    }
}
