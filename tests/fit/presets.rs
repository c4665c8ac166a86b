//! What a known sensor's datasheet changes: less than the configuration says, more than the defaults.

use nalgebra::{Matrix3, Vector3};
use stillpoint::config::{self, Layer};
use stillpoint::engine::{Config, Engine, Event, Message};
use stillpoint::fit::Calibration;
use stillpoint::imu::{Preset, Sensor};
use stillpoint::messages::triad::Status;

use crate::session::{G, START, Session};

fn truth(bias: [f64; 3]) -> Calibration {
    Calibration { bias: bias.into(), sensitivity: Matrix3::from_diagonal(&Vector3::new(0.99, 1.005, 1.01)) }
}

fn learn(session: &Session, config: Config) -> Vec<Event> {
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    session.samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    events
}

fn six_faces(truth: Calibration) -> Session {
    let ups = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()];
    Session::new().accelerometer(truth).rests(&ups, 4.0)
}

/// The status of the accelerometer in the end, and whether it was ever said.
fn outcome(events: &[Event], said: &str) -> (Status, bool) {
    let mut calibrations =
        events.iter().filter_map(|e| if let Message::Calibration(c) = &e.message { Some(c) } else { None });
    let last = calibrations.next_back().unwrap().accelerometer.clone().unwrap();
    let next_step = |e: &Event| matches!(&e.message, Message::Coverage(coverage) if coverage.next_step.contains(said));
    (last.status(), last.notes.iter().any(|note| note.contains(said)) || events.iter().any(next_step))
}

#[test]
fn a_sensor_within_its_datasheet_is_calibrated_as_without_a_preset() {
    let events = learn(&six_faces(truth([0.4, -0.5, 0.7])), Config::default().of(Preset::named("mpu9250").unwrap()));
    assert_eq!(outcome(&events, "held back"), (Status::Provisional, false));
}

#[test]
fn a_sensor_outside_its_datasheet_is_held_back_and_that_is_said() {
    // 0.26 m/s² is what an LSM6DSO may have.
    let events = learn(&six_faces(truth([0.4, -0.5, 0.7])), Config::default().of(Preset::named("lsm6dso").unwrap()));
    let (_, said) = outcome(&events, "beyond its bounds");
    assert!(said, "{events:#?}");
}

#[test]
fn readings_beyond_the_range_of_the_sensor_are_not_calibrated_into() {
    let mut session = six_faces(truth([0.1, 0.1, 0.1]));
    for (_, sample) in session.samples.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Accelerometer) {
        // In the first motion. Of another sensor, or in another unit.
        if sample.stamp.nanos() == START + 500_000_000 {
            sample.value.x = 30.0 * G;
        }
    }
    let events = learn(&session, Config::default().of(Preset::named("mpu6050").unwrap()));
    assert_eq!(outcome(&events, "beyond the 157 m/s²"), (Status::Undetermined, true));
}

#[test]
fn an_unknown_sensor_is_refused_with_the_nearest_name() {
    for table in ["[[imu]]\ntopic = '/a'", "[[imu]]\ntopic = '/a'\n[[imu.secondary]]\nname = 'b'"] {
        let error =
            config::Config::load(&[Layer::file("a.toml", &format!("{table}\npreset = 'mpu9255'"))]).unwrap_err();
        assert!(error.to_string().contains("did you mean `mpu9250`?"), "{error}");
    }
}
