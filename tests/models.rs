//! Every measurement model recovers the truth from what it needs, and is refused where that is missing.
#![allow(clippy::unwrap_used)]

#[path = "common/session.rs"]
mod session;

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use stillpoint::engine::{Config, Engine, Message};
use stillpoint::fit::{self, Calibration, Model, directions};
use stillpoint::messages::triad::Status;
use stillpoint::messages::{self, Triad, triad};

use session::{G, Session};

fn config(model: Model) -> Config {
    Config { fit: fit::Config { gravity: Some(G), model, ..fit::Config::default() }, ..Config::default() }
}

struct Learned {
    calibration: Option<messages::Calibration>,
    next_step: String,
    rejected: usize,
}

fn learn(session: &Session, config: Config) -> Learned {
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    for (sensor, sample) in &session.samples {
        engine.push(*sensor, sample, &mut events);
    }
    engine.finish(&mut events);
    let mut learned = Learned { calibration: None, next_step: String::new(), rejected: 0 };
    for event in events {
        match event.message {
            Message::Calibration(calibration) => learned.calibration = Some(*calibration),
            Message::Coverage(coverage) => learned.next_step = coverage.next_step,
            Message::Segment(segment) => learned.rejected += usize::from(!segment.accepted),
            _ => {}
        }
    }
    learned
}

impl Learned {
    fn accelerometer(&self) -> Triad {
        self.calibration.clone().unwrap().accelerometer.unwrap()
    }
}

fn vector(v: &Option<messages::Vector3>) -> Vector3<f64> {
    let v = v.as_ref().unwrap();
    Vector3::new(v.x, v.y, v.z)
}

fn matrix(values: &[f64]) -> Matrix3<f64> {
    Matrix3::from_row_slice(values)
}

fn skewed() -> Calibration {
    let sensitivity = Matrix3::new(0.98, 0.0, 0.0, 0.02, 1.03, 0.0, -0.015, 0.01, 0.96);
    Calibration { bias: Vector3::new(0.4, -1.2, 0.7), sensitivity }
}

#[test]
fn spread_directions_determine_the_triangular_model_and_none_is_too_far_from_a_face() {
    let ups: Vec<_> = directions().step_by(2).collect();
    let session = Session::new().accelerometer(skewed()).rests(&ups, 3.0);
    for model in [Model::Triangular, Model::Auto] {
        let learned = learn(&session, config(model));
        let accelerometer = learned.accelerometer();
        assert_eq!(accelerometer.model(), triad::Model::Triangular);
        assert_eq!(accelerometer.status(), Status::Confirmed);
        assert!((vector(&accelerometer.bias) - skewed().bias).amax() < 0.006);
        assert!((matrix(&accelerometer.sensitivity) - skewed().sensitivity).amax() < 1.5e-3);
    }
    assert_eq!(learn(&session, config(Model::Triangular)).rejected, 0);
}

#[test]
fn fewer_than_nine_directions_are_counted_and_a_further_one_is_asked_for() {
    let ups: Vec<_> = directions().step_by(4).collect();
    let learned = learn(&Session::new().rests(&ups, 3.0), config(Model::Triangular));
    assert_eq!(learned.accelerometer().status(), Status::Undetermined);
    assert!(
        learned.next_step.contains("9 placements in spread directions are needed, 7 seen"),
        "{}",
        learned.next_step
    );
    assert!(learned.next_step.contains("Turn the sensor so that"), "{}", learned.next_step);
}

#[test]
fn nine_placements_on_six_faces_are_not_nine_directions() {
    let faces = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()];
    let session = Session::new().accelerometer(skewed()).rests(&faces, 3.0).rests(&faces, 3.0);
    let refused = learn(&session, config(Model::Triangular)).accelerometer();
    assert_eq!(refused.status(), Status::Undetermined);
    let accepted = learn(&session, config(Model::Auto)).accelerometer();
    assert_eq!(accepted.model(), triad::Model::BiasScale);
    assert!(accepted.notes.iter().any(|note| note.starts_with("triangular is not determined")), "{:?}", accepted.notes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn any_plausible_sensor_in_random_poses_is_recovered_within_its_bars(
        bias in proptest::array::uniform3(-5.0..5.0),
        scale in proptest::array::uniform3(0.9..1.1),
        cross in proptest::array::uniform3(-0.04..0.04),
        ups in proptest::collection::vec(proptest::array::uniform3(-1.0..1.0), 24),
    ) {
        let [x, y, z]: [f64; 3] = scale;
        let sensitivity = Matrix3::new(x, 0.0, 0.0, cross[0], y, 0.0, cross[1], cross[2], z);
        let truth = Calibration { bias: bias.into(), sensitivity };
        let ups: Vec<_> = ups.into_iter().filter_map(|up| Vector3::from(up).try_normalize(0.2)).collect();
        let session = Session::new().accelerometer(truth).rests(&ups, 2.0);
        let accelerometer = learn(&session, config(Model::Triangular)).accelerometer();
        prop_assert_eq!(accelerometer.status(), Status::Confirmed, "{:?}", accelerometer.notes);
        let deviations = (vector(&accelerometer.bias) - truth.bias).component_div(&vector(&accelerometer.bias_std));
        prop_assert!(deviations.amax() < 4.0, "{deviations}");
        let errors = matrix(&accelerometer.sensitivity) - truth.sensitivity;
        let stds = matrix(&accelerometer.sensitivity_std);
        prop_assert!(errors.iter().zip(&stds).all(|(error, std)| error.abs() <= 4.0 * std), "{errors} {stds}");
    }
}
