//! What an engine learns from a session is the truth, or it says why not.

use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;
use stillpoint::engine::{Config, Engine, Event, Message, Secondary};
use stillpoint::fit::{self, Bounds, Calibration, Estimator};
use stillpoint::imu::Sensor;
use stillpoint::messages::segment::Reason;
use stillpoint::messages::triad::Status;
use stillpoint::messages::{self, Segment, Triad};

use crate::session::{G, GYRO_BIAS, Session};

fn cube() -> [Vector3<f64>; 6] {
    [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()]
}

fn tilted(up: Vector3<f64>, degrees: f64) -> Vector3<f64> {
    let axis = up.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
    Rotation3::from_scaled_axis(axis * degrees.to_radians()) * up
}

fn truth() -> Calibration {
    Calibration {
        bias: Vector3::new(-0.382, 0.695, -0.595),
        sensitivity: Matrix3::from_diagonal(&Vector3::new(0.967, 0.975, 0.983)),
    }
}

/// Gravity is known, so that the scale can be held against the truth.
fn config() -> Config {
    Config { fit: fit::Config { gravity: Some(G), ..fit::Config::default() }, ..Config::default() }
}

struct Learned {
    events: Vec<Event>,
    engine: Engine,
}

fn learn(session: &Session, config: Config) -> Learned {
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    for (sensor, sample) in &session.samples {
        engine.push(*sensor, sample, &mut events);
    }
    engine.finish(&mut events);
    Learned { events, engine }
}

impl Learned {
    fn calibrations(&self) -> Vec<&messages::Calibration> {
        self.events
            .iter()
            .filter_map(|e| if let Message::Calibration(c) = &e.message { Some(&**c) } else { None })
            .collect()
    }

    fn segments(&self) -> Vec<&Segment> {
        self.events.iter().filter_map(|e| if let Message::Segment(s) = &e.message { Some(s) } else { None }).collect()
    }

    fn reasons(&self) -> Vec<Reason> {
        self.segments().iter().map(|segment| segment.reason()).collect()
    }

    fn coverage(&self) -> &messages::Coverage {
        let coverage = |e| if let &Event { message: Message::Coverage(ref c), .. } = e { Some(c) } else { None };
        self.events.iter().rev().find_map(coverage).unwrap()
    }

    /// Why the accelerometer has no calibration.
    fn refusal(&self) -> String {
        let accelerometer = self.accelerometer();
        assert_eq!(accelerometer.status(), Status::Undetermined);
        accelerometer.notes[0].clone()
    }

    fn accelerometer(&self) -> Triad {
        self.calibrations().last().unwrap().accelerometer.clone().unwrap()
    }
}

fn vector(v: &Option<messages::Vector3>) -> Vector3<f64> {
    let v = v.as_ref().unwrap();
    Vector3::new(v.x, v.y, v.z)
}

fn assert_near(triad: &Triad, truth: &Calibration, bias: f64, scale: f64) {
    let bias_error = vector(&triad.bias) - truth.bias;
    let scale_error = vector(&triad.scale) - truth.sensitivity.diagonal();
    assert!(bias_error.amax() < bias, "bias is off by {bias_error}");
    assert!(scale_error.amax() < scale, "scale is off by {scale_error}");
}

#[test]
fn six_faces_determine_bias_and_scale_provisionally() {
    let learned = learn(&Session::new().accelerometer(truth()).rests(&cube(), 5.0), config());
    let accelerometer = learned.accelerometer();
    assert_near(&accelerometer, &truth(), 0.005, 5e-4);
    assert_eq!(accelerometer.status(), Status::Provisional);
    assert_eq!(accelerometer.chi2_per_dof, None);
    // Of one visit each nothing checks the other, and the worst case says what may hide.
    assert!(learned.coverage().next_step.contains("up once more (and 5 more after it)"));
    assert!(accelerometer.worst_case_error > Some(0.4), "{:?}", accelerometer.worst_case_error);
}

#[test]
fn repeated_placements_that_agree_confirm_it() {
    let some = Session::new().accelerometer(truth()).rests(&cube(), 3.0).rests(&cube()[..3], 3.0);
    let learned = learn(&some, config());
    // A wrong placement on one of the other three would not show.
    assert_eq!(learned.accelerometer().status(), Status::Provisional);
    assert!(learned.coverage().next_step.contains("up once more (and 2 more after it)"));
    let all = some.rests(&cube()[3..], 3.0);
    let accelerometer = learn(&all, config()).accelerometer();
    assert_near(&accelerometer, &truth(), 0.005, 5e-4);
    assert_eq!(accelerometer.status(), Status::Confirmed);
}

#[test]
fn splitting_one_placement_confirms_nothing() {
    let mut config = config();
    config.still.max_duration_s = 2.0;
    let session = Session::new().accelerometer(truth()).rests(&cube(), 9.0);
    assert_eq!(learn(&session, config).accelerometer().status(), Status::Provisional);
}

#[test]
fn tilts_do_not_bias_the_refined_estimate() {
    let ups: Vec<_> = cube().iter().enumerate().map(|(i, up)| tilted(*up, [0.5, 4.0][i % 2])).collect();
    let session = Session::new().accelerometer(truth()).rests(&ups, 5.0);
    assert_near(&learn(&session, config()).accelerometer(), &truth(), 0.008, 8e-4);
    let mut fixture = config();
    fixture.fit.estimator = Estimator::Fixture;
    let naive = learn(&session, fixture).accelerometer();
    let error = (vector(&naive.bias) - truth().bias).amax();
    assert!(error > 0.01, "the thesis' estimator takes tilt for bias");
    assert!(vector(&naive.bias_std).max() > error / 3.0, "and its bars say so: {:?}", naive.bias_std);
}

#[test]
fn a_bias_of_most_of_a_g_is_found() {
    let large = Calibration { bias: Vector3::new(4.1, -4.9, 7.5), ..truth() };
    let learned = learn(&Session::new().accelerometer(large).rests(&cube(), 4.0), config());
    assert_near(&learned.accelerometer(), &large, 0.006, 6e-4);
}

#[test]
fn five_faces_determine_no_accelerometer_and_the_missing_one_is_named() {
    let learned = learn(&Session::new().rests(&cube()[..5], 4.0), config());
    assert_eq!(learned.accelerometer().status(), Status::Undetermined);
    let coverage = learned.coverage();
    assert!(!coverage.complete);
    assert_eq!(learned.refusal(), "not seen at rest: -Z");
    assert!(coverage.next_step.contains("-Z points up"), "{}", coverage.next_step);
}

#[test]
fn a_misaligned_rest_is_rejected_with_its_tilt_and_a_question() {
    let session = Session::new().accelerometer(truth()).rests(&cube(), 4.0).rests(&[tilted(Vector3::z(), 25.0)], 4.0);
    let learned = learn(&session, config());
    let rejected: Vec<_> = learned.segments().into_iter().filter(|segment| !segment.accepted).cloned().collect();
    assert_eq!(rejected.len(), 1);
    assert_eq!(rejected[0].reason(), Reason::Tilted);
    assert!((rejected[0].tilt_deg.unwrap() - 25.0).abs() < 0.2);
    assert!(rejected[0].explanation.contains("was the sensor lying flat?"));
    assert_near(&learned.accelerometer(), &truth(), 0.006, 6e-4);
}

#[test]
fn a_rest_that_the_raw_readings_misplaced_is_judged_again_once_the_bias_is_known() {
    // Before −Z is seen, the large bias makes the tilted rest look like an upright one.
    let large = Calibration { bias: Vector3::new(0.0, 0.0, 5.0), ..Calibration::default() };
    let mut ups = cube().to_vec();
    ups.insert(0, tilted(Vector3::x(), 24.0));
    let learned = learn(&Session::new().accelerometer(large).rests(&ups, 4.0), config());
    let first = learned.segments()[0].start;
    let verdicts: Vec<_> = learned.segments().into_iter().filter(|segment| segment.start == first).collect();
    assert_eq!(verdicts.last().unwrap().reason(), Reason::Tilted, "{verdicts:#?}");
    assert_near(&learned.accelerometer(), &large, 0.006, 6e-4);
}

#[test]
fn a_gyroscope_bias_needs_one_rest_and_no_faces() {
    let learned = learn(&Session::new().motion(2.0).rest(Vector3::z(), 4.0).motion(1.0), config());
    let calibration = learned.calibrations()[0].clone();
    let gyroscope = calibration.gyroscope.unwrap();
    assert!((vector(&gyroscope.bias) - Vector3::from(GYRO_BIAS)).amax() < 5e-4);
    assert_eq!(gyroscope.status(), Status::Provisional);
    assert_eq!(calibration.accelerometer.unwrap().status(), Status::Undetermined);
}

#[test]
fn a_turn_at_constant_rate_is_no_rest() {
    let session =
        Session::new().rest(Vector3::z(), 4.0).rests(&cube()[..3], 4.0).motion(1.0).turn(5.0, 0.1).motion(1.0);
    let learned = learn(&session, config());
    assert_eq!(learned.reasons().iter().filter(|reason| **reason == Reason::Turning).count(), 1);
    let gyroscope = learned.calibrations().last().unwrap().gyroscope.clone().unwrap();
    assert!((vector(&gyroscope.bias) - Vector3::from(GYRO_BIAS)).amax() < 5e-4);
}

#[test]
fn a_short_rest_is_reported_but_does_not_enter() {
    let learned = learn(&Session::new().rest(Vector3::z(), 4.0).rests(&[Vector3::x()], 0.8).motion(1.0), config());
    assert_eq!(learned.reasons(), [Reason::Accepted, Reason::TooShort]);
    assert_eq!(learned.calibrations().last().unwrap().segments, 1);
}

#[test]
fn a_secondary_is_calibrated_on_the_primary_over_tilted_rests_too() {
    let highg = Calibration {
        bias: Vector3::new(-7.946, 0.185, -1.146),
        sensitivity: Matrix3::from_diagonal(&Vector3::new(0.942, 0.970, 0.995)),
    };
    let oblique: Vec<_> = (0..4).map(|i| tilted(cube()[i], 30.0)).collect();
    let session = Session::new().accelerometer(truth()).secondary(highg).rests(&cube(), 5.0).rests(&oblique, 5.0);
    let mut config = config();
    config.secondary = vec![Secondary { name: "highg".to_owned(), ..Secondary::default() }];
    let learned = learn(&session, config);
    let secondary = learned.calibrations().last().unwrap().secondary[0].clone();
    assert_eq!(secondary.sensor, "highg");
    assert_near(&secondary, &highg, 0.03, 0.004);
    let std = vector(&secondary.bias_std);
    assert!((vector(&secondary.bias) - highg.bias).amax() < 4.0 * std.amax(), "{std}");
}

#[test]
fn a_secondary_that_does_not_follow_the_primary_is_refused() {
    let swapped = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let in_g = Matrix3::identity() / G;
    for sensitivity in [swapped, in_g, Matrix3::zeros()] {
        let wrong = Calibration { bias: Vector3::zeros(), sensitivity };
        let session = Session::new().secondary(wrong).rests(&cube(), 4.0).rests(&cube()[..3], 4.0);
        let secondary = vec![Secondary { name: "highg".to_owned(), ..Secondary::default() }];
        let learned = learn(&session, Config { secondary, ..config() });
        let last = learned.calibrations().last().unwrap().secondary[0].clone();
        assert_eq!(last.status(), Status::Undetermined, "{last:?}");
        assert!(last.notes[0].contains("does not follow the primary"), "{:?}", last.notes);
    }
}

#[test]
fn unmodelled_cross_axis_is_in_the_bars_however_often_it_is_repeated() {
    let mut skewed = truth();
    (skewed.sensitivity[(0, 1)], skewed.sensitivity[(1, 2)], skewed.sensitivity[(2, 0)]) = (0.015, -0.012, 0.01);
    let ups: Vec<_> = cube().iter().map(|up| tilted(*up, 8.0)).collect();
    let session = (0..5).fold(Session::new().accelerometer(skewed), |session, _| session.rests(&ups, 2.5));
    let accelerometer = learn(&session, config()).accelerometer();
    let deviations = (vector(&accelerometer.bias) - truth().bias).component_div(&vector(&accelerometer.bias_std));
    assert!(deviations.amax() < 3.5, "{deviations}");
}

#[test]
fn what_is_not_gravity_is_not_taken_for_it() {
    // Readings in g, and readings from which gravity was removed.
    for (up, words) in [(1.0 / G, "in g"), (0.05 / G, "gravity was removed")] {
        let ups: Vec<_> = cube().iter().map(|face| face * up).collect();
        let learned = learn(&Session::new().rests(&ups, 4.0), config());
        assert!(learned.calibrations().is_empty());
        let reasons = learned.reasons();
        assert!(reasons.iter().all(|reason| *reason == Reason::SensorFault), "{reasons:?}");
        assert!(learned.segments()[0].explanation.contains(words), "{}", learned.segments()[0].explanation);
    }
}

#[test]
fn the_remainder_of_a_split_rest_is_not_too_short() {
    let mut config = config();
    config.still.max_duration_s = 4.0;
    let learned = learn(&Session::new().rest(Vector3::z(), 8.8).motion(1.0), config);
    assert!(learned.segments().iter().all(|segment| segment.accepted), "{:?}", learned.reasons());
}

#[test]
fn rounding_that_noise_does_not_average_out_is_said_and_in_the_bars() {
    let mut session = Session::new().accelerometer(truth()).rests(&cube(), 3.0);
    for (_, sample) in session.samples.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Accelerometer) {
        // Three times the noise.
        sample.value = sample.value.map(|value| (value / 0.09).round() * 0.09);
    }
    let accelerometer = learn(&session, config()).accelerometer();
    assert!(accelerometer.notes.iter().any(|note| note.contains("below half a step")), "{:?}", accelerometer.notes);
    assert!(vector(&accelerometer.bias_std).min() > 0.012);
}

#[test]
fn a_frozen_stream_is_no_rest() {
    let mut session = Session::new().rests(&cube(), 3.0).motion(1.0);
    let frozen = session.samples.len();
    session = session.rest(Vector3::x(), 5.0);
    let value = session.samples[frozen + 1].1.value;
    for (sensor, sample) in session.samples.iter_mut().skip(frozen) {
        if *sensor == Sensor::Accelerometer {
            sample.value = value;
        }
    }
    let learned = learn(&session, config());
    assert_eq!(learned.reasons().last(), Some(&Reason::SensorFault));
    assert_eq!(learned.accelerometer().status(), Status::Provisional);
}

#[test]
fn bumps_of_the_table_on_one_face_confirm_nothing() {
    let mut session = Session::new().accelerometer(truth()).rests(&cube(), 3.0);
    for _ in 0..4 {
        session = session.motion(0.4).rest(-Vector3::z(), 3.0);
    }
    assert_eq!(learn(&session, config()).accelerometer().status(), Status::Provisional);
}

#[test]
fn contradicting_rests_are_refused_with_their_residual() {
    // Nobody puts a sensor down so that two axes at once read half a m/s² too much or too little at random.
    let mut session = Session::new().rests(&cube(), 4.0);
    for (face, off) in [(0, 0.5), (2, -0.5), (4, 0.4)] {
        session = session.motion(1.0).rest(cube()[face] * (1.0 + off / G), 4.0);
    }
    let learned = learn(&session, config());
    let refusal = learned.coverage().next_step.clone();
    assert!(refusal.contains("contradict"), "{refusal}");
}

/// The last verdict on each rest, in their order.
fn last_verdicts(learned: &Learned) -> Vec<Segment> {
    let mut last: Vec<Segment> = Vec::new();
    for segment in learned.segments() {
        match last.iter_mut().find(|known| known.start == segment.start) {
            Some(known) => *known = segment.clone(),
            None => last.push(segment.clone()),
        }
    }
    last
}

#[test]
fn one_face_of_six_that_is_wrong_cannot_show_and_that_is_said() {
    let mut ups = cube().to_vec();
    ups[4] *= 1.0 + 0.3 / G;
    let accelerometer = learn(&Session::new().accelerometer(truth()).rests(&ups, 4.0), config()).accelerometer();
    assert_eq!(accelerometer.status(), Status::Provisional);
    let notes = accelerometer.notes.join("\n");
    assert!(notes.contains("a wrong one does not show") && notes.contains("fit.placement_std"), "{notes}");
}

#[test]
fn of_faces_seen_twice_the_wrong_rest_is_named_and_left_out() {
    for (wrong, off) in [(3, 0.3), (9, -0.3), (10, 0.3)] {
        let mut ups: Vec<_> = cube().into_iter().chain(cube()).map(|up| tilted(up, 0.3)).collect();
        ups[wrong] *= 1.0 + off / G;
        let learned = learn(&Session::new().accelerometer(truth()).rests(&ups, 4.0), config());
        let verdicts = last_verdicts(&learned);
        let rejected: Vec<_> = (0..12).filter(|&i| !verdicts[i].accepted).collect();
        assert_eq!(rejected, [wrong], "{verdicts:#?}");
        assert_eq!(verdicts[wrong].reason(), Reason::Outlier);
        let explanation = &verdicts[wrong].explanation;
        assert!(explanation.contains(&format!("{off:+.1}")) && explanation.contains("Left out"), "{explanation}");
        assert_near(&learned.accelerometer(), &truth(), 0.006, 6e-4);
        // That a table tilts by a degree would explain the contrary: a third visit is asked for, and confirms.
        assert_eq!(learned.accelerometer().status(), Status::Provisional);
        let next_step = &learned.coverage().next_step;
        let face = &verdicts[wrong].face;
        assert!(next_step.contains(&format!("place {face} up once more")), "{next_step}");
        let again = Session::new().accelerometer(truth()).rests(&ups, 4.0).rests(&[ups[(wrong + 6) % 12]], 4.0);
        let learned = learn(&again, config());
        assert_eq!(learned.accelerometer().status(), Status::Confirmed, "{:?}", learned.accelerometer().notes);
        assert_near(&learned.accelerometer(), &truth(), 0.006, 6e-4);
    }
}

#[test]
fn where_either_of_two_rests_may_be_wrong_the_bars_hold_the_truth_and_the_next_step_decides() {
    // The sensor lies askew by a few degrees on every face, so that nothing but the length of gravity speaks.
    let mut undecided = 0;
    for round in 0..6 {
        let tilt = |i: usize| [5.0, -3.0, 1.0, 4.0, -6.0][(7 * i + round) % 5];
        let mut ups: Vec<_> = cube().into_iter().chain(cube()).enumerate().map(|(i, up)| tilted(up, tilt(i))).collect();
        ups[round] *= 1.0 + 0.3 / G;
        let learned = learn(&Session::new().accelerometer(truth()).rests(&ups, 4.0), config());
        let accelerometer = learned.accelerometer();
        let error = vector(&accelerometer.bias) - truth().bias;
        let deviations = error.component_div(&vector(&accelerometer.bias_std));
        assert!(deviations.amax() < 3.0, "{deviations} {:?}", accelerometer.notes);
        if learned.coverage().next_step.contains("not beyond doubt") {
            undecided += 1;
            assert_eq!(accelerometer.status(), Status::Provisional);
            // A third visit to that face decides.
            let session = Session::new().accelerometer(truth()).rests(&ups, 4.0).rests(&[cube()[round]], 4.0);
            let verdicts = last_verdicts(&learn(&session, config()));
            let rejected: Vec<_> = (0..13).filter(|&i| !verdicts[i].accepted).collect();
            assert_eq!(rejected, [round]);
        }
    }
    assert!(undecided > 0, "tilts that leave no doubt prove nothing");
}

#[test]
fn a_drift_between_the_visits_to_the_faces_is_said_with_its_size() {
    let mut session = Session::new().accelerometer(truth());
    session = session.rests(&cube(), 3.0);
    let warmed = session.samples.len();
    session = session.gap(1800.0).rests(&cube(), 3.0).motion(1.0);
    for (sensor, sample) in session.samples.iter_mut().skip(warmed) {
        if *sensor == Sensor::Accelerometer {
            sample.value += Vector3::new(0.12, 0.0, -0.1);
        }
    }
    let learned = learn(&session, config());
    let accelerometer = learned.accelerometer();
    assert_eq!(accelerometer.status(), Status::Provisional);
    let notes = accelerometer.notes.join("\n");
    for word in ["drift", "+X by +0.1", "fit.half_life_s", "30 min"] {
        assert!(notes.contains(word), "{notes}");
    }
    assert!(last_verdicts(&learned).iter().all(|segment| segment.accepted), "a drift is not a bad rest");
}

#[test]
fn a_sensor_that_is_mounted_askew_is_told_its_mounting() {
    let mounting = Rotation3::from_scaled_axis(Vector3::new(0.0, 20_f64.to_radians(), 0.0));
    let ups: Vec<_> = cube().iter().map(|face| mounting.inverse() * face).collect();
    let session = Session::new().accelerometer(truth()).rests(&ups, 3.0);
    let next_step = learn(&session, config()).coverage().next_step.clone();
    let (_, said) = next_step.split_once("fit.fixture.mounting_deg = [").unwrap_or_else(|| panic!("{next_step}"));
    let said: Vec<f64> = said.trim_end_matches(']').split(", ").map(|number| number.parse().unwrap()).collect();
    assert!(said[0].abs() < 4.0 && (said[1] - 20.0).abs() < 4.0 && said[2].abs() < 4.0, "{next_step}");
    // As told, it is calibrated.
    let mut told = config();
    told.fit.fixture.mounting_deg = [said[0], said[1], said[2]];
    assert_near(&learn(&session, told).accelerometer(), &truth(), 0.006, 6e-4);
}

#[test]
fn a_bias_beyond_its_bound_is_not_to_be_mended_by_further_rests() {
    let far = Calibration { bias: Vector3::new(12.0, 0.1, -0.2), ..Calibration::default() };
    let learned = learn(&Session::new().accelerometer(far).rests(&cube(), 3.0), config());
    let next_step = &learned.coverage().next_step;
    assert!(next_step.contains("bias x would be 12.0") && !next_step.contains("Repeat"), "{next_step}");
}

#[test]
fn a_bound_that_holds_a_parameter_back_is_said() {
    let mut config = config();
    config.fit.bounds = Bounds { accel_bias: [-0.68, 0.68].into(), ..Bounds::default() };
    let learned = learn(&Session::new().accelerometer(truth()).rests(&cube(), 4.0), config);
    let accelerometer = learned.accelerometer();
    assert_eq!(vector(&accelerometer.bias).y, 0.68);
    assert!(accelerometer.notes.iter().any(|note| note.contains("bias y is held back")), "{:?}", accelerometer.notes);
}

#[test]
fn unknown_gravity_is_in_the_bars_of_the_scale_and_not_of_the_bias() {
    let session = Session::new().accelerometer(truth()).rests(&cube(), 4.0);
    let known = learn(&session, config()).accelerometer();
    let unknown = learn(&session, Config::default()).accelerometer();
    assert!(vector(&unknown.scale_std).min() > 1.4e-3 && vector(&known.scale_std).max() < 1.0e-3);
    assert!((vector(&unknown.bias_std) - vector(&known.bias_std)).amax() < 1e-12);
}

#[test]
fn at_the_end_of_a_rest_come_segment_coverage_calibration() {
    let learned = learn(&Session::new().rests(&cube(), 4.0).motion(1.0), config());
    let kinds: Vec<_> = learned
        .events
        .iter()
        .filter_map(|event| match event.message {
            Message::Segment(_) => Some('s'),
            Message::Coverage(_) => Some('c'),
            Message::Calibration(_) => Some('k'),
            _ => None,
        })
        .collect();
    let kinds: String = kinds.into_iter().collect();
    assert!(kinds.starts_with("sck") && kinds.ends_with("sck"), "{kinds}");
}

#[test]
fn stillness_is_said_at_each_change_and_once_a_second() {
    let learned = learn(&Session::new().rests(&cube()[..2], 5.0), config());
    let times: Vec<_> =
        learned.events.iter().filter(|e| matches!(e.message, Message::Stillness(_))).map(|e| e.log_time).collect();
    assert!(times.len() >= 12 && times.windows(2).all(|pair| pair[1] - pair[0] <= 1_000_000_000));
    let states: Vec<_> = learned
        .events
        .iter()
        .filter_map(|e| if let Message::Stillness(stillness) = &e.message { Some(stillness.state()) } else { None })
        .collect();
    let changes = states.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes >= 4, "{states:?}");
}

#[test]
fn memory_stays_bounded_however_many_rests_there_are() {
    let size = |rests: usize| {
        let mut session = Session::new();
        for _ in 0..rests {
            session = session.rest(Vector3::z(), 1.6).motion(0.3);
        }
        serde_json::to_string(&learn(&session, config()).engine).unwrap().len()
    };
    let (many, more) = (size(160), size(320));
    assert!(more < many + many / 20, "{many} {more}");
}

#[test]
fn a_still_sensor_with_huge_noise_is_not_believed() {
    let mut session = Session::new();
    for i in 0..3000 {
        let shake = Vector3::new((f64::from(i) * 2.1).sin(), (f64::from(i) * 1.3).cos(), 0.3);
        session.sample(Vector3::z() * G + shake, Vector3::zeros());
    }
    let learned = learn(&session, config());
    assert!(learned.calibrations().is_empty());
    let warned = learned
        .events
        .iter()
        .any(|event| matches!(&event.message, Message::Log(log) if log.message.starts_with("never seen still")));
    assert!(warned);
}

#[test]
fn a_rest_with_readings_that_the_driver_calls_clipped_is_saturated() {
    let session = Session::new().accelerometer(truth()).rests(&cube(), 3.0).motion(1.0);
    let mut engine = Engine::new(config());
    let mut events = Vec::new();
    for (i, (sensor, sample)) in session.samples.iter().enumerate() {
        // One second into the last rest but one; and in a motion, where it means nothing.
        if [2 * 1800, 2 * 50].contains(&i) {
            engine.clipped(Sensor::Accelerometer, sample.stamp);
        }
        engine.push(*sensor, sample, &mut events);
    }
    engine.finish(&mut events);
    let learned = Learned { events, engine };
    let reasons = learned.reasons();
    assert_eq!(reasons.iter().filter(|reason| **reason == Reason::Saturated).count(), 1, "{reasons:?}");
    assert!(learned.segments()[4].explanation.contains("wider range"), "{}", learned.segments()[4].explanation);
    assert_eq!(learned.accelerometer().status(), Status::Undetermined);
    // What is to be mended comes first, and then the face once more.
    let next_step = &learned.coverage().next_step;
    assert!(next_step.contains("wider range") && next_step.contains("show +Z"), "{next_step}");
}

#[test]
fn what_was_read_before_a_driver_calibrates_by_itself_no_longer_counts() {
    let shifted = Calibration { bias: Vector3::new(0.3, 0.3, 0.3), ..truth() };
    let mut session = Session::new().accelerometer(truth()).rests(&cube(), 3.0);
    let change = session.samples.len();
    session = session.accelerometer(shifted).rests(&[Vector3::z()], 3.0).rests(&cube(), 3.0).motion(1.0);
    for sensor in [Sensor::Accelerometer, Sensor::Gyroscope, Sensor::Secondary(0)] {
        let secondary = vec![Secondary { name: "highg".to_owned(), ..Secondary::default() }];
        let mut engine = Engine::new(Config { secondary, ..config() });
        let mut events = Vec::new();
        let mut before = 0;
        for (i, (of, sample)) in session.samples.iter().enumerate() {
            if i == change {
                before = events.len();
                engine.begin_round(sensor, sample.stamp, sample.log_time, &mut events);
            }
            engine.push(*of, sample, &mut events);
        }
        engine.finish(&mut events);
        let told = events[before..].iter().any(|event| match &event.message {
            Message::Log(log) => log.message.contains("changed its own calibration"),
            _ => false,
        });
        assert!(told);
        let first = |event: &Event| if let Message::Calibration(c) = &event.message { Some(c.clone()) } else { None };
        let next = events[before..].iter().filter_map(first).next_back().unwrap();
        let learned = Learned { events, engine };
        match sensor {
            Sensor::Accelerometer => {
                assert_near(&learned.accelerometer(), &shifted, 0.005, 5e-4);
                assert_eq!(next.segments, 7);
                let statuses: Vec<_> =
                    learned.calibrations().iter().map(|c| c.accelerometer.clone().unwrap().status()).collect();
                assert!(
                    statuses.windows(2).any(|pair| pair == [Status::Provisional, Status::Undetermined]),
                    "{statuses:?}"
                );
            }
            // The accelerometer's rests stay, and contradict each other.
            _ => assert_eq!(learned.segments().iter().filter(|segment| segment.accepted).count(), 13),
        }
        if sensor == Sensor::Gyroscope {
            let statuses: Vec<_> =
                learned.calibrations().iter().map(|c| c.gyroscope.clone().unwrap().status()).collect();
            let silent = statuses.iter().filter(|status| **status == Status::Undetermined).count();
            // As often as the accelerometer has news before the gyroscope has rested long enough again.
            assert!((1..=2).contains(&silent) && statuses.last() != Some(&Status::Undetermined), "{statuses:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn a_restored_engine_says_what_an_undisturbed_one_says(cut in 0_usize..6000) {
        let session = Session::new().accelerometer(truth()).rests(&cube(), 3.0).rests(&cube()[..3], 2.0);
        let whole = learn(&session, config());
        let mut engine = Engine::new(config());
        let mut events = Vec::new();
        for (i, (sensor, sample)) in session.samples.iter().enumerate() {
            if i == cut {
                engine = serde_json::from_str(&serde_json::to_string(&engine).unwrap()).unwrap();
            }
            engine.push(*sensor, sample, &mut events);
        }
        engine.finish(&mut events);
        prop_assert_eq!(format!("{events:?}"), format!("{:?}", whole.events));
    }

    #[test]
    fn any_plausible_sensor_is_recovered_within_its_bars(
        bias in proptest::array::uniform3(-3.0..3.0),
        scale in proptest::array::uniform3(0.9..1.1),
    ) {
        let truth = Calibration { bias: bias.into(), sensitivity: Matrix3::from_diagonal(&Vector3::from(scale)) };
        let accelerometer = learn(&Session::new().accelerometer(truth).rests(&cube(), 3.0), config()).accelerometer();
        let deviations = (vector(&accelerometer.bias) - truth.bias).component_div(&vector(&accelerometer.bias_std));
        prop_assert!(deviations.amax() < 4.0, "{deviations}");
        prop_assert!(vector(&accelerometer.bias_std).max() < 0.015, "bars that say nothing");
        let deviations =
            (vector(&accelerometer.scale) - truth.sensitivity.diagonal()).component_div(&vector(&accelerometer.scale_std));
        prop_assert!(deviations.amax() < 4.0, "{deviations}");
    }
}
