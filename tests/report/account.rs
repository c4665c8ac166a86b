//! An earlier calibration held to account: how often it is suspected although nothing moved, and how often what moved is
//! found, where the recording shows six faces and where it shows one.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use stillpoint::Stamp;
use stillpoint::engine::{Config, Motion, refit, rest_of};
use stillpoint::fit::Calibration;
use stillpoint::messages::segment::Reason;
use stillpoint::messages::{self, Segment, TriadMean};
use stillpoint::report::{Earlier, Findings, Outcome, Verdict, account};
use stillpoint::simulate::{Scenario, record};

use crate::common::Folder;
use crate::common::page::check;

/// Of the site; nobody tells it to the engine, which assumes standard gravity.
const GRAVITY: f64 = 9.79;
/// Scatter from placement to placement, m/s² as the fit assumes, and rad/s.
const SCATTER: f64 = 0.01;
const RATE_SCATTER: f64 = 3e-4;
/// Sessions of each line.
const SEEDS: u64 = 2000;

/// A sensor with its noise.
struct Sensor {
    accelerometer: Calibration,
    gyro: Vector3<f64>,
    scatter: f64,
    random: ChaCha8Rng,
}

impl Sensor {
    fn new(seed: u64, scatter: f64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let bias = Vector3::from_fn(|_, _| random.random_range(-0.5..0.5));
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let sensitivity = Matrix3::from_fn(|i, j| if i == j { 1.0 + 0.02 * normal() } else { 0.01 * normal() });
        let gyro = Vector3::from_fn(|_, _| 0.01 * normal());
        Self { accelerometer: Calibration { bias, sensitivity }, gyro, scatter, random }
    }

    fn normal(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| std * self.random.sample::<f64, _>(StandardNormal))
    }

    /// A rest in a direction, which it misses by two degrees.
    fn rest(&mut self, number: u32, up: Vector3<f64>) -> Segment {
        let up = (up + self.normal(0.03)).normalize();
        let off = self.normal(SCATTER * self.scatter) + self.normal(1e-3);
        let accel = self.accelerometer.measure(&(up * GRAVITY)) + off;
        let gyro = self.gyro + self.normal(RATE_SCATTER * self.scatter) + self.normal(5e-5);
        let mean = |sensor: &str, mean: Vector3<f64>, std: f64| TriadMean {
            sensor: sensor.to_owned(),
            samples: 400,
            effective_samples: 400.0,
            mean: Some(messages::Vector3 { x: mean.x, y: mean.y, z: mean.z }),
            covariance: Matrix3::from_diagonal_element(std * std).as_slice().to_vec(),
            std: None,
        };
        let start = Stamp::from_nanos(1_700_000_000_000_000_000 + i64::from(number) * 10_000_000_000);
        Segment {
            start: Some(start.into()),
            end: Some(start.plus_nanos(4_000_000_000).into()),
            accepted: true,
            reason: Reason::Accepted.into(),
            means: vec![mean("accelerometer", accel, 0.02), mean("gyroscope", gyro, 0.001)],
            placement: number,
            ..Segment::default()
        }
    }

    /// What a recording of these directions tells, with what it determines.
    fn recording(&mut self, ups: &[Vector3<f64>]) -> Findings {
        let segments: Vec<_> = ups.iter().enumerate().map(|(i, up)| self.rest(i as u32 + 1, *up)).collect();
        let rests = segments.iter().map(|segment| rest_of(segment).unwrap().0);
        let refitted = refit(rests, &[], BTreeMap::new(), &Motion::default(), Config::default());
        let mut findings = Findings::new("/imu", "/imu");
        for segment in refitted.segments {
            findings.rests.insert(stillpoint::report::nanos(&segment.start), segment);
        }
        Findings { calibration: refitted.calibration, ..findings }
    }
}

fn faces(which: &[usize]) -> Vec<Vector3<f64>> {
    let face = |i: &usize| Vector3::from_fn(|axis, _| if axis == i / 2 { [1.0, -1.0][i % 2] } else { 0.0 });
    which.iter().map(face).collect()
}

/// Sessions that are held against an earlier one of twelve placements.
fn shows() -> [(&'static str, Vec<Vector3<f64>>); 4] {
    let poses = [[1.0, 1.0, 0.3], [-1.0, 0.4, 0.8], [0.2, -0.9, 0.9], [-0.5, -0.5, -1.0]].map(Vector3::from);
    let many: Vec<_> = (0..40).map(|i| i % 6).collect();
    [
        ("one face", faces(&[4])),
        ("two faces", faces(&[4, 0])),
        ("no face, four times", poses.to_vec()),
        ("forty placements", faces(&many)),
    ]
}

/// Outcomes of accelerometer and gyroscope, after a change.
fn outcomes(seed: u64, ups: &[Vector3<f64>], scatter: f64, change: impl Fn(&mut Sensor)) -> [Outcome; 2] {
    let mut sensor = Sensor::new(seed, scatter);
    let twice: Vec<_> = (0..12).map(|i| i % 6).collect();
    let earlier = [sensor.recording(&faces(&twice))];
    change(&mut sensor);
    let now = sensor.recording(ups);
    let accounts = account(&now, &Earlier::new(&earlier, [&now])).unwrap();
    let [accelerometer, gyroscope] = accounts.as_slice() else { panic!("{accounts:?}") };
    assert_eq!((accelerometer.sensor.as_str(), gyroscope.sensor.as_str()), ("accelerometer", "gyroscope"));
    [accelerometer.outcome.clone().unwrap(), gyroscope.outcome.clone().unwrap()]
}

/// Shares of sessions in percent: suspicious or worse, and shifted, of accelerometer and gyroscope.
fn alarms(ups: &[Vector3<f64>], scatter: f64, seeds: u64, change: impl Fn(&mut Sensor) + Sync) -> [[f64; 2]; 2] {
    let halves = std::thread::scope(|scope| {
        let change = &change;
        let half = |first: u64| {
            scope.spawn(move || {
                let mut counts = [[0.0; 2]; 2];
                for seed in (first..seeds).step_by(2) {
                    for (count, outcome) in counts.iter_mut().zip(outcomes(seed, ups, scatter, change)) {
                        count[0] += f64::from(outcome.verdict >= Verdict::Suspicious);
                        count[1] += f64::from(outcome.verdict >= Verdict::Shifted);
                    }
                }
                counts
            })
        };
        [half(0), half(1)].map(|half| half.join().unwrap())
    });
    [0, 1].map(|triad| [0, 1].map(|level| 100.0 * (halves[0][triad][level] + halves[1][triad][level]) / seeds as f64))
}

#[test]
fn what_did_not_move_is_suspected_no_more_often_than_it_was_built_for() {
    let mut failures = Vec::new();
    for scatter in [1.0, 2.0] {
        for (name, ups) in shows() {
            let alarms = alarms(&ups, scatter, SEEDS, |_| {});
            println!("{scatter} × the scatter, {name:24} suspicious or worse, shifted: {alarms:?} %");
            // Twenty of 2,000 are expected at most, 34 by chance once in 500 times; 0.2 and 3.
            if alarms.iter().any(|[suspicious, shifted]| *suspicious > 1.7 || *shifted > 0.15) {
                failures.push(name);
            }
        }
    }
    assert_eq!(failures, Vec::<&str>::new());
}

#[test]
fn what_moved_is_found_even_on_one_face() {
    /// Sessions of each line.
    const SEEDS: u64 = 200;
    for (name, ups) in shows() {
        for (by, rate) in [(0.05, 0.002), (0.1, 0.004), (0.2, 0.007), (0.3, 0.01)] {
            let [accelerometer, gyroscope] = alarms(&ups, 1.0, SEEDS, |sensor| {
                sensor.accelerometer.bias.z += by;
                sensor.gyro.y += rate;
            });
            println!("{name:24} {by} m/s²: {accelerometer:?} %, {rate} rad/s: {gyroscope:?} %");
            // In between the faces, cross-axis sensitivities that the earlier calibration left out may explain as much.
            if by >= 0.2 && !name.starts_with("no face") {
                assert!(accelerometer[0] >= 95.0 && gyroscope[1] >= 99.0, "{name}");
            }
        }
    }
}

#[test]
fn one_face_tells_what_it_determines_and_whether_the_earlier_calibration_still_holds() {
    let folder = Folder::with_demo();
    folder.say("export demo.mcap --format json -o before.json").ok();
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.pose.truncate(1);
    for (name, by) in [("still.mcap", 0.0), ("moved.mcap", 0.5)] {
        scenario.accelerometer.bias[2] += by;
        let mut bytes = Vec::new();
        record(&scenario, &mut bytes).unwrap();
        folder.write(name, &bytes);
    }
    let run = folder.say("annotate still.mcap -o a.mcap --against before.json --json").ok();
    let json = run.json();
    let accelerometer = &json["imus"][0]["accelerometer"];
    assert_eq!((&accelerometer["status"], &accelerometer["bias"]), (&"UNDETERMINED".into(), &serde_json::Value::Null));
    let known = &accelerometer["combinations"][0];
    let sum = known["coefficients"].as_array().unwrap().iter().map(|factor| factor.as_f64().unwrap());
    let sum: Vec<_> = sum.collect();
    assert_eq!((sum[2], sum[11], sum.iter().filter(|factor| **factor != 0.0).count()), (1.0, 9.80665, 2), "+Z alone");
    let text = known["explanation"].as_str().unwrap();
    assert!(text.starts_with("bias z + 9.807 · scale z = ") && text.ends_with(" m/s²"), "{text}");
    // Demo: 0.310 + 9.80665 · 1.011.
    let (value, std) = (known["value"].as_f64().unwrap(), known["std"].as_f64().unwrap());
    assert!((value - 10.2245).abs() < 3.0 * std && std < 0.06, "{value} ± {std}");
    for words in ["in part", "9.807 · scale z", "inside"] {
        assert!(run.stderr.contains(words), "{words} is not in {}", run.stderr);
    }
    let of = |triad: usize| json["drift"][0]["at_rests"][triad]["verdict"].clone();
    assert_eq!([of(0), of(1)], ["inside", "inside"]);
    let exported = folder.say("export a.mcap --format json").ok().json();
    assert_eq!(&exported["imus"][0]["accelerometer"], accelerometer, "the message says the same");

    let run = folder.say("annotate moved.mcap -o b.mcap --against before.json --json").ok();
    let moved = &run.json()["drift"][0]["at_rests"];
    assert_eq!((&moved[0]["verdict"], &moved[1]["verdict"]), (&"shifted".into(), &"inside".into()), "{moved}");
    let off = moved[0]["worst"]["off"].as_f64().unwrap();
    assert!((off - 0.5).abs() < 0.1, "{off}");
    assert!(run.stderr.contains("shifted"), "{}", run.stderr);
    folder.say("report b.mcap -o b.html --against before.json").ok();
    let html = String::from_utf8(folder.read("b.html")).unwrap();
    check(&html);
    for words in ["Known in part", "9.807 · scale z", "The earlier calibration at these rests", "<b>shifted</b>"] {
        assert!(html.contains(words), "{words}");
    }
}
