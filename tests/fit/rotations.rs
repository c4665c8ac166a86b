//! Rotations about the vertical that are declared by their times.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector3};
use stillpoint::config::{self, Layer};
use stillpoint::engine::{Config, Engine, Event, Message};
use stillpoint::fit::{self, RotationConfig};
use stillpoint::imu::{Sample, Sensor};
use stillpoint::messages::foxglove::log::Level;
use stillpoint::messages::triad::Model;
use stillpoint::messages::{Triad, Turn};

use crate::common::needs::recording;
use crate::hand::{self, Hand, Held};
use crate::recognised::real_samples;

/// What an engine made of samples.
struct Learned {
    /// The last word on each turn, in order.
    turns: Vec<Turn>,
    gyroscope: Option<Triad>,
    warnings: Vec<String>,
    unused: Vec<String>,
}

fn learned(samples: &[(Sensor, Sample)], fit: fit::Config) -> Learned {
    let mut engine = Engine::new(Config { fit, ..Config::default() });
    let mut events: Vec<Event> = Vec::new();
    samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let (mut turns, mut gyroscope, mut warnings) = (BTreeMap::new(), None, Vec::new());
    for event in events {
        match event.message {
            Message::Turn(turn) => {
                let start = turn.start.unwrap();
                turns.insert((start.seconds, start.nanos), turn);
            }
            Message::Calibration(calibration) => gyroscope = calibration.gyroscope,
            Message::Log(log) if log.level() == Level::Warning => warnings.push(log.message),
            _ => {}
        }
    }
    let unused = engine.unused_rotations().to_vec();
    Learned { turns: turns.into_values().collect(), gyroscope, warnings, unused }
}

fn of(hand: &Hand, rotations: Vec<RotationConfig>) -> Learned {
    learned(&hand.samples, fit::Config { gravity: Some(hand::G), rotations, ..fit::Config::default() })
}

fn rotation(begin_s: f64, end_s: f64, angle_deg: f64) -> RotationConfig {
    RotationConfig { imu: None, begin_s, end_s, angle_deg }
}

fn on_table() -> Held {
    Held { wobble: 0.0, gyro_sensitivity: Matrix3::identity() * 1.02, ..Held::default() }
}

/// A rest of three seconds, a turn of four, and a rest of three.
fn turned(by: Vector3<f64>) -> Hand {
    Hand::new(on_table(), 7).rest(3.0).turn(by, 4.0).rest(3.0)
}

#[test]
fn a_turn_is_what_is_declared_of_its_time_whole_turns_or_not() {
    for angle in [TAU, -2.0 * TAU, PI, -0.5 * PI] {
        let hand = turned(Vector3::z() * angle);
        // In the rests before and after it, at its very ends, and within it.
        for (begin, end) in [(0.5, 9.0), (3.0, 7.0), (4.0, 6.0)] {
            let found = of(&hand, vec![rotation(begin, end, angle.to_degrees())]);
            assert!((found.turns[0].declared.unwrap() - angle).abs() < 1e-9, "{:?}", found.turns[0]);
            let missed = found.turns[0].declared_residual.unwrap();
            assert!((missed - 0.02 * angle).abs() < 0.02, "{missed}");
            assert!(found.unused.is_empty(), "{:?}", found.unused);
        }
    }
}

#[test]
fn what_a_turn_hints_at_declares_it() {
    let hand = turned(Vector3::z() * -2.0 * TAU);
    let found = of(&hand, Vec::new());
    assert_eq!(found.turns[0].declared, None);
    let hint = &found.turns[0].explanation;
    let lines = &hint[hint.find("fit.rotations = ").unwrap()..=hint.rfind(']').unwrap()];
    let config = config::Config::load(&[Layer::file("hint", lines)]).unwrap();
    let found = of(&hand, config.fit.rotations);
    assert!((found.turns[0].declared.unwrap() + 2.0 * TAU).abs() < 1e-9, "{:?}", found.turns[0]);
    assert!(!found.turns[0].explanation.contains("rotations"), "{}", found.turns[0].explanation);
}

#[test]
fn a_declaration_that_is_of_no_use_is_said_with_what_was_seen() {
    let whole = || turned(Vector3::z() * TAU);
    let two = || whole().turn(Vector3::z() * PI, 3.0).rest(3.0);
    let mut lost = whole();
    lost.samples.retain(|(sensor, sample)| {
        *sensor != Sensor::Gyroscope || !(5_000_000_000..5_200_000_000).contains(&sample.stamp.nanos())
    });
    let hasty = Hand::new(on_table(), 7).rest(3.0).turn(Vector3::z() * TAU, 4.0).rest(0.9);
    let seen = "367.2° were seen";
    for (hand, declared, words) in [
        // The other way round, in turns, in radians, one turn too many, and without what is a turn more.
        (whole(), rotation(1.0, 9.0, -360.0), seen),
        (whole(), rotation(1.0, 9.0, 1.0), seen),
        (whole(), rotation(1.0, 9.0, TAU), seen),
        (whole(), rotation(1.0, 9.0, 720.0), seen),
        (turned(Vector3::z() * 3.0 * TAU), rotation(1.0, 9.0, 720.0), "1101.6° were seen"),
        (
            whole(),
            rotation(7.5, 9.0, 360.0),
            "nothing turned between two rests then; nearest is 2.8 s to 7.3 s (367.2° about",
        ),
        (whole(), rotation(1e6, 2e6, 360.0), "nothing turned between two rests then"),
        (two(), rotation(1.0, 15.0, 540.0), "it holds 2 turns with rests between them"),
        (turned(Vector3::x() * TAU), rotation(1.0, 9.0, 360.0), "it was tilted by 17"),
        (lost, rotation(1.0, 9.0, 360.0), "readings are missing"),
        (hasty, rotation(1.0, 7.3, 360.0), "a rest at one of its ends was not accepted"),
        (Hand::new(on_table(), 7).rest(9.0), rotation(1.0, 9.0, 360.0), "no turn between two rests was found"),
    ] {
        let found = of(&hand, vec![declared.clone()]);
        assert!(found.turns.iter().all(|turn| turn.declared.is_none()), "{declared:?}: {:?}", found.turns);
        let [unused] = found.unused.as_slice() else { panic!("{declared:?}: {:?}", found.unused) };
        assert!(unused.contains(words) && unused.contains("fit.rotations declares "), "{words}: {unused}");
        assert!(found.warnings.contains(unused), "{:?}", found.warnings);
    }
    let wrong = &of(&whole(), vec![rotation(1.0, 9.0, -360.0)]).turns[0].explanation;
    assert!(wrong.contains("declared as -360.0°") && wrong.contains(seen), "{wrong}");
}

#[test]
fn a_contradicted_declaration_is_not_replaced_by_whole_turns() {
    let hand = turned(Vector3::z() * TAU);
    let rotations = vec![rotation(1.0, 9.0, -360.0)];
    let found = learned(&hand.samples, fit::Config { rotations, whole_turns: true, ..fit::Config::default() });
    assert_eq!(found.turns[0].declared, None);
}

#[test]
fn rotations_declared_one_by_one_say_what_whole_turns_say() {
    for seed in [1, 2] {
        let mut hand = Hand::new(Held { placement: 0.005, wobble: 0.02, ..on_table() }, seed);
        hand = hand.rest(3.0).through_faces(24);
        let mut rotations = Vec::new();
        for (axis, turns) in [(Vector3::x(), 2.0), (Vector3::y(), -1.0), (Vector3::z(), 3.0)] {
            hand = hand.turn_up(axis, 1.5).rest(3.0);
            let (begin, up) = (hand.seconds(), hand.up());
            hand = hand.turn(up * (turns * TAU), 4.0 * f64::abs(turns)).rest(3.0);
            rotations.push(rotation(begin - 1.0, hand.seconds() - 1.0, 360.0 * turns));
        }
        let with = |rotations, whole_turns| {
            let fit = fit::Config { gravity: Some(hand::G), rotations, whole_turns, ..fit::Config::default() };
            let found = learned(&hand.samples, fit);
            assert!(found.unused.is_empty(), "{:?}", found.unused);
            found.gyroscope.unwrap()
        };
        let (by_time, by_looks, undeclared) = (with(rotations, false), with(Vec::new(), true), with(Vec::new(), false));
        assert_eq!(by_time.model(), Model::Turns, "{:?}", by_time.notes);
        assert_eq!(by_time, by_looks);
        assert_ne!(by_time.sensitivity, undeclared.sensitivity);
    }
}

#[test]
fn rotations_on_a_table_show_the_scale_about_the_vertical_and_no_other() {
    let mut hand = Hand::new(on_table(), 3).rest(3.0);
    let mut rotations = Vec::new();
    for turns in [1.0, -1.0, 2.0, -1.5] {
        let begin = hand.seconds() - 1.0;
        hand = hand.turn(Vector3::z() * (turns * TAU), 4.0 * f64::abs(turns)).rest(3.0);
        rotations.push(rotation(begin, hand.seconds() - 1.0, 360.0 * turns));
    }
    let two = of(&hand, rotations[..2].to_vec()).gyroscope.unwrap();
    assert!(two.combinations.is_empty(), "two do not check each other: {two:?}");
    let gyroscope = of(&hand, rotations).gyroscope.unwrap();
    assert!(gyroscope.model() == Model::Bias && gyroscope.sensitivity.is_empty(), "{gyroscope:?}");
    let [known] = gyroscope.combinations.as_slice() else { panic!("{gyroscope:?}") };
    assert!((known.value - 1.02).abs() < 3.0 * known.std && known.std < 1e-3, "{known:?}");
    assert_eq!(known.coefficients, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert!(known.explanation.starts_with("scale about the vertical (0.00 0.00 1.00 in its axes) = 1.02"), "{known:?}");
    assert!(gyroscope.notes.iter().any(|note| note.contains("show one scale alone")), "{:?}", gyroscope.notes);
}

/// The three turns of a real session on a table, against what imucal makes of them.
#[test]
fn the_turns_of_a_real_table_are_declared_one_by_one() {
    let Some(path) = recording("nilspod_six_face.ros2.mcap") else { return };
    let samples = real_samples(&path);
    // As a person marked them.
    let spans = [(66.11, 69.27), (78.92, 82.08), (89.89, 92.89)];
    let undeclared = learned(&samples, fit::Config::default());
    let signs = spans.map(|(begin, end)| {
        let within = |turn: &&Turn| {
            let first = samples[0].1.stamp;
            let time = |time: Option<prost_types::Timestamp>| {
                time.map_or(0.0, |time| {
                    (time.seconds * 1_000_000_000 + i64::from(time.nanos) - first.nanos()) as f64 * 1e-9
                })
            };
            (begin..end).contains(&((time(turn.start) + time(turn.end)) / 2.0))
        };
        let turn = undeclared.turns.iter().find(within).unwrap();
        assert!(turn.declared.is_none() && turn.explanation.contains("if it was one whole turn"), "{turn:?}");
        turn.vertical.unwrap().signum()
    });
    let rotations = spans.iter().zip(signs).map(|(&(begin, end), sign)| rotation(begin, end, 360.0 * sign)).collect();
    let by_time = learned(&samples, fit::Config { rotations, ..fit::Config::default() });
    let by_looks = learned(&samples, fit::Config { whole_turns: true, ..fit::Config::default() });
    assert!(by_time.unused.is_empty(), "{:?}", by_time.unused);
    assert_eq!((&by_time.turns, &by_time.gyroscope), (&by_looks.turns, &by_looks.gyroscope));
    let declared: Vec<_> = by_time.turns.iter().filter_map(|turn| turn.declared.zip(turn.declared_residual)).collect();
    assert_eq!(declared.len(), 3);
    for ((angle, residual), reference) in declared.into_iter().zip([1.0279, 0.9824, 0.9982]) {
        let scale = 1.0 + residual / angle;
        assert!((scale - reference).abs() < 0.003, "{scale}, imucal {reference}");
    }
}
