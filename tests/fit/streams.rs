//! Streams that are wrong in places: stamps that stray, readings that are none, clocks that are set back, a sensor that
//! clips, axes of another frame, a recording that repeats itself. What is wrong costs itself alone, and is told once.

use nalgebra::Vector3;
use stillpoint::Stamp;
use stillpoint::engine::{Config, Engine, Event, Message};
use stillpoint::fit;
use stillpoint::imu::{AxesConfig, ImuId, Reading, Sample, Sensor, Timing};
use stillpoint::messages::triad::{Model, Status};
use stillpoint::messages::{Calibration, Triad};

use crate::common::needs::recording;
use crate::hand::{self, Hand, Held};
use crate::recognised::real_samples;

type Samples = Vec<(Sensor, Sample)>;

/// What came of a session.
#[derive(Default)]
struct Outcome {
    rests: usize,
    /// Largest number of readings of a rest.
    longest: u64,
    accelerometer: Triad,
    gyroscope: Triad,
    next_step: String,
    rejections: Vec<String>,
    logs: Vec<String>,
}

impl Outcome {
    fn of(events: Vec<Event>) -> Self {
        let mut outcome = Self::default();
        for event in events {
            match event.message {
                Message::Segment(segment) if segment.accepted => {
                    outcome.rests += 1;
                    outcome.longest = outcome.longest.max(segment.means[0].samples);
                }
                Message::Segment(segment) => outcome.rejections.push(segment.explanation),
                Message::Coverage(coverage) => outcome.next_step = coverage.next_step,
                Message::Log(log) => outcome.logs.push(log.message),
                Message::Calibration(calibration) => {
                    let Calibration { accelerometer, gyroscope, .. } = *calibration;
                    outcome.accelerometer = accelerometer.unwrap();
                    outcome.gyroscope = gyroscope.unwrap();
                }
                _ => {}
            }
        }
        outcome
    }

    fn notes(&self) -> impl Iterator<Item = &String> {
        self.accelerometer.notes.iter().chain(&self.gyroscope.notes)
    }

    fn says(&self, words: &str) -> bool {
        self.notes().chain(&self.logs).any(|text| text.contains(words))
    }

    /// Notes that speak of axes, units or the range of the gyroscope, or that its turns contradict gravity.
    fn accusations(&self) -> Vec<&String> {
        let words =
            ["flipped", "exchanged", "unit", "misses gravity", "contradict", "end of the range", "turn it from"];
        self.notes().filter(|note| words.iter().any(|word| note.contains(word))).collect()
    }
}

fn config() -> Config {
    Config { fit: fit::Config { gravity: Some(hand::G), ..fit::Config::default() }, ..Config::default() }
}

fn learn(samples: &[(Sensor, Sample)], config: Config) -> Outcome {
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    samples.iter().for_each(|(sensor, sample)| engine.push(*sensor, sample, &mut events));
    engine.finish(&mut events);
    Outcome::of(events)
}

/// Learns from samples that come as the messages of one channel do, each with both sensors.
fn learn_timed(samples: &[(Sensor, Sample)]) -> (Outcome, Vec<String>) {
    let mut timing = Timing::new(0.1);
    let mut engine = Engine::new(config());
    let mut events = Vec::new();
    let mut push = |(_, sensor, reading): (ImuId, Sensor, Reading)| {
        if let Reading::Sample(sample) = reading {
            engine.push(sensor, &sample, &mut events);
        }
    };
    for pair in samples.chunks(2) {
        let read: Vec<_> = pair.iter().map(|(sensor, s)| (ImuId::of(0), *sensor, Reading::Sample(*s))).collect();
        timing.pass(1, pair[0].1.log_time, &read, &mut push);
    }
    timing.finish(&mut push);
    engine.finish(&mut events);
    (Outcome::of(events), timing.remarks(ImuId::of(0)))
}

fn session(seed: u64, turns: usize) -> Samples {
    Hand::new(Held { placement: 0.003, ..Held::default() }, seed).rest(3.0).through_faces(turns).samples
}

/// Numbers of the samples of rests, and of the motions between them, 3 s and 1 to 2.5 s long.
fn is_moving(samples: &[(Sensor, Sample)]) -> Vec<bool> {
    let loud = |i: usize| samples[i].0 == Sensor::Gyroscope && samples[i].1.value.norm() > 0.06;
    (0..samples.len()).map(|i| loud(i - i % 2)).collect()
}

const HOUR: i64 = 3_600_000_000_000;

#[test]
fn one_wrong_stamp_among_good_ones_costs_nothing() {
    let samples = session(1, 20);
    let (right, remarks) = learn_timed(&samples);
    assert_eq!((right.gyroscope.model(), remarks.len()), (Model::Turns, 0), "{remarks:?}");
    let moving = is_moving(&samples);
    let resting = (0..samples.len()).step_by(2).filter(|&i| !moving[i]).nth(700).unwrap();
    let turning = (0..samples.len()).step_by(2).filter(|&i| moving[i]).nth(700).unwrap();
    for wrong in [HOUR, 100 * 24 * HOUR, -HOUR, -1_000_000_000_000 * 1_700_000] {
        for places in [&[resting][..], &[turning], &[resting, resting + 2], &[turning, turning + 2], &[0]] {
            let mut samples = samples.clone();
            for place in places {
                for (_, sample) in &mut samples[*place..place + 2] {
                    sample.stamp = sample.stamp.plus_nanos(wrong);
                }
            }
            let (outcome, remarks) = learn_timed(&samples);
            let context = format!("{wrong} at {places:?}: {remarks:?}");
            assert_eq!(outcome.gyroscope.turns, right.gyroscope.turns, "{context}");
            assert_eq!(outcome.rests, right.rests, "{context}");
            assert_eq!(outcome.gyroscope.status(), right.gyroscope.status(), "{context}");
            assert!(remarks.len() == 1 && remarks[0].contains("far from those around"), "{context}");
        }
    }
}

#[test]
fn an_engine_that_is_fed_a_wrong_stamp_goes_on_with_its_turns() {
    let samples = session(2, 20);
    let right = learn(&samples, config());
    for (place, wrong) in [(2000, HOUR), (2000, -HOUR), (3300, HOUR), (0, HOUR)] {
        let mut samples = samples.clone();
        samples[place..place + 2].iter_mut().for_each(|(_, s)| s.stamp = s.stamp.plus_nanos(wrong));
        let outcome = learn(&samples, config());
        // The rest or the turn that holds it, which is one of two.
        assert!(
            outcome.gyroscope.turns + 2 >= right.gyroscope.turns,
            "{wrong} at {place}: {}",
            outcome.gyroscope.turns
        );
    }
}

#[test]
fn a_clock_that_is_set_costs_the_turn_in_which_it_is_set() {
    let samples = session(3, 22);
    let right = learn(&samples, config());
    for (set, timed) in [(-HOUR, true), (-HOUR, false), (-30_000_000_000, true), (HOUR, true), (-2_000_000_000, true)] {
        let mut samples = samples.clone();
        let half = samples.len() / 4 * 2;
        samples[half..].iter_mut().for_each(|(_, s)| s.stamp = s.stamp.plus_nanos(set));
        let outcome = if timed { learn_timed(&samples).0 } else { learn(&samples, config()) };
        assert!(outcome.gyroscope.turns + 2 >= right.gyroscope.turns, "{set}: {}", outcome.gyroscope.turns);
        assert!(outcome.rests + 1 >= right.rests, "{set}: {} of {}", outcome.rests, right.rests);
    }
}

#[test]
fn readings_that_are_none_cost_themselves_and_are_told() {
    let samples = session(4, 20);
    let moving = is_moving(&samples);
    let right = learn(&samples, config());
    let values = [f64::NAN, f64::INFINITY, 1e300];
    type Which = fn(usize, bool) -> bool;
    let which: [Which; 4] = [|_, moves| moves, |i, moves| moves && i % 20 < 2, |i, _| i % 14 < 2, |i, _| i < 2];
    for sensor in [Sensor::Accelerometer, Sensor::Gyroscope] {
        for (case, is_wrong) in which.into_iter().enumerate() {
            for (axes, value) in [(1, values[0]), (3, values[1]), (3, values[2])] {
                let mut samples = samples.clone();
                let wrong =
                    samples.iter_mut().enumerate().filter(|(i, (s, _))| *s == sensor && is_wrong(*i, moving[*i]));
                wrong.for_each(|(_, (_, sample))| (0..axes).for_each(|axis| sample.value[axis] = value));
                let outcome = learn(&samples, config());
                let context = format!("{sensor:?} {case} {value}: {:?}", outcome.logs.last());
                assert!(outcome.says("are left out"), "{context}");
                assert!(outcome.rests >= right.rests, "{context}: {} of {}", outcome.rests, right.rests);
                assert_ne!(outcome.accelerometer.status(), Status::Undetermined, "{context}");
                // Turns that the gyroscope did not read are lost, others are not.
                let lost = sensor == Sensor::Gyroscope && case == 0;
                assert!(lost || outcome.gyroscope.turns + 1 >= right.gyroscope.turns, "{context}");
            }
        }
    }
}

#[test]
fn an_accelerometer_that_reads_nothing_in_motion_has_its_rests_at_every_rate() {
    for rate_hz in [25.0, 50.0, 200.0] {
        let held = Held { rate_hz, ..Held::default() };
        let mut samples = Hand::new(held, 5).rest(4.0).through_faces(14).samples;
        let moving = is_moving(&samples);
        let right = learn(&samples, config());
        for (i, (sensor, sample)) in samples.iter_mut().enumerate() {
            if moving[i] && *sensor == Sensor::Accelerometer {
                sample.value.x = f64::NAN;
            }
        }
        let outcome = learn(&samples, config());
        assert_eq!(outcome.rests, right.rests, "{rate_hz} Hz: {:?}", outcome.logs);
        let (bias, truth) = (outcome.gyroscope.bias.unwrap(), Held::default().gyro_bias);
        assert!((bias.x - truth.x).abs() < 1e-3 && (bias.y - truth.y).abs() < 1e-3, "{rate_hz} Hz: {bias:?}");
    }
}

/// Number of seconds in a text that asks for a rest.
fn seconds(text: &str) -> f64 {
    let words: Vec<&str> = text.split([' ', '.', ',', ':']).collect();
    let asked = words.windows(3).find_map(|words| match words {
        ["for", "two", "seconds"] => Some(2.0),
        ["for", count, "s"] => count.parse().ok(),
        _ => None,
    });
    asked.unwrap_or_else(|| panic!("no time in {text:?}"))
}

#[test]
fn a_rest_as_long_as_is_asked_for_is_accepted_at_every_rate() {
    for (rate_hz, min_fit_s) in [(5.0, 1.0), (10.0, 1.0), (20.0, 1.0), (100.0, 1.0), (400.0, 1.0), (50.0, 5.0)] {
        for seed in 0..4 {
            let still = stillpoint::still::Config { min_fit_s, ..Default::default() };
            let config = Config { still, ..config() };
            let held = Held { rate_hz, ..Held::default() };
            let context = format!("{rate_hz} Hz, {min_fit_s} s, seed {seed}");
            // Whoever holds it for too short a time is told for how long it must be held.
            let through = |seconds: f64| {
                let hand = Hand::new(held.clone(), seed).turn(Vector3::x() * 0.3, 4.0);
                let ups = [Vector3::z(), Vector3::x(), -Vector3::z(), -Vector3::x(), Vector3::y(), -Vector3::y()];
                let hand = ups.into_iter().fold(hand, |hand, up| hand.turn_up(up, 4.0).rest(seconds));
                learn(&hand.turn(Vector3::x() * 0.5, 4.0).samples, config.clone())
            };
            let short = through(0.7 * (min_fit_s + 20.0 / rate_hz));
            assert_eq!(short.rests, 0, "{context}");
            for text in short.rejections.iter().chain([&short.next_step]).filter(|text| text.contains(" for ")) {
                let outcome = through(seconds(text));
                let (found, why) = (outcome.rests, (&outcome.next_step, &outcome.rejections));
                assert!(found >= 6, "{context}: {text:?}, and then {found} rests, {why:?}");
            }
            assert!(short.next_step.contains(" for "), "{context}: {}", short.next_step);
        }
    }
}

/// Axes that a text says to set for a triad.
fn asked_axes(text: &str, triad: &str) -> Option<AxesConfig> {
    let (_, set) = text.split_once(&format!("set {triad} = {{ axes = "))?;
    let (names, _) = set.split_once(']')?;
    let names = names.trim_start_matches('[').split(", ").map(|name| name.trim_matches('"').to_owned());
    names.collect::<Vec<_>>().try_into().ok().and_then(|names: [String; 3]| names.try_into().ok())
}

#[test]
fn axes_of_another_frame_are_told_once_and_setting_them_makes_it_right() {
    type Change = fn(Vector3<f64>) -> Vector3<f64>;
    let changes: [(&str, Change); 7] = [
        ("x and y exchanged", |w| Vector3::new(w.y, w.x, w.z)),
        ("FRD beside FLU", |w| Vector3::new(w.x, -w.y, -w.z)),
        ("NED beside ENU", |w| Vector3::new(w.y, w.x, -w.z)),
        ("turned by 90°", |w| Vector3::new(w.y, -w.x, w.z)),
        ("a flipped axis", |w| Vector3::new(w.x, -w.y, w.z)),
        ("all axes flipped", |w| -w),
        ("axes in a circle", |w| Vector3::new(w.z, w.x, w.y)),
    ];
    for (name, change) in changes {
        let mut samples = session(6, 20);
        let of_gyroscope = |samples: &mut Samples, change: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
            let gyroscope = samples.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Gyroscope);
            gyroscope.for_each(|(_, sample)| sample.value = change(sample.value));
        };
        of_gyroscope(&mut samples, &change);
        let outcome = learn(&samples, config());
        let told = outcome.accusations();
        assert!(told.len() == 1, "{name}: {told:#?}");
        assert_ne!(outcome.gyroscope.status(), Status::Confirmed, "{name}");
        let axes = asked_axes(told[0], "gyro").unwrap_or_else(|| panic!("{name}: {told:?}"));
        of_gyroscope(&mut samples, &|value| axes.apply(&value));
        let outcome = learn(&samples, config());
        assert!(outcome.accusations().is_empty(), "{name}: {:#?}", outcome.accusations());
        assert_eq!(outcome.gyroscope.status(), Status::Confirmed, "{name}: {:?}", outcome.gyroscope.notes);
    }
}

#[test]
fn a_gyroscope_that_clips_is_told_to_and_nothing_else_is() {
    for (seconds, limit) in [(0.6, 250.0_f64), (0.45, 250.0), (0.35, 300.0)] {
        let hand = Hand::new(Held { rate_hz: 200.0, ..Held::default() }, 7).rest(3.0);
        let ups = [Vector3::x(), -Vector3::z(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z()];
        let turn = |hand: Hand, i: usize| hand.turn_up(ups[i % ups.len()], seconds).rest(3.0);
        let mut samples = (0..14).fold(hand, turn).samples;
        let limit = limit.to_radians();
        let gyroscope = samples.iter_mut().filter(|(sensor, _)| *sensor == Sensor::Gyroscope);
        gyroscope.for_each(|(_, sample)| sample.value = sample.value.map(|rate| rate.clamp(-limit, limit)));
        let outcome = learn(&samples, config());
        let told = outcome.accusations();
        assert!(told.len() == 1, "{seconds} s: {told:#?}");
        let words = format!("the end of the range, {:.0} °/s", limit.to_degrees());
        assert!(told[0].contains(&words) && told[0].contains("of 14 turns"), "{seconds} s: {told:?}");
        assert!(told[0].contains("more slowly"), "{told:?}");
    }
}

#[test]
fn a_recording_that_repeats_itself_is_told_though_its_rests_end_elsewhere() {
    for seed in 0..4 {
        let mut samples = session(seed, 6);
        let last = samples.last().unwrap().1.stamp.nanos();
        let moving = is_moving(&samples);
        assert!(!learn(&samples, config()).says("noise and all"), "seed {seed}");
        let copy = samples.clone().into_iter().enumerate().map(|(i, (sensor, mut sample))| {
            sample.stamp = sample.stamp.plus_nanos(last + 60_000_000_000);
            sample.log_time = sample.stamp.nanos() as u64;
            // What is loud in one is louder or less so in the other, so that rests begin and end a sample apart.
            if moving[i] {
                sample.value *= if i % 3 == 0 { 1.6 } else { 0.7 };
            }
            (sensor, sample)
        });
        samples.extend(copy.skip(2).collect::<Vec<_>>());
        let outcome = learn(&samples, config());
        assert!(outcome.says("noise and all"), "seed {seed}: {:#?}", outcome.logs);
        assert_ne!(outcome.gyroscope.status(), Status::Confirmed, "seed {seed}");
    }
}

#[test]
fn sensors_with_coarse_steps_and_little_noise_repeat_nothing() {
    for (accel_noise, gyro_noise) in [(0.0, 0.0), (1e-4, 1e-5), (0.0006, 0.0002), (0.002, 0.0004)] {
        for seed in 0..3 {
            let held = Held { accel_noise, gyro_noise, placement: 0.0, wobble: 0.05, ..Held::default() };
            let ups = [Vector3::x(), -Vector3::z(), Vector3::y(), Vector3::z()];
            let hand = Hand::new(held, seed).rest(6.0);
            let mut samples = (0..24).fold(hand, |hand, i| hand.turn_up(ups[i % 4], 1.5).rest(6.0)).samples;
            for (sensor, sample) in &mut samples {
                let step = if *sensor == Sensor::Accelerometer { 0.0024 } else { 0.00027 };
                sample.value = sample.value.map(|value| (value / step).round() * step);
            }
            let outcome = learn(&samples, config());
            assert!(!outcome.says("noise and all"), "{accel_noise} {gyro_noise} {seed}");
        }
    }
}

#[test]
fn real_recordings_repeat_nothing() {
    for name in [
        "nilspod_six_face.ros2.mcap",
        "xsens_38_poses.ros2.mcap",
        "mpu9150_0_19_poses.ros2.mcap",
        "mpu9150_1_20_poses.protobuf.mcap",
        "mpu6050_hand_held.ros2.mcap",
        "robot_localization_test1.mcap",
        "robot_localization_test2.mcap",
    ] {
        let Some(path) = recording(name) else { return };
        let samples = real_samples(&path);
        let once = learn(&samples, config());
        assert!(!once.says("noise and all"), "{name}");
        // Played once more, every one does that rests now and then, and long enough to tell one rest from others.
        let [first, last] = [samples.first(), samples.last()].map(|sample| sample.unwrap().1.stamp);
        let later = last.since(first) + 10_000_000_000;
        let again = samples.iter().map(|(sensor, sample)| {
            (*sensor, Sample { stamp: Stamp::from_nanos(sample.stamp.nanos() + later), ..*sample })
        });
        let twice: Vec<_> = samples.iter().copied().chain(again.skip(3)).collect();
        let rests_often = once.rests >= 4 && once.longest >= 60;
        assert!(!rests_often || learn(&twice, config()).says("noise and all"), "{name}");
    }
}
