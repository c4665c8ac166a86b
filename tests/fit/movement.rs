//! A bias that moved while no placement showed its axis: only the turns between the rests tell.

use nalgebra::Vector3;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit;
use stillpoint::imu::Sensor;
use stillpoint::messages::Triad;
use stillpoint::messages::triad::Status;

use crate::hand::{G, Hand, Held};

/// Accelerometer of a session in which the bias of x moves once no face along x is shown any more.
fn learned(seed: u64, moved: f64) -> Triad {
    let held = Held { placement: 0.005, wobble: 0.05, ..Held::default() };
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let through =
        |hand: Hand, faces: &[Vector3<f64>]| faces.iter().fold(hand, |hand, face| hand.turn_up(*face, 1.5).rest(3.0));
    let before = through(Hand::new(held, seed).rest(3.0), &[x, -y, -x, y, x, -z, -x, z, -y]);
    let moves = before.samples.len();
    let mut hand = through(before, &[-z, y, z, -y, -z, y]);
    for (sensor, sample) in &mut hand.samples[moves..] {
        if *sensor == Sensor::Accelerometer {
            sample.value.x += moved;
        }
    }
    let fit = fit::Config { gravity: Some(G), ..fit::Config::default() };
    let mut engine = Engine::new(Config { fit, ..Config::default() });
    let mut events = Vec::new();
    hand.samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    let mut calibrations = events.into_iter().filter_map(|event| match event.message {
        Message::Calibration(calibration) => calibration.accelerometer,
        _ => None,
    });
    calibrations.next_back().unwrap()
}

#[test]
fn a_bias_that_moved_across_the_vertical_is_found_by_the_turns() {
    let (mut quiet, mut found) = (0, 0);
    for seed in 0..10 {
        quiet += usize::from(learned(seed, 0.0).status() == Status::Confirmed);
        let accelerometer = learned(seed, 0.12);
        let notes = accelerometer.notes.join("\n");
        found +=
            usize::from(accelerometer.status() == Status::Provisional && notes.contains("the bias of x moved by +0.1"));
    }
    assert!(quiet >= 9 && found >= 9, "{quiet} and {found} of 10");
}
