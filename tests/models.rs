//! Every measurement model recovers the truth from what it needs, and is refused where that is missing.
#![allow(clippy::unwrap_used)]

#[path = "common/session.rs"]
mod session;

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use stillpoint::engine::{Config, Engine, Message, Secondary};
use stillpoint::fit::{
    self, Calibration, FaceConfig, Fixture, FixtureConfig, Loss, Model, Refit, SecondaryModel, Solid, directions,
};
use stillpoint::imu::Sample;
use stillpoint::messages::triad::Status;
use stillpoint::messages::{self, Triad, triad};
use stillpoint::simulate::{Scenario, Truth, samples};

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

/// A cube's faces, or a dodecahedron's.
fn faces(solid: Solid) -> Vec<Vector3<f64>> {
    let fixture = Fixture::new(&FixtureConfig { solid, ..FixtureConfig::default() });
    fixture.faces().iter().map(|face| face.normal).collect()
}

fn on(solid: Solid, model: Model) -> Config {
    let mut config = config(model);
    config.fit.fixture.solid = solid;
    config
}

fn crossed() -> Calibration {
    let sensitivity = Matrix3::new(0.98, 0.012, -0.02, 0.02, 1.03, 0.006, -0.015, 0.01, 0.96);
    Calibration { bias: Vector3::new(0.4, -1.2, 0.7), sensitivity }
}

#[test]
fn an_accurate_fixture_determines_all_of_the_sensitivity() {
    for solid in [Solid::Cube, Solid::Dodecahedron] {
        let ups = faces(solid);
        let session = Session::new().accelerometer(crossed()).rests(&ups, 4.0).rests(&ups[..3], 4.0);
        let learned = learn(&session, on(solid, Model::CrossAxis));
        let accelerometer = learned.accelerometer();
        assert_eq!(accelerometer.model(), triad::Model::CrossAxis, "{:?}", accelerometer.notes);
        assert_eq!(accelerometer.covariance.len(), 144);
        assert!((vector(&accelerometer.bias) - crossed().bias).amax() < 0.004);
        let errors = matrix(&accelerometer.sensitivity) - crossed().sensitivity;
        assert!(errors.amax() < 5e-4, "{errors}");
        // A face that is off by 0.05° is in the bars of what is across, however often it is placed.
        let stds = matrix(&accelerometer.sensitivity_std);
        assert!(stds.min() > 1e-4 && stds[(0, 1)] > 4e-4 && stds.max() < 2e-3, "{stds}");
        let gyroscope = learned.calibration.unwrap().gyroscope.unwrap();
        assert_eq!(gyroscope.model(), triad::Model::CrossAxis);
        assert_eq!((gyroscope.g_sensitivity.len(), gyroscope.g2_sensitivity.len()), (9, 3));
        assert!(matrix(&gyroscope.g_sensitivity).amax() < 1e-4);
    }
}

#[test]
fn a_fixture_that_is_not_accurate_is_refused_by_cross_axis_and_not_by_bias_scale() {
    let turn = nalgebra::Rotation3::from_scaled_axis(Vector3::new(0.02, -0.03, 0.02));
    let ups: Vec<_> =
        faces(Solid::Cube).iter().enumerate().map(|(i, up)| if i % 2 == 0 { turn * up } else { *up }).collect();
    let session = Session::new().rests(&ups, 4.0);
    let refused = learn(&session, config(Model::CrossAxis)).accelerometer();
    assert_eq!(refused.status(), Status::Undetermined);
    assert!(refused.notes[0].contains("do not point where they should"), "{:?}", refused.notes);
    assert_eq!(learn(&session, config(Model::BiasScale)).accelerometer().status(), Status::Provisional);
}

#[test]
fn a_dodecahedron_serves_the_models_that_need_no_accuracy_too() {
    let session = Session::new().accelerometer(skewed()).rests(&faces(Solid::Dodecahedron), 4.0);
    let accelerometer = learn(&session, on(Solid::Dodecahedron, Model::Auto)).accelerometer();
    assert_eq!(accelerometer.model(), triad::Model::Triangular);
    assert!((matrix(&accelerometer.sensitivity) - skewed().sensitivity).amax() < 1.5e-3);
    let truth = Calibration { sensitivity: Matrix3::from_diagonal(&Vector3::new(0.97, 1.02, 0.99)), ..skewed() };
    let session = Session::new().accelerometer(truth).rests(&faces(Solid::Dodecahedron), 4.0);
    let accelerometer = learn(&session, on(Solid::Dodecahedron, Model::BiasScale)).accelerometer();
    assert_eq!(accelerometer.model(), triad::Model::BiasScale, "{:?}", accelerometer.notes);
    assert!((matrix(&accelerometer.sensitivity) - truth.sensitivity).amax() < 1e-3);
}

#[test]
fn coverage_and_guidance_follow_a_list_of_faces_and_its_mounting() {
    let mut config = config(Model::BiasScale);
    let names = ["lid", "floor", "left", "right", "front", "back"];
    let faces = names.iter().zip(faces(Solid::Cube));
    config.fit.fixture.faces =
        faces.map(|(name, up)| FaceConfig { name: (*name).to_owned(), up: (up * 3.0).into() }).collect();
    config.fit.fixture.mounting_deg = [0.0, 0.0, 45.0];
    // The sensor's x axis lies between the fixture's x and y.
    let turned = |up: Vector3<f64>| nalgebra::Rotation3::from_scaled_axis(Vector3::z() * -45_f64.to_radians()) * up;
    let ups: Vec<_> = self::faces(Solid::Cube).into_iter().map(turned).collect();
    let learned = learn(&Session::new().rests(&ups[..5], 3.0), config.clone());
    assert!(learned.next_step.contains("back"), "{}", learned.next_step);
    assert_eq!(learned.rejected, 0);
}

#[test]
fn a_secondary_that_is_turned_is_refused_with_the_cure_and_absorbed_by_cross_axis() {
    let mounting = nalgebra::Rotation3::from_scaled_axis(Vector3::new(0.3, -0.2, 1.2)).into_inner();
    let truth = Calibration { bias: Vector3::new(1.0, -2.0, 0.5), sensitivity: mounting * 1.02 };
    let session = Session::new().secondary(truth).rests(&faces(Solid::Cube), 5.0).rests(&faces(Solid::Cube)[..3], 5.0);
    let with = |model| {
        let secondary = Secondary { name: "highg".to_owned(), model, ..Secondary::default() };
        let learned = learn(&session, Config { secondary: vec![secondary], ..config(Model::BiasScale) });
        learned.calibration.unwrap().secondary[0].clone()
    };
    let refused = with(SecondaryModel::BiasScale);
    assert_eq!(refused.status(), Status::Undetermined);
    assert!(refused.notes[0].contains("model = \"cross-axis\""), "{:?}", refused.notes);
    let found = with(SecondaryModel::CrossAxis);
    assert_eq!(found.model(), triad::Model::CrossAxis);
    let errors = matrix(&found.sensitivity) - truth.sensitivity;
    let stds = matrix(&found.sensitivity_std);
    assert!(errors.iter().zip(&stds).all(|(error, std)| error.abs() < 4.0 * std), "{errors} {stds}");
    assert!(stds.max() < 0.005, "{stds}");
}

#[test]
fn under_hubers_loss_one_wrong_placement_hardly_counts() {
    // One of eighteen placements stands on a moving bench.
    let all = faces(Solid::Cube);
    let mut ups = [all.clone(), all.clone(), all].concat();
    ups[7] *= 1.0 + 0.09 / G;
    let session = Session::new().accelerometer(skewed_scale()).rests(&ups, 3.0);
    let error = |loss| {
        let mut config = config(Model::BiasScale);
        config.fit.loss = loss;
        (vector(&learn(&session, config).accelerometer().bias) - skewed_scale().bias).amax()
    };
    // By squares it would be off by 0.015 m/s², were the placement not left out.
    let huber = error(Loss::Huber);
    assert!(huber < 0.01, "{huber}");
    assert!(error(Loss::Square) < 0.01);
}

fn skewed_scale() -> Calibration {
    Calibration { sensitivity: Matrix3::from_diagonal(&skewed().sensitivity.diagonal()), ..skewed() }
}

#[test]
fn with_a_half_life_a_calibration_follows_drift() {
    let warm = Calibration { bias: skewed().bias + Vector3::new(0.02, 0.02, 0.02), ..skewed_scale() };
    let session = Session::new().accelerometer(skewed_scale()).rests(&faces(Solid::Cube), 3.0);
    let session = session.accelerometer(warm).rests(&faces(Solid::Cube), 3.0);
    let bias = |half_life_s| {
        let mut config = config(Model::BiasScale);
        config.fit.half_life_s = half_life_s;
        vector(&learn(&session, config).accelerometer().bias)
    };
    let (forgetful, faithful) = (bias(Some(4.0)), bias(None));
    assert!((forgetful - warm.bias).amax() < 0.006, "{forgetful}");
    assert!((faithful - warm.bias).amin() > 0.006, "{faithful}");
}

#[test]
fn refits_are_published_once_a_round_if_so_configured() {
    let all = faces(Solid::Cube);
    let session = (0..3).fold(Session::new(), |session, _| session.rests(&all, 2.0)).rests(&all[..2], 2.0).motion(1.0);
    let revisions = |refit| {
        let mut config = config(Model::BiasScale);
        config.fit.refit = refit;
        let mut engine = Engine::new(config);
        let mut events = Vec::new();
        session.samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
        let determined = |message: &Message| {
            let Message::Calibration(calibration) = message else { return false };
            calibration.accelerometer.as_ref().is_some_and(|triad| triad.status() != Status::Undetermined)
        };
        events.iter().filter(|event| determined(&event.message)).count()
    };
    assert!(revisions(Refit::Segment) > 3);
    assert_eq!(revisions(Refit::Round), 3);
}

/// On a rate table, parameters and their bars against the truth of the scenario.
#[test]
fn a_reference_determines_the_full_model() {
    let scenario = Scenario::builtin("rate-table").unwrap();
    let truth = Truth::of(&scenario).unwrap();
    let mut engine = Engine::new(Config { reference: true, ..config(Model::Full) });
    let mut events = Vec::new();
    for reading in samples(&scenario).unwrap() {
        let sample = Sample { stamp: reading.stamp, log_time: reading.stamp.nanos() as u64, value: reading.measured };
        engine.push(reading.sensor, &sample, &mut events);
    }
    engine.finish(&mut events);
    let found = events.into_iter().rev().find_map(|event| match event.message {
        Message::Calibration(calibration) => Some(*calibration),
        _ => None,
    });
    let found = found.unwrap();
    let rows = |rows: [[f64; 3]; 3]| rows.concat();
    for (triad, truth, unknowns) in [
        (found.accelerometer.unwrap(), truth.accelerometer, 21),
        (found.gyroscope.unwrap(), truth.gyroscope.unwrap(), 24),
    ] {
        assert_eq!(triad.model(), triad::Model::Full, "{:?}", triad.notes);
        assert_eq!(triad.status(), Status::Confirmed, "{:?}", triad.chi2_per_dof);
        let bias = triad.bias.unwrap();
        let found = [vec![bias.x, bias.y, bias.z], triad.sensitivity].concat();
        let found = [found, triad.rate_sensitivity, triad.g_sensitivity, triad.g2_sensitivity].concat();
        let expected = [truth.bias.to_vec(), rows(truth.sensitivity)].concat();
        let cross = truth.rate_sensitivity.or(truth.g_sensitivity).map(rows).unwrap();
        let expected = [expected, cross, truth.g2_sensitivity.map_or(Vec::new(), |squares| squares.to_vec())].concat();
        assert_eq!((found.len(), expected.len()), (unknowns, unknowns));
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let std = triad.covariance[i * unknowns + i].sqrt();
            assert!((found - expected).abs() < 4.0 * std, "{} {i}: {found} {expected} ± {std}", triad.sensor);
            // Two thousandths of a sensitivity would be nothing to publish.
            assert!(std < 2e-3, "{} {i}: ± {std}", triad.sensor);
        }
    }
}
