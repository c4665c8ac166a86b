//! Units and axes told by turns and by gravity, over hundreds of sessions in right and in wrong ones: what is wrong is named
//! where a turn lies between two rests, nothing right is accused, and nothing wrong is confirmed.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand::RngExt;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use stillpoint::engine::{Config, Engine, Message, UnitFinding, UnitProbe, unit_of_gravity};
use stillpoint::imu::{AccelUnit, RateUnit, Sample, Sensor};
use stillpoint::messages::triad::Status;
use stillpoint::report::{Findings, Weight, weight};
use stillpoint::simulate::{Scenario, samples};

use crate::common::needs::{randomness, recording};
use crate::hand::{Hand, Held};

type Samples = Vec<(Sensor, Sample)>;

/// Words by which a unit or an axis is called wrong.
const ACCUSES: [&str; 8] =
    ["unit = \"deg/s\"", "unit = \"g\"", "as if", "it is in", "raw counts", "exchanged", "flipped", "faster than any"];

/// What came of a session.
struct Outcome {
    /// What the terminal shows: the next step, and the notes on the triads.
    shown: Vec<String>,
    /// All that was said at any time, in the log and of each rest.
    said: Vec<String>,
    /// Of the gyroscope, at any time.
    confirmed: bool,
    accel_confirmed: bool,
    /// Whether the last calibration calls its unit unconfirmed.
    unconfirmed: bool,
}

impl Outcome {
    fn shows(&self, word: &str) -> bool {
        self.shown.iter().any(|text| text.contains(word))
    }

    fn says(&self, word: &str) -> bool {
        self.said.iter().any(|text| text.contains(word))
    }

    fn accusations(&self) -> Vec<&String> {
        accusations(self.said.iter().chain(&self.shown))
    }
}

fn accusations<'a>(texts: impl IntoIterator<Item = &'a String>) -> Vec<&'a String> {
    texts.into_iter().filter(|text| ACCUSES.iter().any(|word| text.contains(word))).collect()
}

fn learn(samples: &[(Sensor, Sample)], config: Config) -> Outcome {
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    for (sensor, sample) in samples {
        engine.push(*sensor, sample, &mut events);
    }
    engine.finish(&mut events);
    let (shown, said) = (Vec::new(), Vec::new());
    let mut outcome = Outcome { shown, said, confirmed: false, accel_confirmed: false, unconfirmed: true };
    let mut findings = Findings::new("/imu", "/imu");
    for event in &events {
        findings.note(event);
    }
    outcome.shown.push(findings.next_step());
    let notes = findings.triads().flat_map(|triad| triad.notes.clone());
    outcome.shown.extend(notes.filter(|note| weight(note) == Weight::Serious));
    for event in events {
        match event.message {
            Message::Segment(segment) => outcome.said.push(segment.explanation),
            Message::Coverage(coverage) => outcome.said.push(coverage.next_step),
            Message::Log(log) => outcome.said.push(log.message),
            Message::Calibration(calibration) => {
                let confirmed = |triad: &Option<stillpoint::messages::Triad>| {
                    triad.as_ref().is_some_and(|triad| triad.status() == Status::Confirmed)
                };
                outcome.confirmed |= confirmed(&calibration.gyroscope);
                outcome.accel_confirmed |= confirmed(&calibration.accelerometer);
                let notes = calibration.gyroscope.iter().flat_map(|triad| &triad.notes);
                outcome.unconfirmed = notes.into_iter().any(|note| note.contains("is unconfirmed"));
                let triads = calibration.accelerometer.into_iter().chain(calibration.gyroscope);
                outcome.said.extend(triads.flat_map(|triad| triad.notes));
            }
            _ => {}
        }
    }
    outcome
}

/// What `topics` says of both units, which looks no further than it needs to.
fn remarks(samples: &[(Sensor, Sample)]) -> Vec<String> {
    let mut probe = UnitProbe::new(&Config::default().still);
    for (sensor, sample) in samples {
        probe.push(*sensor, sample);
        if *sensor == Sensor::Gyroscope && probe.is_settled(RateUnit::default()) {
            break;
        }
    }
    probe.finish();
    let mut said = Vec::new();
    if let UnitFinding::Other(text, _) = probe.gyroscope(RateUnit::default()) {
        said.push(text);
    }
    let gravity = probe.gravity().map(|gravity| unit_of_gravity(gravity, AccelUnit::default()));
    if let Some(UnitFinding::Other(text, _)) = gravity {
        said.push(text);
    }
    said
}

fn changed(samples: &Samples, of: Sensor, how: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Samples {
    let change = |(sensor, sample): &(Sensor, Sample)| {
        let value = if *sensor == of { how(sample.value) } else { sample.value };
        (*sensor, Sample { value, ..*sample })
    };
    samples.iter().map(change).collect()
}

/// A sensor as they are: quiet and loud, slow and fast.
fn any_sensor(rng: &mut ChaCha8Rng) -> Held {
    let vector = |rng: &mut ChaCha8Rng, size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
    let gyro_bias = vector(rng, 0.02);
    let accel_bias = vector(rng, 0.3);
    let skew = Matrix3::from_fn(|_, _| rng.random_range(-0.02..0.02));
    Held {
        rate_hz: [25.0, 50.0, 100.0, 200.0][rng.random_range(0..4)],
        accel_noise: 10_f64.powf(rng.random_range(-2.5..-1.2)),
        gyro_noise: 10_f64.powf(rng.random_range(-4.2..-2.2)),
        gyro_bias,
        accel_bias,
        gyro_sensitivity: Matrix3::identity() + skew,
        placement: 0.005,
        ..Held::default()
    }
}

/// Rests with turns between them by which gravity turns by 30° and more, at most by so much.
fn turned(rng: &mut ChaCha8Rng, most: f64) -> Samples {
    const LEAST: f64 = PI / 6.0;
    let mut hand = Hand::new(any_sensor(rng), rng.random()).rest(rng.random_range(2.0..4.0));
    for _ in 0..rng.random_range(1..6) {
        // About an axis that is not upright, as far as a hand turns.
        let up = hand.up();
        let (axis, angle) = loop {
            let axis = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
            let across = axis - up * axis.dot(&up);
            let axis = (across.normalize() + up * rng.random_range(-0.4..0.4)).normalize();
            let angle = rng.random_range(LEAST..most);
            let after = Rotation3::from_axis_angle(&Unit::new_normalize(axis), angle) * up;
            if across.norm() > 0.5 && after.angle(&up) >= LEAST {
                break (axis, angle);
            }
        };
        hand = hand.turn(axis * angle, angle / rng.random_range(0.3..2.0)).rest(rng.random_range(2.0..4.0));
    }
    hand.samples
}

/// Rests without a turn by which gravity turns: tables that spin, walks, drives, streams that freeze.
fn level(rng: &mut ChaCha8Rng) -> Samples {
    let mut hand = Hand::new(any_sensor(rng), rng.random()).rest(rng.random_range(2.0..4.0));
    let kind = rng.random_range(0..4);
    for _ in 0..rng.random_range(2..5) {
        let up = hand.up();
        hand = match kind {
            // A turntable.
            0 => hand.turn(up * rng.random_range(6.0..30.0), rng.random_range(8.0..19.0)),
            // A walk: it sways, and comes back to where it was.
            1 => {
                let seconds = rng.random_range(4.0..15.0);
                hand.turn(up * rng.random_range(-2.0..2.0), seconds).bump(seconds / 3.0)
            }
            // A drive.
            2 => hand.bump(rng.random_range(2.0..6.0)).turn(up * rng.random_range(-1.5..1.5), 4.0),
            _ => hand.turn(up * rng.random_range(-3.0..3.0), 3.0),
        };
        hand = hand.rest(rng.random_range(2.0..4.0));
    }
    let mut samples = hand.samples;
    if kind == 3 {
        // It freezes in motion, and goes on.
        let (from, until) = (samples.len() / 3, samples.len() / 3 + samples.len() / 20);
        for i in from..until {
            let earlier = samples[i - 2].1.value;
            samples[i].1.value = earlier;
        }
    }
    samples
}

const WRONG_RATES: [(&str, f64, &str); 5] = [
    ("deg/s", 180.0 / PI, "unit = \"deg/s\""),
    ("mrad/s", 1000.0, "mrad/s"),
    ("counts of ±2000 °/s", 16.4 * 180.0 / PI, "16.4 a °/s"),
    ("counts of ±250 °/s", 131.0 * 180.0 / PI, "131.0 a °/s"),
    ("deg/s", 180.0 / PI, "unit = \"deg/s\""),
];

const WRONG_FORCES: [(&str, f64, &str); 4] = [
    ("g", 1.0 / 9.80665, "unit = \"g\""),
    ("mg", 1000.0 / 9.80665, "in mg"),
    ("counts of ±4 g", 8192.0 / 9.80665, "8192 a g"),
    ("counts of ±2 g", 16384.0 / 9.80665, "16384 a g"),
];

#[test]
fn units_are_named_where_turns_tell_them_and_nothing_right_is_accused() {
    let wrong: Vec<_> = WRONG_RATES
        .map(|wrong| (Sensor::Gyroscope, wrong))
        .into_iter()
        .chain(WRONG_FORCES.map(|wrong| (Sensor::Accelerometer, wrong)))
        .collect();
    let (mut shown, mut remarked, mut right) = (0, 0, 0);
    let mut misses = Vec::new();
    const SESSIONS: u64 = 450;
    for seed in 0..SESSIONS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Half of them with small turns alone.
        let session = turned(&mut rng, if seed % 2 == 0 { 0.9 } else { PI * 0.9 });
        let outcome = learn(&session, Config::default());
        assert!(outcome.accusations().is_empty(), "{seed}: accused: {:#?}", outcome.accusations());
        let said = remarks(&session);
        assert!(accusations(&said).is_empty(), "{seed}: accused: {said:#?}");
        right += u64::from(!outcome.unconfirmed);
        let (sensor, (unit, factor, word)) = wrong[seed as usize % wrong.len()];
        let misread = changed(&session, sensor, |value| value * factor);
        let outcome = learn(&misread, Config::default());
        let confirmed = if sensor == Sensor::Gyroscope { outcome.confirmed } else { outcome.accel_confirmed };
        assert!(!confirmed, "{seed}: {unit}: confirmed");
        let said = remarks(&misread);
        let named = (outcome.shows(word), said.iter().any(|text| text.contains(word)));
        shown += u64::from(named.0);
        remarked += u64::from(named.1);
        if named != (true, true) {
            misses.push(format!("{seed}: {unit}: {named:?}: {:#?} {said:#?}", outcome.shown));
        }
    }
    misses.iter().for_each(|miss| println!("missed: {miss}"));
    println!(
        "of {SESSIONS} wrong units annotate shows {shown}, topics {remarked}; of right ones {right} are confirmed by turns"
    );
    assert!(100 * shown >= 95 * SESSIONS, "annotate shows {shown} of {SESSIONS}");
    assert!(100 * remarked >= 95 * SESSIONS, "topics says {remarked} of {SESSIONS}");
    assert!(100 * right >= 90 * SESSIONS, "{right} of {SESSIONS}");
}

#[test]
fn where_nothing_turns_over_the_unit_is_unconfirmed() {
    let mut rng = randomness();
    for _ in 0..70 {
        let session = level(&mut rng);
        let outcome = learn(&session, Config::default());
        assert!(outcome.accusations().is_empty(), "accused: {:#?}", outcome.accusations());
        assert!(!outcome.confirmed, "nothing tells its unit: {:#?}", outcome.said);
        for factor in [180.0 / PI, 1000.0] {
            let outcome = learn(&changed(&session, Sensor::Gyroscope, |rate| rate * factor), Config::default());
            assert!(!outcome.confirmed, "confirmed in a wrong unit: {:#?}", outcome.said);
        }
        // A unit that is set is not asked for.
        let config = Config { gyro_unit: Some(RateUnit::RadiansPerSecond), ..Config::default() };
        let outcome = learn(&session, config);
        assert!(!outcome.says("unconfirmed") && outcome.accusations().is_empty(), "{:#?}", outcome.said);
    }
}

#[test]
fn a_turn_about_a_level_axis_of_many_revolutions_is_no_unit() {
    let mut rng = randomness();
    for _ in 0..40 {
        let mut hand = Hand::new(any_sensor(&mut rng), rng.random()).rest(3.0);
        for _ in 0..3 {
            let up = hand.up();
            let across = up.cross(&Vector3::ith(up.iamin(), 1.0)).normalize();
            let turns = rng.random_range(2.0..16.0) * 2.0 * PI;
            hand = hand.turn(across * turns, (turns / 4.0).min(18.0)).rest(3.0);
        }
        let outcome = learn(&hand.samples, Config::default());
        assert!(outcome.accusations().is_empty(), "accused: {:#?}", outcome.said);
    }
}

#[test]
fn simulated_sessions_in_right_units_are_not_accused() {
    for name in ["demo", "six-faces", "thesis-sequence-1", "thesis-sequence-3", "rate-table"] {
        let mut scenario = Scenario::builtin(name).unwrap();
        for seed in 0..2 {
            scenario.recording.seed = seed;
            let readings = samples(&scenario).unwrap().map(|reading| {
                let log_time = reading.stamp.nanos() as u64;
                (reading.sensor, Sample { stamp: reading.stamp, log_time, value: reading.measured })
            });
            let session: Samples =
                readings.filter(|(sensor, _)| matches!(sensor, Sensor::Accelerometer | Sensor::Gyroscope)).collect();
            let outcome = learn(&session, Config::default());
            assert!(outcome.accusations().is_empty(), "{name} {seed}: {:#?}", outcome.accusations());
            let degrees = changed(&session, Sensor::Gyroscope, |rate| rate.map(f64::to_degrees));
            let outcome = learn(&degrees, Config::default());
            assert!(!outcome.confirmed, "{name}: {:#?}", outcome.said);
            // A rate table rests before all of its turns and after them.
            assert!(name == "rate-table" || outcome.shows("unit = \"deg/s\""), "{name}: {:#?}", outcome.said);
        }
    }
}

#[test]
fn axes_that_are_exchanged_are_named() {
    let mut rng = randomness();
    type Change = fn(Vector3<f64>) -> Vector3<f64>;
    let cases: [(Sensor, Change, &str); 5] = [
        (Sensor::Gyroscope, |w| Vector3::new(w.y, w.x, w.z), "gyroscope's x and y axes are exchanged"),
        (Sensor::Accelerometer, |a| Vector3::new(a.x, a.z, a.y), "accelerometer's y and z axes are exchanged"),
        (Sensor::Gyroscope, |w| Vector3::new(w.x, -w.y, w.z), "gyroscope's y axis is flipped"),
        (Sensor::Gyroscope, |w| Vector3::new(w.z, w.x, w.y), "are the gyroscope's y, z, x"),
        (Sensor::Accelerometer, |a| Vector3::new(-a.x, a.y, a.z), "accelerometer's x axis is flipped"),
    ];
    let mut missed = Vec::new();
    for (sensor, change, word) in cases {
        for _ in 0..4 {
            let session = Hand::new(any_sensor(&mut rng), rng.random()).rest(3.0).through_faces(9).samples;
            let outcome = learn(&changed(&session, sensor, change), Config::default());
            if !outcome.says(word) {
                missed.push(format!("no {word:?} in {:#?}", outcome.said));
            }
        }
    }
    // In another unit, too.
    let session = Hand::new(any_sensor(&mut rng), rng.random()).rest(3.0).through_faces(9).samples;
    let both = changed(&session, Sensor::Gyroscope, |w| Vector3::new(w.y, w.x, w.z).map(f64::to_degrees));
    let outcome = learn(&both, Config::default());
    if !(outcome.says("unit = \"deg/s\"") && outcome.says("x and y axes are exchanged")) {
        missed.push(format!("{:#?}", outcome.said));
    }
    // A sensor of chance may be sampled too slowly for how it was turned.
    assert!(missed.len() <= 2, "{missed:#?}");
}

#[test]
fn one_quarter_turn_tells_degrees_however_slow_and_quiet() {
    for (seconds, noise) in [(0.8, 2e-4), (3.0, 2e-4), (9.0, 2e-4), (9.0, 5e-3), (16.0, 1e-4)] {
        let held = Held { gyro_noise: noise, gyro_bias: Vector3::new(4e-4, -6e-4, 2e-4), ..Held::default() };
        let session = Hand::new(held, 3).rest(4.0).turn(Vector3::x() * FRAC_PI_2, seconds).rest(4.0).samples;
        assert!(learn(&session, Config::default()).accusations().is_empty());
        let degrees = changed(&session, Sensor::Gyroscope, |rate| rate.map(f64::to_degrees));
        let outcome = learn(&degrees, Config::default());
        assert!(outcome.shows("unit = \"deg/s\""), "{seconds} s: {:#?}", outcome.said);
        // Set wrongly, it is said, too.
        let config = Config { gyro_unit: Some(RateUnit::DegreesPerSecond), ..Config::default() };
        let halved = changed(&session, Sensor::Gyroscope, |rate| rate.map(f64::to_radians));
        let outcome = learn(&halved, config);
        assert!(!outcome.confirmed, "{:#?}", outcome.said);
    }
}

#[test]
fn real_sessions_in_wrong_units_are_named() {
    let mut seen = 0;
    for name in ["nilspod_six_face.ros2.mcap", "xsens_38_poses.ros2.mcap", "mpu9150_0_19_poses.ros2.mcap"] {
        let Some(path) = recording(name) else { continue };
        let session = super::recognised::real_samples(&path);
        seen += 1;
        assert!(learn(&session, Config::default()).accusations().is_empty(), "{name}");
        for (unit, factor, word) in WRONG_RATES {
            let outcome = learn(&changed(&session, Sensor::Gyroscope, |rate| rate * factor), Config::default());
            assert!(outcome.shows(word) && !outcome.confirmed, "{name} in {unit}: {:#?}", outcome.said);
        }
        for (unit, factor, word) in WRONG_FORCES {
            let outcome = learn(&changed(&session, Sensor::Accelerometer, |force| force * factor), Config::default());
            assert!(outcome.shows(word) && !outcome.accel_confirmed, "{name} in {unit}: {:#?}", outcome.said);
        }
    }
    println!("{seen} real sessions");
}
