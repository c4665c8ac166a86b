//! What a gyroscope's rests, turns and clock say against it is never confirmed: zeros at rest, coarse steps, a bias that
//! drifts, stamps that run fast, a unit that is none of its own.

use nalgebra::{Matrix3, Vector3};
use stillpoint::Stamp;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit;
use stillpoint::imu::{RateUnit, Sample, Sensor};
use stillpoint::messages::Triad;
use stillpoint::messages::triad::{Model, Status};

use crate::hand::{self, Hand, Held};

/// A session of so many turns, with its readings changed.
fn session(held: Held, seed: u64, turns: usize, change: impl Fn(Sensor, &mut Sample)) -> Vec<(Sensor, Sample)> {
    let mut samples = Hand::new(held, seed).rest(3.0).through_faces(turns).samples;
    samples.iter_mut().for_each(|(sensor, sample)| change(*sensor, sample));
    samples
}

fn gyroscope(samples: &[(Sensor, Sample)], config: Config) -> Triad {
    let fit = fit::Config { gravity: Some(hand::G), ..fit::Config::default() };
    let mut engine = Engine::new(Config { fit, ..config });
    let mut events = Vec::new();
    samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let last = events.into_iter().rev().find_map(|event| match event.message {
        Message::Calibration(calibration) => Some(*calibration),
        _ => None,
    });
    last.unwrap().gyroscope.unwrap()
}

fn says(triad: &Triad, words: &str) -> bool {
    triad.notes.iter().any(|note| note.contains(words))
}

#[test]
fn a_gyroscope_whose_driver_leaves_out_small_rates_has_no_bias() {
    let dead_band = |sensor, sample: &mut Sample| {
        if sensor == Sensor::Gyroscope {
            sample.value = sample.value.map(|rate| if rate.abs() < 0.04 { 0.0 } else { rate });
        }
    };
    let found = gyroscope(&session(Held::default(), 1, 12, dead_band), Config::default());
    assert!(found.bias.is_none() && says(&found, "exactly 0 at rest"), "{found:?}");
}

#[test]
fn a_coarse_gyroscope_is_known_to_half_a_step() {
    let step = 0.004;
    let coarse = |sensor, sample: &mut Sample| {
        if sensor == Sensor::Gyroscope {
            sample.value = sample.value.map(|rate| (rate / step).round() * step);
        }
    };
    for seed in 0..6 {
        let bias = Vector3::new(0.0101, -0.0137, 0.0058) + Vector3::repeat(0.0007 * seed as f64);
        let held = Held { gyro_noise: 0.0003, gyro_bias: bias, ..Held::default() };
        let found = gyroscope(&session(held, seed, 12, coarse), Config::default());
        let (read, std) = (found.bias.unwrap(), found.bias_std.unwrap());
        for (read, std, truth) in [(read.x, std.x, bias.x), (read.y, std.y, bias.y), (read.z, std.z, bias.z)] {
            assert!((read - truth).abs() <= 1.96 * std * 1.001, "seed {seed}: {read} ± {std}, not {truth}");
            assert!(std < step, "seed {seed}: {std}");
        }
    }
}

#[test]
fn a_bias_that_drifts_is_told_and_not_confirmed() {
    let first = Stamp::from_nanos(1_000_000_000);
    let drifting = |sensor, sample: &mut Sample| {
        if sensor == Sensor::Gyroscope {
            sample.value.x += 6e-5 * sample.stamp.seconds_since(first);
        }
    };
    let found = gyroscope(&session(Held::default(), 2, 12, drifting), Config::default());
    assert!(found.status() == Status::Provisional && says(&found, "drifts steadily"), "{found:?}");
    let still = gyroscope(&session(Held::default(), 2, 12, |_, _| {}), Config::default());
    assert!(!says(&still, "drifts steadily"), "{still:?}");
}

#[test]
fn stamps_that_run_fast_leave_the_scale_unconfirmed() {
    let first = 1_000_000_000;
    let stamped = |drift: f64| {
        move |_, sample: &mut Sample| {
            let since = sample.stamp.nanos() - first;
            sample.stamp = Stamp::from_nanos(first + (since as f64 * (1.0 + drift)) as i64);
        }
    };
    for drift in [0.01, -0.05] {
        let found = gyroscope(&session(Held::default(), 3, 24, stamped(drift)), Config::default());
        assert_eq!(found.model(), Model::Turns);
        assert!(found.status() == Status::Provisional && says(&found, "against the times of the log"), "{found:?}");
    }
    let right = gyroscope(&session(Held::default(), 3, 24, stamped(0.0)), Config::default());
    assert!(right.status() == Status::Confirmed && !says(&right, "times of the log"), "{right:?}");
}

#[test]
fn degrees_that_a_configuration_claims_are_told_to_be_radians_however_fast_the_turns() {
    // What is in rad/s is taken for deg/s, and looks slow: pieces of a quarter of a second turn far.
    let taken = |sensor, sample: &mut Sample| {
        if sensor == Sensor::Gyroscope {
            sample.value *= 1_f64.to_radians();
        }
    };
    for seed in 0..4 {
        let held = Held { gyro_sensitivity: Matrix3::identity(), ..Held::default() };
        let mut hand = Hand::new(held, seed).rest(3.0);
        for up in [Vector3::x(), -Vector3::z(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), Vector3::x()]
        {
            hand = hand.turn_up(up, 1.1).rest(3.0);
        }
        hand.samples.iter_mut().for_each(|(sensor, sample)| taken(*sensor, sample));
        let config = Config { gyro_unit: Some(RateUnit::DegreesPerSecond), ..Config::default() };
        let found = gyroscope(&hand.samples, config);
        assert!(found.bias.is_none() && says(&found, "unit = \"rad/s\""), "seed {seed}: {found:?}");
    }
}

#[test]
fn rates_that_no_unit_explains_are_not_confirmed() {
    let strange = |sensor, sample: &mut Sample| {
        if sensor == Sensor::Gyroscope {
            let [x, y, z] = sample.value.into();
            sample.value = Vector3::new(0.7 * x + 0.7 * y, 0.7 * y - 0.7 * z, 0.7 * z + 0.7 * x);
        }
    };
    let found = gyroscope(&session(Held::default(), 5, 14, strange), Config::default());
    assert_ne!(found.status(), Status::Confirmed, "{found:?}");
    assert!(says(&found, "misses gravity") || says(&found, "contradict") || says(&found, "unconfirmed"), "{found:?}");
}

#[test]
fn rests_that_were_recorded_twice_confirm_nothing() {
    let mut samples = session(Held { placement: 0.005, ..Held::default() }, 6, 6, |_, _| {});
    let last = samples.last().unwrap().1.stamp.nanos();
    let again: Vec<_> = samples
        .iter()
        .map(|(sensor, sample)| {
            let stamp = sample.stamp.plus_nanos(last + 60_000_000_000);
            (*sensor, Sample { stamp, log_time: stamp.nanos() as u64, ..*sample })
        })
        .collect();
    assert!(!says(&gyroscope(&samples, Config::default()), "noise and all"));
    samples.extend(again);
    let found = gyroscope(&samples, Config::default());
    assert!(found.status() != Status::Confirmed && says(&found, "noise and all"), "{found:?}");
}

#[test]
fn where_accelerometers_take_turns_the_gyroscope_is_not_learned_either() {
    let turn = std::cell::Cell::new(false);
    let mixed = |sensor, sample: &mut Sample| {
        if sensor == Sensor::Accelerometer && turn.replace(!turn.get()) {
            sample.value += Vector3::new(0.3, -0.2, 0.2);
        }
    };
    let mut engine = Engine::new(Config::default());
    let mut events = Vec::new();
    let samples = session(Held::default(), 7, 12, mixed);
    samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let (mut learned, mut told) = (0, 0);
    for event in events {
        match event.message {
            Message::Calibration(found) => {
                learned += found.gyroscope.map_or(0, |found| usize::from(found.bias.is_some()))
            }
            Message::Log(log) => told += usize::from(log.message.contains("take turns on one topic")),
            _ => {}
        }
    }
    assert_eq!((learned, told), (0, 2), "once for each triad");
}

#[test]
fn rates_in_a_unit_that_nobody_knows_are_no_rates() {
    for (times, words) in
        [(9.549, "revolutions per minute"), (4.0, "times those in rad/s"), (0.25, "times those in rad/s")]
    {
        for seed in 0..4 {
            let scaled = |sensor, sample: &mut Sample| {
                if sensor == Sensor::Gyroscope {
                    sample.value *= times;
                }
            };
            let found = gyroscope(&session(Held::default(), seed, 12, scaled), Config::default());
            assert!(found.bias.is_none() && says(&found, words), "{times}, seed {seed}: {found:?}");
        }
    }
}
