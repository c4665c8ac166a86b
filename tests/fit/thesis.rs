//! The thesis' own sessions, simulated with its known parameters.
//!
//! `cargo test --test fit thesis -- --nocapture` prints the errors beside the Cramér–Rao bound.

use nalgebra::Vector3;
use stillpoint::engine::{Config, Engine, Event, Message, Secondary};
use stillpoint::fit;
use stillpoint::imu::Preset;
use stillpoint::messages::segment::Reason;
use stillpoint::messages::{Calibration, Segment, Triad, Vector3 as Numbers};
use stillpoint::simulate::{Scenario, TriadTruth, Truth, samples};

fn learn(scenario: &Scenario) -> (Truth, Vec<Event>) {
    let truth = Truth::of(scenario).unwrap();
    let secondary = truth
        .secondary
        .iter()
        .map(|triad| Secondary {
            name: triad.sensor.clone(),
            topic: triad.topic.clone(),
            preset: Some(Preset::named("adxl375").unwrap()),
            ..Secondary::default()
        })
        .collect();
    let fit = fit::Config { gravity: Some(truth.gravity), ..fit::Config::default() };
    let mut engine = Engine::new(Config { secondary, fit, ..Config::default() });
    let mut events = Vec::new();
    for reading in samples(scenario).unwrap() {
        let log_time = reading.stamp.nanos() as u64;
        let sample = stillpoint::imu::Sample { stamp: reading.stamp, log_time, value: reading.measured };
        engine.push(reading.sensor, &sample, &mut events);
    }
    engine.finish(&mut events);
    (truth, events)
}

fn last_calibration(events: &[Event]) -> Calibration {
    let found = events.iter().rev().find_map(|event| match &event.message {
        Message::Calibration(calibration) => Some(calibration),
        _ => None,
    });
    *found.unwrap().clone()
}

fn segments(events: &[Event]) -> Vec<&Segment> {
    let segment =
        |event| if let &Event { message: Message::Segment(ref segment), .. } = event { Some(segment) } else { None };
    events.iter().filter_map(segment).collect()
}

fn vector(v: &Option<Numbers>) -> Vector3<f64> {
    let v = v.as_ref().unwrap();
    Vector3::new(v.x, v.y, v.z)
}

/// Errors of bias and scale.
fn errors(triad: &Triad, truth: &TriadTruth) -> (Vector3<f64>, Vector3<f64>) {
    let scale = Vector3::from_fn(|i, _| truth.sensitivity[i][i]);
    (vector(&triad.bias) - Vector3::from(truth.bias), vector(&triad.scale) - scale)
}

/// Mean squares over seeds and axes, and how often the thesis' printed errors were kept to.
#[derive(Default)]
struct Score {
    bias: f64,
    scale: f64,
    within: u32,
}

impl Score {
    fn add(&mut self, errors: (Vector3<f64>, Vector3<f64>), bias: f64, scale: f64) -> bool {
        self.bias += errors.0.norm_squared() / 3.0;
        self.scale += errors.1.norm_squared() / 3.0;
        // The thesis prints three digits.
        let within = errors.0.amax() < bias + 5e-4 && errors.1.amax() < scale + 5e-4;
        self.within += u32::from(within);
        within
    }
}

#[test]
fn sequence_1_is_recovered_within_the_errors_that_the_thesis_prints() {
    const SEEDS: u64 = 20;
    let (mut mpu, mut highg) = (Score::default(), Score::default());
    let (mut bound, mut bound_highg, mut both, mut gravity) = (0.0, 0.0, 0, 0.0);
    for seed in 1..=SEEDS {
        let mut scenario = Scenario::builtin("thesis-sequence-1").unwrap();
        scenario.recording.seed = seed;
        let (truth, events) = learn(&scenario);
        let calibration = last_calibration(&events);
        let first = errors(&calibration.accelerometer.clone().unwrap(), &truth.accelerometer);
        let second = errors(&calibration.secondary[0], &truth.secondary[0]);
        let kept = [mpu.add(first, 0.001, 0.001), highg.add(second, 0.019, 0.002)];
        both += u32::from(kept == [true; 2]);
        // σ/√(2N) for N samples a face and white noise (and, of the coarse converter, its uniform rounding error).
        let samples_a_face =
            truth.rests.iter().map(|rest| (rest.end.seconds_since(rest.start) * 100.0).round()).sum::<f64>() / 6.0;
        bound = truth.accelerometer.noise / (2.0 * samples_a_face).sqrt();
        let step: f64 = 0.4805;
        bound_highg = (truth.secondary[0].noise.powi(2) + step * step / 12.0).sqrt() / (2.0 * samples_a_face).sqrt();
        gravity = truth.gravity;
    }
    let rms = |sum: f64| (sum / SEEDS as f64).sqrt();
    for (name, score, bound) in [("MPU", &mpu, bound), ("high-g", &highg, bound_highg)] {
        println!(
            "{name}: bias error {:.5} m/s² = {:.2} × Cramér–Rao, scale error {:.6} = {:.2} × Cramér–Rao, {} of {SEEDS} seeds within the thesis' errors",
            rms(score.bias),
            rms(score.bias) / bound,
            rms(score.scale),
            rms(score.scale) * gravity / bound,
            score.within,
        );
    }
    assert!(both >= 19, "{both} of {SEEDS} seeds");
    assert!(rms(mpu.bias) < 1.3 * bound && rms(highg.bias) < 1.3 * bound_highg);
}

#[test]
fn sequence_3_rejects_the_misaligned_rests_each_with_its_tilt_and_a_question() {
    let scenario = Scenario::builtin("thesis-sequence-3").unwrap();
    let (truth, events) = learn(&scenario);
    let misaligned: Vec<_> = truth.rests.iter().filter(|rest| rest.tilt_deg > 15.0).collect();
    assert_eq!(misaligned.len(), 3);
    for rest in misaligned {
        let middle = (rest.start.nanos() + rest.end.nanos()) / 2;
        let nanos = |stamp: &Option<prost_types::Timestamp>| {
            stamp.map_or(0, |t| t.seconds * 1_000_000_000 + i64::from(t.nanos))
        };
        let last = segments(&events)
            .into_iter()
            .rfind(|segment| nanos(&segment.start) <= middle && middle <= nanos(&segment.end))
            .expect("the rest is found");
        assert_eq!(last.reason(), Reason::Tilted, "{}", last.explanation);
        assert!((last.tilt_deg.unwrap() - rest.tilt_deg).abs() < 1.0, "{:?} {}", last.tilt_deg, rest.tilt_deg);
        assert!(last.explanation.contains("was the sensor lying flat?"), "{}", last.explanation);
    }
    let calibration = last_calibration(&events);
    let (bias, scale) = errors(&calibration.accelerometer.clone().unwrap(), &truth.accelerometer);
    assert!(bias.amax() < 0.03 && scale.amax() < 0.003, "{bias} {scale}");
}
