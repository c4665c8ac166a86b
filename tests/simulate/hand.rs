//! How a hand puts a sensor down, and what a sensor's filter makes of it; the built-in session of six faces.

use std::f64::consts::{SQRT_2, TAU};

use nalgebra::{UnitQuaternion, Vector3};
use stillpoint::imu::Sensor;
use stillpoint::simulate::{Reading, Scenario, Truth, samples};

fn put_down(knock: f64, rate_hz: f64) -> Vec<Reading> {
    let scenario = format!(
        "motion = {{ duration_s = 1.5, knock = {knock} }}\nrecording.seed = 1\n[accelerometer]\nrate_hz = {rate_hz}\n\
         [[pose]]\nface = \"+Z\"\nrest_s = 1.0\n[[pose]]\nface = \"+X\"\nrest_s = 1.0\n"
    );
    samples(&Scenario::parse(&scenario).unwrap()).unwrap().collect()
}

#[test]
fn a_knock_shakes_and_rocks_a_sensor_just_before_it_rests() {
    let (soft, hard) = (put_down(0.0, 5000.0), put_down(10.0, 5000.0));
    let differ = |a: &Reading, b: &Reading| (a.force - b.force).norm() > 1e-9 || (a.rate - b.rate).norm() > 1e-9;
    let differing: Vec<f64> =
        (0..soft.len()).filter(|&at| differ(&soft[at], &hard[at])).map(|at| at as f64 / 5000.0).collect();
    // The second rest begins at 2.5 s.
    assert!(differing[0] > 2.37 && differing[0] < 2.39, "from {}", differing[0]);
    assert!(*differing.last().unwrap() < 2.5, "to {}", differing.last().unwrap());
    let peak = |of: fn(&Reading) -> Vector3<f64>| {
        soft.iter().zip(&hard).map(|(soft, hard)| (of(hard) - of(soft)).norm()).fold(0.0, f64::max)
    };
    let (force, rate) = (peak(|reading| reading.force), peak(|reading| reading.rate));
    assert!((9.5..10.5).contains(&force), "{force} m/s²");
    // 10 m/s² at the end of 5 cm at 20 Hz.
    assert!((1.3..1.7).contains(&rate), "{rate} rad/s");
}

#[test]
fn the_rates_add_up_to_the_same_turn_with_a_knock() {
    let readings = put_down(10.0, 20_000.0);
    let (first, last) = (readings.first().unwrap(), readings.last().unwrap());
    let turned = readings.windows(2).fold(UnitQuaternion::identity(), |attitude, pair| {
        let seconds = pair[1].stamp.seconds_since(pair[0].stamp);
        attitude * UnitQuaternion::from_scaled_axis((pair[0].rate + pair[1].rate) * (0.5 * seconds))
    });
    let error = turned.inverse_transform_vector(&first.force) - last.force;
    assert!(error.norm() < 2e-3, "{}", error.norm());
}

#[test]
fn a_filter_takes_off_three_decibels_at_its_bandwidth_and_delays() {
    let scenario = "recording.seed = 1\n[accelerometer]\nrate_hz = 2000\nbandwidth_hz = 40\n[[pose]]\nface = \"+Z\"\nrest_s = 3.0\n\
                    [[vibration]]\namplitude = [1.0, 0.0, 0.0]\nfrequency_hz = 40\n";
    let readings: Vec<_> = samples(&Scenario::parse(scenario).unwrap()).unwrap().skip(2000).take(2000).collect();
    let (mut sin, mut cos) = (0.0, 0.0);
    for (at, reading) in (2000..).zip(&readings) {
        let phase = TAU * 40.0 * f64::from(at) / 2000.0;
        sin += reading.measured.x * phase.sin() / 1000.0;
        cos += reading.measured.x * phase.cos() / 1000.0;
    }
    let (amplitude, phase) = (sin.hypot(cos), cos.atan2(sin));
    assert!((amplitude - 1.0 / SQRT_2).abs() < 1e-3, "{amplitude}");
    assert!((phase + TAU / 8.0).abs() < 2e-3, "{phase} rad");
    assert!(readings.iter().all(|reading| (reading.measured.z - 9.80665).abs() < 1e-9));
}

#[test]
fn the_session_of_six_faces_turns_each_of_them_up_three_times_and_clips_nothing() {
    let scenario = Scenario::builtin("six-faces").unwrap();
    let truth = Truth::of(&scenario).unwrap();
    for face in ["+X", "-X", "+Y", "-Y", "+Z", "-Z"] {
        assert_eq!(truth.rests.iter().filter(|rest| rest.face == face).count(), 3, "{face}");
    }
    let range = scenario.gyroscope.as_ref().unwrap().range.unwrap();
    let rates = samples(&scenario).unwrap().filter(|reading| reading.sensor == Sensor::Gyroscope);
    assert!(rates.map(|reading| reading.measured.amax()).fold(0.0, f64::max) < range);
}
