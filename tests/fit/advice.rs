//! Advice on the next poses: what it names, and what comes of following it.

use nalgebra::{Matrix3, Vector3};
use stillpoint::engine::{Config, Engine, Event, Message};
use stillpoint::fit;
use stillpoint::imu::Sensor;
use stillpoint::messages::Triad;
use stillpoint::messages::triad::Status;

use crate::hand::{G, Hand, Held};
use crate::next_step::{FACES, pose, promise};

/// A sensor whose axes are not perpendicular, put down with a scatter.
fn held() -> Held {
    Held {
        placement: 0.01,
        accel_bias: Vector3::new(-0.3, 0.2, 0.4),
        accel_sensitivity: Matrix3::new(1.01, 0.0, 0.0, 0.008, 0.98, 0.0, -0.006, 0.009, 1.02),
        ..Held::default()
    }
}

/// A session under way, with its engine.
struct Course {
    hand: Hand,
    engine: Engine,
    gyroscope: bool,
    accelerometer: Triad,
    next_step: String,
}

impl Course {
    fn new(seed: u64, gyroscope: bool) -> Self {
        let fit = fit::Config { gravity: Some(G), ..fit::Config::default() };
        let engine = Engine::new(Config { fit, ..Config::default() });
        let (accelerometer, next_step) = (Triad::default(), String::new());
        Self { hand: Hand::new(held(), seed), engine, gyroscope, accelerometer, next_step }
    }

    /// Shows a pose, and the motion after it, by which its rest ends.
    fn show(mut self, up: Vector3<f64>) -> Self {
        self.hand = self.hand.turn_up(up, 1.5).rest(3.0).turn(Vector3::new(0.2, 0.1, 0.0), 0.5);
        let mut events: Vec<Event> = Vec::new();
        for (sensor, sample) in
            self.hand.samples.drain(..).filter(|(sensor, _)| self.gyroscope || *sensor == Sensor::Accelerometer)
        {
            self.engine.push(sensor, &sample, &mut events);
        }
        for event in events {
            match event.message {
                Message::Calibration(calibration) => self.accelerometer = calibration.accelerometer.unwrap(),
                Message::Coverage(coverage) => self.next_step = coverage.next_step,
                _ => {}
            }
        }
        self
    }

    fn error(&self) -> f64 {
        self.accelerometer.worst_case_error.unwrap()
    }
}

fn faces(course: Course) -> Course {
    FACES.iter().fold(course, |course, (_, up)| course.show(Vector3::from(*up)))
}

#[test]
fn what_repeated_faces_leave_open_is_asked_for_by_edges_and_they_bring_what_is_promised() {
    let mut course = faces(faces(Course::new(1, false)));
    assert_eq!(course.accelerometer.status(), Status::Confirmed, "{}", course.next_step);
    assert!(course.next_step.starts_with("done: "), "{}", course.next_step);
    assert!(course.next_step.contains("the edge between "), "{}", course.next_step);
    let (poses, promised) = promise(&course.next_step).unwrap();
    assert!(course.error() > 0.2 && promised < 0.75 * course.error(), "{}", course.next_step);
    for _ in 0..poses {
        let up = pose(&course.next_step).unwrap_or_else(|| panic!("{}", course.next_step));
        course = course.show(up);
    }
    assert!(course.error() < 1.3 * promised, "{} of {promised}: {}", course.error(), course.next_step);
}

#[test]
fn following_it_ends_with_a_small_error_and_says_enough() {
    for gyroscope in [false, true] {
        let mut course = faces(Course::new(2, gyroscope));
        let mut poses = 6;
        while !course.next_step.contains(": enough") {
            let up = pose(&course.next_step).unwrap_or_else(|| panic!("{}", course.next_step));
            (course, poses) = (course.show(up), poses + 1);
            assert!(poses < 60, "{}", course.next_step);
        }
        assert_eq!(course.accelerometer.status(), Status::Confirmed);
        assert!(course.error() < 0.08, "{} after {poses}: {}", course.error(), course.next_step);
    }
}

#[test]
fn six_faces_are_told_what_their_repeats_will_bring() {
    let course = faces(Course::new(3, false));
    let (poses, promised) = promise(&course.next_step).unwrap_or_else(|| panic!("{}", course.next_step));
    assert_eq!(poses, 6, "{}", course.next_step);
    let repeated = faces(course);
    assert!((repeated.error() / promised - 1.0).abs() < 0.3, "{} of {promised}", repeated.error());
}
