//! The segmenter finds rests where there are rests, and nowhere else.

use nalgebra::Vector3;
use proptest::prelude::*;
use stillpoint::Stamp;
use stillpoint::imu::{Sample, Sensor};
use stillpoint::still::{Config, Detector, Rest, Segmenter, State};

use crate::session::{G, GYRO_BIAS, START, Session};

/// The rests that a segmenter finds in a session.
fn found(session: &Session, config: &Config) -> Vec<Rest> {
    segmented(session, config).1
}

/// The same, with the segmenter as it is at the end.
fn segmented(session: &Session, config: &Config) -> (Segmenter, Vec<Rest>) {
    let mut segmenter = Segmenter::new(config, 0);
    let mut rests = Vec::new();
    for (sensor, sample) in &session.samples {
        segmenter.push(*sensor, sample);
        rests.extend(std::iter::from_fn(|| segmenter.next_rest()));
    }
    segmenter.finish();
    rests.extend(std::iter::from_fn(|| segmenter.next_rest()));
    (segmenter, rests)
}

/// Start and end of each rest in seconds since the first sample.
fn spans(rests: &[Rest]) -> Vec<(f64, f64)> {
    let first = Stamp::from_nanos(START);
    rests.iter().map(|rest| (rest.start.seconds_since(first), rest.end.seconds_since(first))).collect()
}

fn assert_spans(rests: &[Rest], expected: &[(f64, f64)]) {
    let found = spans(rests);
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for ((start, end), (from, until)) in found.iter().zip(expected) {
        // Never beyond the truth, and short of it by no more than a window and the patience.
        assert!(*start >= from - 0.02 && *start <= from + 0.6, "{found:?}");
        assert!(*end <= until + 0.02 && *end >= until - 0.35, "{found:?}");
    }
}

#[test]
fn rests_between_motions_are_found_from_their_first_to_their_last_moment() {
    let session =
        Session::new().rest(Vector3::z(), 5.0).motion(2.0).rest(Vector3::x(), 3.0).motion(1.0).rest(Vector3::y(), 4.0);
    let rests = found(&session, &Config::default());
    assert_spans(&rests, &[(0.0, 5.0), (7.0, 10.0), (11.0, 15.0)]);
    assert!((rests[1].accelerometer.mean - Vector3::x() * G).norm() < 0.01);
    assert!(rests.windows(2).all(|pair| pair[0].placement != pair[1].placement));
}

#[test]
fn a_recording_may_begin_in_motion() {
    let session = Session::new().motion(20.0).rest(Vector3::z(), 5.0).motion(3.0);
    assert_spans(&found(&session, &Config::default()), &[(20.0, 25.0)]);
}

#[test]
fn motion_alone_is_never_still() {
    let session = Session::new().motion(60.0);
    let mut segmenter = Segmenter::new(&Config::default(), 0);
    for (sensor, sample) in &session.samples {
        segmenter.push(*sensor, sample);
        assert_eq!(segmenter.status().state, State::Unknown);
    }
    assert_eq!(found(&session, &Config::default()), []);
}

#[test]
fn a_long_rest_is_split_and_stays_one_placement() {
    let config = Config { max_duration_s: 2.0, ..Config::default() };
    let rests = found(&Session::new().rest(Vector3::z(), 7.0), &config);
    assert_eq!(rests.len(), 4, "{:?}", spans(&rests));
    assert!(rests.iter().all(|rest| rest.placement == rests[0].placement && rest.seconds() <= 2.02));
}

#[test]
fn a_noisy_sensor_left_alone_is_one_placement_however_often_its_rest_is_split() {
    let config = Config { max_duration_s: 2.0, ..Config::default() };
    let rests = found(&Session::new().accel_noise(0.1).rest(Vector3::z(), 240.0), &config);
    assert!(rests.len() > 100, "{}", rests.len());
    assert!(
        rests.iter().all(|rest| rest.placement == 1),
        "{:?}",
        rests.iter().map(|r| r.placement).collect::<Vec<_>>()
    );
}

#[test]
fn a_slow_wander_is_several_placements_none_of_which_wanders_far() {
    let config = Config { max_duration_s: 2.0, ..Config::default() };
    let mut session = Session::new();
    for i in 0..12_000 {
        let wander = 0.3 * (f64::from(i) * 0.01 / 120.0 * std::f64::consts::TAU).sin();
        session.sample(Vector3::new(0.0, 0.0, G + wander), Vector3::zeros());
    }
    let rests = found(&session, &config);
    assert!(rests.last().unwrap().placement > 5);
    for rest in &rests {
        let first = rests.iter().find(|other| other.placement == rest.placement).unwrap();
        assert!((rest.accelerometer.mean - first.accelerometer.mean).norm() < config.max_creep + 0.05);
    }
}

#[test]
fn a_rest_after_a_gap_that_ends_in_motion_is_still_the_same_placement() {
    let session = Session::new().rest(Vector3::z(), 4.0).gap(3.0).rest(Vector3::z(), 4.0).motion(1.0);
    let rests = found(&session.rest(Vector3::x(), 4.0), &Config::default());
    assert_eq!(rests.iter().map(|rest| rest.placement).collect::<Vec<_>>(), [1, 1, 2]);
}

#[test]
fn a_slow_gyroscope_trims_by_its_own_window() {
    // Only a turn ends the rest, and a gyroscope at 10 Hz is slow to show it.
    let mut session = Session::new().motion(3.0).rest(Vector3::z(), 20.0).turn(2.0, 0.0);
    for i in 0..300 {
        session.sample(Vector3::z() * G, Vector3::z() * 0.0004 * f64::from(i));
    }
    let first = session.samples[0].1.stamp;
    session
        .samples
        .retain(|(sensor, sample)| *sensor != Sensor::Gyroscope || sample.stamp.since(first) % 100_000_000 == 0);
    let rests = found(&session, &Config::default());
    assert_eq!(rests.len(), 1, "{:?}", spans(&rests));
    let end = spans(&rests)[0].1;
    assert!((22.0..25.02).contains(&end), "{end}");
}

#[test]
fn a_gyroscope_with_a_dead_band_rests() {
    let mut session =
        Session::new().motion(3.0).rest(Vector3::z(), 6.0).motion(3.0).rest(Vector3::x(), 6.0).motion(3.0);
    for (sensor, sample) in &mut session.samples {
        if *sensor == Sensor::Gyroscope && (sample.value - Vector3::from(GYRO_BIAS)).norm() < 0.02 {
            sample.value = Vector3::zeros();
        }
    }
    assert_spans(&found(&session, &Config::default()), &[(3.0, 9.0), (12.0, 18.0)]);
}

#[test]
fn a_simulation_without_noise_rests_from_its_first_sample() {
    let mut session = Session::new();
    for i in 0..1500_i32 {
        let angle = f64::from((i - 500).clamp(0, 200)) * 0.005 * std::f64::consts::FRAC_PI_2;
        let stamp = Stamp::from_nanos(START + i64::from(i) * 10_000_000);
        let rate = if (500..700).contains(&i) { Vector3::y() * 0.01 * f64::from(i - 499) } else { Vector3::zeros() };
        for (sensor, value) in
            [(Sensor::Gyroscope, rate), (Sensor::Accelerometer, Vector3::new(angle.sin(), 0.0, angle.cos()) * G)]
        {
            session.samples.push((sensor, Sample { stamp, log_time: 0, value }));
        }
    }
    assert_spans(&found(&session, &Config::default()), &[(0.0, 5.0), (7.0, 15.0)]);
}

#[test]
fn a_gap_ends_a_rest_and_a_rest_that_goes_on_behind_it_is_the_same_placement() {
    let rests = found(&Session::new().rest(Vector3::z(), 4.0).gap(3.0).rest(Vector3::z(), 4.0), &Config::default());
    assert_spans(&rests, &[(0.0, 4.0), (7.0, 11.0)]);
    assert_eq!(rests[0].placement, rests[1].placement);
    let moved = found(&Session::new().rest(Vector3::z(), 4.0).gap(3.0).rest(Vector3::x(), 4.0), &Config::default());
    assert_ne!(moved[0].placement, moved[1].placement);
}

#[test]
fn a_rest_shorter_than_the_minimum_is_not_reported() {
    let config = Config { min_rest_s: 2.0, ..Config::default() };
    let session = Session::new().rest(Vector3::z(), 5.0).motion(1.0).rest(Vector3::x(), 1.5).motion(1.0);
    assert_spans(&found(&session, &config), &[(0.0, 5.0)]);
}

#[test]
fn a_slow_slide_is_cut_by_the_creep_gate() {
    // Half a degree a second: hardly any variance in a window, five degrees in all.
    let session = Session::new().rest(Vector3::z(), 10.0).slide(10.0, 0.5_f64.to_radians());
    let rests = found(&session, &Config::default());
    let whole = rests.iter().find(|rest| rest.seconds() > 13.0);
    assert!(whole.is_none(), "{:?}", spans(&rests));
}

#[test]
fn what_passed_for_rest_under_a_floor_that_was_too_high_is_not_quiet_by_the_floor_that_settles() {
    // Vibration below the ceiling looks like rest until real rest is seen.
    let mut session = Session::new();
    for i in 0..1500 {
        let shake = 0.2 * (f64::from(i) * 0.9).sin();
        session.sample(Vector3::new(shake, shake, G), Vector3::zeros());
    }
    let session = session.motion(1.0).rest(Vector3::x(), 20.0);
    let (segmenter, rests) = segmented(&session, &Config::default());
    let first = Stamp::from_nanos(START);
    assert!(rests.iter().any(|rest| segmenter.is_quiet(rest) && rest.seconds() > 19.0), "{:?}", spans(&rests));
    assert!(rests.iter().any(|rest| !segmenter.is_quiet(rest)), "{:?}", spans(&rests));
    for rest in &rests {
        let real = rest.start.seconds_since(first) > 15.0;
        assert_eq!(segmenter.is_quiet(rest), real, "{:?}", spans(&rests));
    }
}

#[test]
fn the_thesis_detector_finds_the_same_rests() {
    let config = Config { detector: Detector::MovingStd, ..Config::default() };
    let session = Session::new().motion(2.0).rest(Vector3::z(), 5.0).motion(2.0).rest(Vector3::x(), 3.0).motion(2.0);
    let found = spans(&found(&session, &config));
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].0 >= 2.0 && found[0].1 <= 7.02 && found[1].0 >= 9.0 && found[1].1 <= 12.02, "{found:?}");
}

#[test]
fn a_turn_at_constant_rate_is_a_rest_only_to_the_segmenter() {
    // It has no variance at all; the engine rejects it by its mean rate.
    let rests = found(&Session::new().rest(Vector3::z(), 5.0).motion(1.0).turn(5.0, 0.1), &Config::default());
    assert_eq!(rests.len(), 2);
    let rates: Vec<_> = rests.iter().map(|rest| rest.gyroscope.as_ref().unwrap().mean.z).collect();
    assert!((rates[1] - rates[0] - 0.1).abs() < 0.002, "{rates:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    /// The state between two samples is all there is: a segmenter saved and restored anywhere says the same.
    #[test]
    fn a_restored_segmenter_continues_as_if_never_interrupted(cut in 0_usize..2400) {
        let session = Session::new().rest(Vector3::z(), 5.0).motion(1.0).rest(Vector3::x(), 6.0);
        let mut whole = Segmenter::new(&Config::default(), 0);
        let mut restored = whole.clone();
        for (i, (sensor, sample)) in session.samples.iter().enumerate() {
            if i == cut {
                restored = serde_json::from_str(&serde_json::to_string(&restored).unwrap()).unwrap();
            }
            prop_assert_eq!(whole.push(*sensor, sample), restored.push(*sensor, sample));
            prop_assert_eq!(whole.next_rest(), restored.next_rest());
        }
    }
}
