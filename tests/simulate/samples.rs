//! A simulated recording says what its truth says: checked by means that do not share the simulator's formulas.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use stillpoint::imu::Sensor;
use stillpoint::simulate::{Axis, BUILTIN, Fault, Reading, Scenario, TriadTruth, Truth, record, samples};

fn recorded(scenario: &Scenario) -> (Vec<u8>, Truth) {
    let mut bytes = Vec::new();
    let truth = record(scenario, &mut bytes).unwrap();
    (bytes, truth)
}

fn edited(text: &str, edit: impl FnOnce(&mut Scenario)) -> Scenario {
    let mut scenario = Scenario::parse(text).unwrap();
    edit(&mut scenario);
    scenario
}

fn matrix(rows: [[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

/// Three sensors with every kind of error, at rates of their own.
const RICH: &str = r#"
    tilt_scatter_deg = 2.0
    [recording]
    seed = 7
    [accelerometer]
    rate_hz = 200
    bias = [-0.382, 0.695, -0.595]
    sensitivity = [[0.967, 0.01, -0.02], [0.005, 0.975, 0.013], [0.0, -0.008, 0.983]]
    noise = 0.03
    placement_scatter = 0.01
    [gyroscope]
    topic = "/gyro"
    rate_hz = 333
    phase_s = 0.0007
    bias = [0.02, -0.01, 0.005]
    sensitivity = [1.01, 0.99, 1.02]
    noise = 0.003
    g_sensitivity = [[1e-3, 0.0, 0.0], [0.0, -1e-3, 0.0], [2e-4, 0.0, 5e-4]]
    g2_sensitivity = [1e-4, -1e-4, 0.0]
    [secondary.highg]
    topic = "/highg/acceleration"
    rate_hz = 50
    bias = [2.368, -2.1, -0.609]
    noise = 0.35
    step = 0.4805
    range = 10.0
    [motion]
    start_s = 0.5
    end_s = 0.7
    [[pose]]
    face = "+X"
    rest_s = 4.0
    [[pose]]
    up = [0.0, -3.0, 1.0]
    heading_deg = 60.0
    rest_s = 3.0
    [[pose]]
    attitude = [0.5, 0.5, -0.5, 0.5]
    tilt_deg = 12.0
    azimuth_deg = 200.0
    rest_s = 2.0
    motion_s = 0.8
    [[pose]]
    face = "-X"
    rest_s = 5.0
"#;

#[test]
fn what_a_sensor_reads_at_rest_is_its_bias_and_its_sensitivity_times_gravity() {
    let scenario = Scenario::parse(RICH).unwrap();
    let truth = Truth::of(&scenario).unwrap();
    let readings: Vec<_> = samples(&scenario).unwrap().collect();
    assert_eq!(truth.rests.len(), 4);
    let gyroscope = truth.gyroscope.as_ref().unwrap();
    let highg = &truth.secondary[0];
    for rest in &truth.rests {
        let force = Vector3::from(rest.up) * truth.gravity;
        let squares = Vector3::from(gyroscope.g2_sensitivity.unwrap()).component_mul(&force.component_mul(&force));
        let rate = matrix(gyroscope.g_sensitivity.unwrap()) * force + squares;
        let expected = [
            (Sensor::Accelerometer, &truth.accelerometer, matrix(truth.accelerometer.sensitivity) * force, 0.01),
            (Sensor::Gyroscope, gyroscope, rate, 0.0),
            (Sensor::Secondary(0), highg, matrix(highg.sensitivity) * force, 0.0),
        ];
        for (sensor, parameters, signal, scatter) in expected {
            let inside = |r: &&Reading| r.sensor == sensor && r.stamp >= rest.start && r.stamp < rest.end;
            let values: Vec<_> = readings.iter().filter(inside).map(|reading| reading.measured).collect();
            let mean = values.iter().sum::<Vector3<f64>>() / values.len() as f64;
            // Rounding adds the variance of a uniform distribution; four standard errors, and what repeats.
            let step = if sensor == Sensor::Secondary(0) { 0.4805 } else { 0.0 };
            let std = (parameters.noise * parameters.noise + step * step / 12.0_f64).sqrt();
            let limit = 4.0 * (std * std / values.len() as f64 + scatter * scatter).sqrt();
            for axis in 0..3 {
                let expected = parameters.bias[axis] + signal[axis];
                if sensor == Sensor::Secondary(0) && expected.abs() > 8.0 {
                    continue; // saturates
                }
                let error = mean[axis] - expected;
                assert!(error.abs() < limit, "{sensor:?}, axis {axis} on {}: {error} against {limit}", rest.face);
            }
        }
    }
}

#[test]
fn a_rest_is_still_and_weighs_exactly_gravity() {
    let scenario = Scenario::parse(RICH).unwrap();
    let truth = Truth::of(&scenario).unwrap();
    for reading in samples(&scenario).unwrap() {
        let rest = truth.rests.iter().find(|rest| rest.start <= reading.stamp && reading.stamp < rest.end);
        assert_eq!(reading.pose, rest.map(|rest| rest.pose));
        if let Some(rest) = rest {
            assert_eq!(reading.rate, Vector3::zeros());
            assert!((reading.force - Vector3::from(rest.up) * truth.gravity).norm() < 1e-12);
        }
    }
}

/// Follows the attitude by the true rate alone: exponential map, midpoint of successive samples.
fn integrated(readings: &[Reading]) -> UnitQuaternion<f64> {
    readings.windows(2).fold(UnitQuaternion::identity(), |attitude, pair| {
        let seconds = pair[1].stamp.seconds_since(pair[0].stamp);
        attitude * UnitQuaternion::from_scaled_axis((pair[0].rate + pair[1].rate) * (0.5 * seconds))
    })
}

fn of(scenario: &Scenario, sensor: Sensor) -> Vec<Reading> {
    samples(scenario).unwrap().filter(|reading| reading.sensor == sensor).collect()
}

#[test]
fn the_rates_between_two_poses_add_up_to_the_turn_from_one_to_the_other() {
    let scenario = edited(RICH, |scenario| scenario.gyroscope.as_mut().unwrap().rate_hz = 4000.0);
    let readings = of(&scenario, Sensor::Gyroscope);
    let mut moved = 0;
    let legs = readings.chunk_by(|a, b| a.pose.is_some() == b.pose.is_some());
    let legs: Vec<_> = legs.collect();
    for three in legs.windows(3).filter(|three| three[1][0].pose.is_none()) {
        let first = three[0].last().unwrap();
        let last = three[2][0];
        let path: Vec<_> = [&[*first], three[1], &[last]].concat();
        // Gravity's direction in the sensor's frame turns against the sensor.
        let turned = integrated(&path).inverse_transform_vector(&first.force);
        assert!((turned - last.force).norm() < 1e-4, "{}", (turned - last.force).norm());
        moved += 1;
    }
    assert_eq!(moved, 3);
}

#[test]
fn a_motion_starts_and_ends_as_smoothly_as_a_rest() {
    let scenario = edited(RICH, |scenario| scenario.accelerometer.rate_hz = 5000.0);
    for pair in of(&scenario, Sensor::Accelerometer).windows(2) {
        assert!((pair[1].force - pair[0].force).norm() < 0.05, "{:?} at {}", pair[1].force, pair[1].stamp);
        assert!((pair[1].rate - pair[0].rate).norm() < 0.02, "{:?} at {}", pair[1].rate, pair[1].stamp);
    }
}

#[test]
fn a_recording_that_starts_and_ends_in_motion_does() {
    let readings = of(&Scenario::parse(RICH).unwrap(), Sensor::Accelerometer);
    for reading in [readings.first().unwrap(), readings.last().unwrap()] {
        assert_eq!(reading.pose, None);
        assert!(reading.rate.norm() > 0.5, "{:?}", reading.rate);
    }
}

#[test]
fn a_turn_on_a_table_changes_no_force_and_is_no_rest() {
    let scenario = edited(RICH, |scenario| scenario.pose[1].turn_deg_s = [0.0, 0.0, 30.0]);
    let truth = Truth::of(&scenario).unwrap();
    assert_eq!(truth.rests.iter().map(|rest| rest.pose).collect::<Vec<_>>(), [0, 2, 3]);
    let readings = of(&scenario, Sensor::Accelerometer);
    let turning: Vec<_> = readings.into_iter().filter(|reading| reading.pose == Some(1)).collect();
    let force = turning[0].force;
    assert!(turning.iter().all(|reading| (reading.force - force).norm() < 1e-12));
    // Three seconds, of which the half second at each end counts half.
    let angle = integrated(&turning).angle().to_degrees();
    assert!((angle - 75.0).abs() < 0.05, "{angle}");
}

#[test]
fn a_slow_creep_tilts_gravity() {
    let scenario = edited(RICH, |scenario| scenario.pose[0].turn_deg_s = [0.0, 1.0, 0.0]);
    let readings = of(&scenario, Sensor::Accelerometer);
    let creeping: Vec<_> = readings.iter().filter(|reading| reading.pose == Some(0)).collect();
    let tilt = creeping[0].force.angle(&creeping[creeping.len() - 1].force).to_degrees();
    assert!((tilt - 3.5).abs() < 0.01, "{tilt}");
}

#[test]
fn readings_are_whole_steps_inside_the_range() {
    let readings = of(&Scenario::parse(RICH).unwrap(), Sensor::Secondary(0));
    let values: Vec<_> = readings.iter().flat_map(|reading| reading.measured.as_slice().to_vec()).collect();
    assert!(values.iter().all(|value| value.abs() == 10.0 || (value / 0.4805).round() * 0.4805 == *value));
    assert!(values.iter().all(|value| value.abs() <= 10.0));
    assert!(values.contains(&10.0) && values.iter().any(|value| value.abs() < 1.0));
}

#[test]
fn the_bias_drifts_as_it_is_told() {
    let scenario = edited(RICH, |scenario| {
        scenario.accelerometer.noise = 0.0;
        scenario.accelerometer.placement_scatter = 0.0;
        scenario.accelerometer.bias_drift_per_h = [36.0, 0.0, -72.0];
    });
    let still: Vec<_> =
        of(&scenario, Sensor::Accelerometer).into_iter().filter(|reading| reading.pose == Some(0)).collect();
    let (first, last) = (still[0], still[still.len() - 1]);
    let drift = (last.measured - first.measured) / last.stamp.seconds_since(first.stamp);
    assert!((drift - Vector3::new(0.01, 0.0, -0.02)).norm() < 1e-9, "{drift}");
}

#[test]
fn faults_change_the_readings_and_not_the_sensor() {
    let sound = Scenario::parse(RICH).unwrap();
    let faulty = |fault: Fault| {
        let scenario = edited(RICH, |scenario| scenario.accelerometer.fault = fault);
        assert_eq!(Truth::of(&scenario).unwrap(), Truth::of(&sound).unwrap());
        of(&scenario, Sensor::Accelerometer)
    };
    let sound = of(&sound, Sensor::Accelerometer);

    let wrong = faulty(Fault { factor: 0.5, flipped: vec![Axis::Z], ..Fault::default() });
    for (sound, wrong) in sound.iter().zip(&wrong) {
        assert_eq!(wrong.measured, sound.measured.component_mul(&Vector3::new(0.5, 0.5, -0.5)));
    }
    let frozen = faulty(Fault { frozen: vec![Axis::Y], frozen_from_s: 2.0, ..Fault::default() });
    for (i, pair) in frozen.windows(2).enumerate() {
        let seconds = pair[1].stamp.seconds_since(frozen[0].stamp);
        assert_eq!(pair[1].measured.y == pair[0].measured.y, seconds >= 2.0, "{seconds}");
        assert_eq!(pair[1].measured.x, sound[i + 1].measured.x);
    }
    let weightless = faulty(Fault { gravity_removed: true, ..Fault::default() });
    let rests = weightless.iter().filter(|reading| reading.pose.is_some());
    // What is left is the bias, the scatter of the placements and the noise.
    let bias = Vector3::new(-0.382, 0.695, -0.595);
    assert!(rests.into_iter().all(|reading| (reading.measured - bias).amax() < 0.2));
}

#[test]
fn an_estimator_takes_the_bias_away() {
    let scenario = edited(RICH, |scenario| {
        let gyroscope = scenario.gyroscope.as_mut().unwrap();
        (gyroscope.noise, gyroscope.g_sensitivity, gyroscope.g2_sensitivity) = (0.0, None, None);
        gyroscope.fault.bias_learned_in_s = Some(1.0);
    });
    for reading in of(&scenario, Sensor::Gyroscope).iter().filter(|reading| reading.pose == Some(0)) {
        let seconds = reading.stamp.nanos() as f64 * 1e-9 - 1.7e9;
        assert!((reading.measured.x - 0.02 * (-seconds).exp()).abs() < 1e-6, "{seconds}");
    }
}

#[test]
fn a_relay_records_every_message_again() {
    let once = recorded(&Scenario::parse(RICH).unwrap()).0;
    let twice = recorded(&edited(RICH, |scenario| scenario.recording.copies = 2)).0;
    let messages = |bytes: &[u8]| mcap::MessageStream::new(bytes).unwrap().map(|m| m.unwrap().data.to_vec()).collect();
    let (once, twice): (Vec<_>, Vec<_>) = (messages(&once), messages(&twice));
    assert_eq!(twice, once.iter().flat_map(|data| [data.clone(), data.clone()]).collect::<Vec<_>>());
}

#[test]
fn the_earth_turns_where_a_latitude_is_given() {
    let scenario = edited(RICH, |scenario| scenario.latitude_deg = Some(47.0));
    let rest = of(&scenario, Sensor::Gyroscope).into_iter().find(|reading| reading.pose.is_some()).unwrap();
    assert!((rest.rate.norm() - 7.292e-5).abs() < 1e-8);
    let vertical = rest.rate.dot(&rest.force) / rest.force.norm();
    assert!((vertical / 7.292_115e-5 - 47_f64.to_radians().sin()).abs() < 1e-9);
}

#[test]
fn vibration_shakes_the_accelerometer_in_bursts() {
    let text = format!(
        "{RICH}\n[[vibration]]\namplitude = [0.0, 0.0, 2.0]\nfrequency_hz = 37.0\nburst_s = 0.2\npause_s = 0.3\n"
    );
    let still = of(&Scenario::parse(RICH).unwrap(), Sensor::Accelerometer);
    let shaken = of(&Scenario::parse(&text).unwrap(), Sensor::Accelerometer);
    let start = still[0].stamp;
    for (still, shaken) in still.iter().zip(&shaken) {
        let difference = shaken.force - still.force;
        let pausing = shaken.stamp.since(start) % 500_000_000 > 200_000_000;
        assert!(difference.xy().norm() < 1e-12 && difference.z.abs() <= 2.0 + 1e-12);
        assert!(!pausing || difference.z.abs() < 1e-12);
    }
    let power: f64 = still.iter().zip(&shaken).map(|(a, b)| (b.force - a.force).norm_squared()).sum();
    let mean = power / still.len() as f64;
    assert!((mean - 0.4 * 2.0).abs() < 0.05, "{mean}");
}

#[test]
fn one_seed_gives_one_recording_and_another_seed_another() {
    let (first, truth) = recorded(&Scenario::parse(RICH).unwrap());
    let (again, same) = recorded(&Scenario::parse(RICH).unwrap());
    let (other, _) = recorded(&edited(RICH, |scenario| scenario.recording.seed = 8));
    assert!(first == again && truth == same);
    assert!(first != other);
}

#[test]
fn one_more_sensor_changes_nothing_in_the_others() {
    let without = edited(RICH, |scenario| scenario.secondary.clear());
    assert_eq!(of(&without, Sensor::Gyroscope), of(&Scenario::parse(RICH).unwrap(), Sensor::Gyroscope));
}

#[test]
fn every_built_in_scenario_can_be_recorded() {
    for (name, text) in BUILTIN {
        let scenario = Scenario::builtin(name).unwrap();
        assert_eq!(scenario, Scenario::parse(text).unwrap());
        let mut stamps = samples(&scenario).unwrap().map(|reading| reading.stamp);
        assert!(stamps.by_ref().take(1000).is_sorted(), "{name}");
    }
}

#[test]
fn the_demo_is_small_and_shows_six_faces_and_three_again() {
    let (bytes, truth) = recorded(&Scenario::builtin("demo").unwrap());
    assert!(bytes.len() <= 300_000, "{} bytes", bytes.len());
    let faces: Vec<_> = truth.rests.iter().map(|rest| rest.face.as_str()).collect();
    assert_eq!(faces, ["+Z", "+X", "-Z", "-X", "+Y", "-Y", "+Z", "+X", "-Y"]);
    assert!(truth.rests.iter().all(|rest| rest.tilt_deg > 0.0 && rest.tilt_deg < 6.0));
}

/// Bias and scale from the means on opposite faces, in closed form, against the truth: the largest errors.
fn errors_from_opposite_faces(truth: &Truth, parameters: &TriadTruth, readings: &[Reading]) -> (f64, f64) {
    let mean = |face: &str, axis: usize| {
        let rest = truth.rests.iter().find(|rest| rest.face == face).unwrap();
        let inside = readings.iter().filter(|reading| reading.pose == Some(rest.pose));
        let values: Vec<_> = inside.map(|reading| reading.measured[axis]).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let axes = [("+X", "-X"), ("+Y", "-Y"), ("+Z", "-Z")].into_iter().enumerate();
    axes.fold((0.0, 0.0), |(bias, scale): (f64, f64), (axis, (up, down))| {
        let (up, down) = (mean(up, axis), mean(down, axis));
        let bias_error = (up + down) / 2.0 - parameters.bias[axis];
        let scale_error = (up - down) / (2.0 * truth.gravity) - parameters.sensitivity[axis][axis];
        (bias.max(bias_error.abs()), scale.max(scale_error.abs()))
    })
}

#[test]
fn the_first_sequence_of_the_thesis_can_be_calibrated_as_well_as_the_thesis_did() {
    let mut missed = 0;
    for seed in 0..20 {
        let (_, text) = BUILTIN[1];
        let scenario = edited(text, |scenario| scenario.recording.seed = seed);
        let truth = Truth::of(&scenario).unwrap();
        let readings = of(&scenario, Sensor::Accelerometer);
        let (bias, scale) = errors_from_opposite_faces(&truth, &truth.accelerometer, &readings);
        let readings = of(&scenario, Sensor::Secondary(0));
        let (highg_bias, highg_scale) = errors_from_opposite_faces(&truth, &truth.secondary[0], &readings);
        missed += usize::from(bias > 0.001 || scale > 0.001 || highg_bias > 0.019 || highg_scale > 0.002);
    }
    assert!(missed <= 1, "{missed} of 20");
}

#[test]
fn correlated_noise_has_the_same_deviation_and_a_memory() {
    let scenario = edited(BUILTIN[1].1, |scenario| scenario.accelerometer.noise_correlation_s = 0.02);
    let still: Vec<_> =
        of(&scenario, Sensor::Accelerometer).into_iter().filter(|reading| reading.pose == Some(0)).collect();
    let values: Vec<_> = still.iter().map(|reading| reading.measured.x).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    let lagged = values.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum::<f64>() / values.len() as f64;
    // At 100 Hz two samples lie half a correlation time apart.
    assert!((variance.sqrt() - 0.03).abs() < 0.002, "{}", variance.sqrt());
    assert!((lagged / variance - (-0.5_f64).exp()).abs() < 0.05, "{}", lagged / variance);
}

#[test]
fn placements_of_one_face_scatter_as_they_are_told() {
    let scenario = edited(RICH, |scenario| {
        scenario.tilt_scatter_deg = 0.0;
        scenario.accelerometer.noise = 0.0;
        scenario.accelerometer.placement_scatter = 0.02;
        scenario.pose = vec![scenario.pose[0].clone(); 200];
        scenario.pose.iter_mut().for_each(|pose| (pose.rest_s, pose.motion_s) = (0.02, Some(0.1)));
    });
    let readings = of(&scenario, Sensor::Accelerometer);
    let mut offsets: Vec<_> = readings.iter().filter(|reading| reading.pose.is_some()).collect();
    offsets.dedup_by_key(|reading| reading.pose);
    assert_eq!(offsets.len(), 200);
    let level =
        Vector3::from(scenario.accelerometer.bias) + scenario.accelerometer.sensitivity.matrix() * offsets[0].force;
    let squares: f64 = offsets.iter().map(|reading| (reading.measured - level).norm_squared()).sum();
    let scatter = (squares / 600.0).sqrt();
    assert!((scatter - 0.02).abs() < 0.002, "{scatter}");
}

#[test]
fn the_third_sequence_of_the_thesis_lies_askew_three_times() {
    let truth = Truth::of(&Scenario::builtin("thesis-sequence-3").unwrap()).unwrap();
    let askew: Vec<_> = truth.rests.iter().map(|rest| rest.tilt_deg).filter(|tilt| *tilt > 15.0).collect();
    assert_eq!((truth.rests.len(), askew.len()), (9, 3));
    assert!(askew.iter().all(|tilt| (20.0..=40.0).contains(tilt)), "{askew:?}");
}
