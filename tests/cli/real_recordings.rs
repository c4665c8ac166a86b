//! What real recordings and bug reports taught: times that do not fit, channels one behind the other, refusals with their
//! reasons. Each kind by inputs built here, and by the input that was met, where it is at hand.

use std::collections::BTreeMap;
use std::io::Cursor;

use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};
use stillpoint::fit::Calibration;
use stillpoint::imu::Sensor;

use crate::common::{Folder, case};
use crate::session::{GYRO_BIAS, Session};

const BIAS: [f64; 3] = [0.12, -0.08, 0.20];
const SCALE: [f64; 3] = [1.012, 0.991, 1.006];
/// The gyroscope's bias in the inputs that were met.
const MET_GYRO_BIAS: [f64; 3] = [0.004, -0.006, 0.002];
/// When the first sample was measured, ns.
pub const START: i64 = 1_700_000_000_000_000_000;
pub const MAPPED: &str = r#"imu=[{topic="/imu", accel="a", gyro="g"}]"#;

/// Measured at once, ns since the start.
#[derive(Clone, Copy)]
pub struct Measured {
    pub at: i64,
    pub accel: Vector3<f64>,
    pub gyro: Vector3<f64>,
}

pub fn six_faces() -> Vec<Measured> {
    let truth = Calibration { bias: BIAS.into(), sensitivity: Matrix3::from_diagonal(&Vector3::from(SCALE)) };
    let ups = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()];
    let samples = Session::new().accelerometer(truth).rests(&ups, 4.0).samples;
    let pairs = samples.chunks_exact(2).enumerate();
    pairs
        .map(|(i, pair)| {
            assert_eq!((pair[0].0, pair[1].0), (Sensor::Gyroscope, Sensor::Accelerometer));
            Measured { at: i as i64 * 10_000_000, accel: pair[1].1.value, gyro: pair[0].1.value }
        })
        .collect()
}

pub fn vector(v: Vector3<f64>) -> Value {
    json!({"x": v.x, "y": v.y, "z": v.z})
}

/// A message of both sensors, stamped so many nanoseconds after 1970.
pub fn both(m: &Measured, stamp: i64) -> Value {
    both_at(m, stamp.div_euclid(1_000_000_000), stamp.rem_euclid(1_000_000_000))
}

fn both_at(m: &Measured, sec: i64, nanosec: i64) -> Value {
    json!({"header": {"stamp": {"sec": sec, "nanosec": nanosec}}, "a": vector(m.accel), "g": vector(m.gyro)})
}

/// A recording of JSON messages: topic, log time, what they say.
pub fn recording(messages: impl IntoIterator<Item = (&'static str, i64, Value)>) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().chunk_size(Some(20_000)).create(&mut out).unwrap();
    let mut channels = BTreeMap::new();
    for (topic, log_time, message) in messages {
        let channel_id =
            *channels.entry(topic).or_insert_with(|| writer.add_channel(0, topic, "json", &BTreeMap::new()).unwrap());
        let log_time = log_time as u64;
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, message.to_string().as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

/// On one topic, each sample stamped by its number and its true time.
fn stamped(stamp: impl Fn(usize, i64) -> i64) -> Vec<u8> {
    let messages = six_faces();
    recording(messages.iter().enumerate().map(|(i, m)| ("/imu", START + m.at, both(m, stamp(i, START + m.at)))))
}

fn near(found: &Value, expected: [f64; 3], within: f64) {
    let found: Vec<f64> = found.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < within);
    assert!(near, "{found:?} is not {expected:?}");
}

/// The calibration in a JSON result is the true one.
pub fn is_true(result: &Value, gyro_bias: [f64; 3]) {
    let imu = &result["imus"][0];
    let accel = &imu["accelerometer"];
    assert!(accel["bias"].is_array(), "no calibration: {result:#}");
    near(&accel["bias"], BIAS, 0.03);
    let scale: Vec<_> = (0..3).map(|i| accel["sensitivity"][i][i].clone()).collect();
    near(&Value::from(scale), SCALE, 0.004);
    near(&imu["gyroscope"]["bias"], gyro_bias, 0.001);
}

/// Annotated as a whole and followed to its end, a recording gives the same bytes, and the truth. What was said.
pub fn learns_the_truth(bytes: &[u8], mapping: &str, gyro_bias: [f64; 3]) -> String {
    let folder = Folder::new();
    folder.write("a.mcap", bytes);
    let set: &[&str] = if mapping.is_empty() { &[] } else { &["--set", mapping] };
    let annotate = ["annotate", "a.mcap", "-o", "batch.mcap", "--json"];
    let batch = folder.run(annotate.iter().chain(set)).ok();
    is_true(&batch.json(), gyro_bias);
    folder.run(["tail", "a.mcap", "-o", "tail.mcap"].iter().chain(set)).ok();
    assert!(folder.read("batch.mcap") == folder.read("tail.mcap"), "batch and tail differ");
    batch.stderr
}

fn met(name: &str, mapping: &str) -> Option<String> {
    let bytes = std::fs::read(case(name)?).unwrap();
    Some(learns_the_truth(&bytes, mapping, MET_GYRO_BIAS))
}

#[test]
fn readings_repeated_under_one_stamp_count_once() {
    let repeated = six_faces()
        .into_iter()
        .flat_map(|m| (0..6).map(move |k| ("/imu", START + m.at + k * 1_500_000, both(&m, START + m.at))));
    let said = learns_the_truth(&recording(repeated), MAPPED, GYRO_BIAS);
    assert!(said.contains("repeat a reading"), "{said}");
    met("01_same_stamp_x6.mcap", "");
}

#[test]
fn a_coarse_clock_serves() {
    for step in [1_000_000_000, 16_000_000, 100_000_000] {
        let said = learns_the_truth(&stamped(|_, t| t - t % step), MAPPED, GYRO_BIAS);
        assert!(said.contains("differ under one stamp"), "{step}: {said}");
    }
}

#[test]
fn a_batch_under_one_stamp_is_spread() {
    let samples = six_faces();
    let batches = samples.chunks(10).flat_map(|batch| {
        let stamp = START + batch.last().unwrap().at;
        batch.iter().enumerate().map(move |(i, m)| ("/imu", stamp + 1000 * i as i64, both(m, stamp)))
    });
    let said = learns_the_truth(&recording(batches), MAPPED, GYRO_BIAS);
    assert!(said.contains("differ under one stamp"), "{said}");
}

#[test]
fn a_clock_that_is_stuck_gives_way_to_the_log_time() {
    for stuck in [0, 1000] {
        let said = learns_the_truth(&stamped(|i, t| if i < stuck { t } else { START + 5 }), MAPPED, GYRO_BIAS);
        assert!(said.contains("log time is used"), "{said}");
    }
}

#[test]
fn counters_of_32_bits_go_on_where_they_wrap() {
    for unit in [1000, 1_000_000, 1] {
        let begin = (1_i64 << 32) * unit - 12_000_000_000_i64.min((1 << 32) * unit / 3);
        let said = learns_the_truth(&stamped(|_, t| (begin + t - START) % ((1 << 32) * unit)), MAPPED, GYRO_BIAS);
        assert!(said.contains("wrapped"), "{unit}: {said}");
    }
}

#[test]
fn nanoseconds_beyond_a_second_do_not_mislead() {
    let wide = six_faces().into_iter().map(|m| {
        let t = START + m.at;
        ("/imu", t, both_at(&m, t / 1_000_000_000, t % (1 << 32)))
    });
    let said = learns_the_truth(&recording(wide), MAPPED, GYRO_BIAS);
    assert!(said.contains("log time is used"), "{said}");
    // Not carried over: the sum is right.
    let uncarried = six_faces().into_iter().map(|m| {
        let t = START + m.at;
        ("/imu", t, both_at(&m, t / 1_000_000_000 - 1, t % 1_000_000_000 + 1_000_000_000))
    });
    learns_the_truth(&recording(uncarried), MAPPED, GYRO_BIAS);
}

#[test]
fn readings_that_come_a_little_late_are_sorted() {
    for late in [50_000_000_i64, 90_000_000] {
        let mut samples = six_faces();
        // Some are held up, as on a bus that sends them again.
        samples.sort_by_key(|m| {
            m.at + if m.at / 10_000_000 % 3 == 0 { m.at / 10_000_000 * 37 % 10 * late / 10 } else { 0 }
        });
        let first = samples.iter().map(|m| m.at).min().unwrap();
        let messages = samples
            .iter()
            .enumerate()
            .map(|(i, m)| ("/imu", START + first + i as i64 * 10_000_000, both(m, START + m.at)));
        let said = learns_the_truth(&recording(messages), MAPPED, GYRO_BIAS);
        assert!(said.contains("were sorted in"), "{said}");
    }
    met("15_out_of_order.mcap", "");
}

#[test]
fn a_wrong_stamp_here_and_there_costs_nothing() {
    const HOUR: i64 = 3_600_000_000_000;
    type Wrong = fn(i64) -> i64;
    let wrong: [Wrong; 5] = [|t| t + HOUR, |t| t + 2400 * HOUR, |t| t - HOUR, |_| 0, |_| -5_000_000_000];
    for (case, wrong) in wrong.into_iter().enumerate() {
        for places in [&[1000][..], &[460], &[1000, 1001], &[1000, 1500, 2000, 2100, 2200, 2300], &[2999]] {
            let said =
                learns_the_truth(&stamped(|i, t| if places.contains(&i) { wrong(t) } else { t }), MAPPED, GYRO_BIAS);
            assert!(said.contains("with a stamp far from those around"), "{case} {places:?}: {said}");
            assert!(!said.contains("make no sense") && !said.contains("jumped"), "{case} {places:?}: {said}");
        }
    }
}

#[test]
fn readings_that_come_too_late_are_told_by_how_much_and_sorted_in_once_that_is_set() {
    for (late, enough) in [(33, "0.4"), (45, "0.5"), (405, "4.1")] {
        // Every tenth comes as many samples late.
        let mut order: Vec<_> = six_faces().into_iter().enumerate().collect();
        order.sort_by_key(|(i, _)| 2 * if i % 10 == 3 { i + late } else { *i } + usize::from(i % 10 == 3));
        let messages = order.iter().enumerate();
        let messages = messages.map(|(i, (_, m))| ("/imu", START + i as i64 * 10_000_000, both(m, START + m.at)));
        let bytes = recording(messages);
        let said = learns_the_truth(&bytes, MAPPED, GYRO_BIAS);
        let words = format!("still.late_s = {enough}");
        assert!(said.contains(&words) && !said.contains("make no sense"), "{late}: {said}");
        let folder = Folder::new();
        folder.write("a.mcap", &bytes);
        let set = format!("still.late_s={enough}");
        let run = folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--json", "--set", MAPPED, "--set", &set]).ok();
        is_true(&run.json(), GYRO_BIAS);
        let said = run.stderr;
        assert!(said.contains("were sorted in") && !said.contains("are left out"), "{late}: {said}");
        assert!(!said.contains("dropped"), "{late}: {said}");
    }
}

#[test]
fn stamps_in_another_unit_are_told_and_the_log_times_serve() {
    type Read = fn(i64) -> i64;
    let units: [(Read, &str, &str); 5] = [
        (|t| t / 1000, "1000 times slower", "as microseconds in a field of nanoseconds"),
        (|t| t / 1_000_000, "1000 · 1000 times slower", "as milliseconds in a field of nanoseconds"),
        (|t| t / 1_000_000_000, "1000 · 1000 · 1000 times slower", "as seconds in a field of nanoseconds"),
        (|t| (t - START) * 1000 + 5, "1000 times faster", "as nanoseconds in a field of microseconds"),
        (|t| 77_000_000_000 + (t - START) / 1000, "1000 times slower", "as microseconds"),
    ];
    for (read, pace, unit) in units {
        let said = learns_the_truth(&stamped(|_, t| read(t)), MAPPED, GYRO_BIAS);
        assert!(said.contains(pace) && said.contains(unit), "no {pace:?} and {unit:?} in {said}");
        assert!(said.contains("the log times are used") && !said.contains("make no sense"), "{said}");
    }
}

#[test]
fn axes_that_are_set_are_read_in_their_order() {
    let swapped = six_faces().into_iter().map(|m| {
        let (t, g) = (START + m.at, m.gyro);
        ("/imu", t, both(&Measured { gyro: Vector3::new(-g.y, g.x, g.z), ..m }, t))
    });
    let bytes = recording(swapped);
    let set = r#"imu=[{topic="/imu", accel="a", gyro={path="g", axes=["y", "-x", "z"]}}]"#;
    learns_the_truth(&bytes, set, GYRO_BIAS);
    let folder = Folder::new();
    folder.write("a.mcap", &bytes);
    let run = folder.run([
        "annotate",
        "a.mcap",
        "--set",
        r#"imu=[{topic="/imu", accel="a", gyro={path="g", axes=["y", "y", "z"]}}]"#,
    ]);
    assert!(run.code != 0 && run.stderr.contains("each once"), "{}", run.stderr);
}

#[test]
fn an_accelerometer_and_a_gyroscope_one_behind_the_other_are_read_in_time_order() {
    let mapping = r#"imu=[{topic="/a", accel="a", gyro={topic="/g", path="g"}}]"#;
    let part =
        |topic: &'static str| six_faces().into_iter().map(move |m| (topic, START + m.at, both(&m, START + m.at)));
    for said in [
        learns_the_truth(&recording(part("/a").chain(part("/g"))), mapping, GYRO_BIAS),
        learns_the_truth(&recording(part("/g").chain(part("/a"))), mapping, GYRO_BIAS),
    ] {
        assert!(said.contains("one behind the other"), "{said}");
    }
    met("02_accel_then_gyro.mcap", "");
}

/// Messages as ROS has them, each vector with its covariance.
fn with_covariance(first: f64) -> Vec<u8> {
    recording(six_faces().into_iter().map(|m| {
        let mut message = both(&m, START + m.at);
        message["a_covariance"] = json!([first, 0, 0, 0, 0, 0, 0, 0, 0]);
        ("/imu", START + m.at, message)
    }))
}

#[test]
fn what_is_marked_as_not_measured_says_so_wherever_it_is_refused_and_can_be_used() {
    let folder = Folder::new();
    folder.write("a.mcap", &with_covariance(-1.0));
    for command in ["annotate a.mcap", "report a.mcap", "export a.mcap --format json", "tail a.mcap"] {
        let mut line: Vec<_> = command.split(' ').collect();
        line.extend(["--set", MAPPED]);
        let run = folder.run(&line);
        assert_eq!(run.code, 1, "{command}: {}", run.stderr);
        assert!(run.stderr.contains("covariance[0] is -1"), "{command}: {}", run.stderr);
        assert!(run.stderr.contains("covariance = \"ignore\""), "{command}: {}", run.stderr);
    }
    let ignoring = r#"imu=[{topic="/imu", accel="a", gyro="g", covariance="ignore"}]"#;
    learns_the_truth(&with_covariance(-1.0), ignoring, GYRO_BIAS);
    learns_the_truth(&with_covariance(0.0), MAPPED, GYRO_BIAS);
    if let Some(path) = case("05_cov_minus1.mcap") {
        let bytes = std::fs::read(&path).unwrap();
        let topic =
            if String::from_utf8_lossy(&bytes).contains("/imu/data_raw") { "/imu/data_raw" } else { "/imu/data" };
        folder.write("met.mcap", &bytes);
        let run = folder.say("annotate met.mcap");
        assert!(run.code == 1 && run.stderr.contains("covariance[0] is -1"), "{}", run.stderr);
        let topic =
            folder.say("topics met.mcap --json").ok().json()["topics"][0]["topic"].as_str().unwrap_or(topic).to_owned();
        learns_the_truth(&bytes, &format!(r#"imu=[{{topic="{topic}", covariance="ignore"}}]"#), MET_GYRO_BIAS);
    }
}

#[test]
fn bytes_behind_the_end_are_damage_and_a_second_recording_is_named() {
    let whole = stamped(|_, t| t);
    let annotated = |bytes: &[u8]| {
        let folder = Folder::new();
        folder.write("a.mcap", bytes);
        let run = folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--set", MAPPED]);
        assert_eq!(run.code, 3, "{}", run.stderr);
        folder.say("strip b.mcap -o c.mcap").ok();
        assert!(folder.read("c.mcap") == bytes);
        run.stderr
    };
    let said = annotated(&[&whole[..], &[7; 1234]].concat());
    assert!(said.contains("1234 bytes behind the end"), "{said}");
    let said = annotated(&[&whole[..], &whole[..]].concat());
    assert!(said.contains("another recording") && said.contains(&whole.len().to_string()), "{said}");
    let said = annotated(&[&whole[..], b"\n"].concat());
    assert!(said.contains("1 byte behind the end") && said.contains("1 byte is not used"), "{said}");
}

#[test]
fn a_rate_is_that_of_the_topics_own_messages() {
    let regular = six_faces().into_iter().map(|m| ("/imu", START + m.at, both(&m, START + m.at)));
    let folder = Folder::new();
    folder.write("a.mcap", &recording([("/other", 0, json!({"b": 1}))].into_iter().chain(regular)));
    let hz = |name: &str, topic: &str| {
        let topics = folder.say(&format!("topics {name} --json")).ok().json()["topics"].clone();
        topics.as_array().unwrap().iter().find(|t| t["topic"] == topic).unwrap()["hz"].clone()
    };
    assert_eq!(hz("a.mcap", "/imu"), json!(100.0));
    assert_eq!(hz("a.mcap", "/other"), Value::Null);
}

#[test]
fn mappings_that_are_offered_work_when_pasted() {
    let g = 9.80665;
    let phone = six_faces().into_iter().map(|m| {
        let gravity = m.accel.normalize();
        let user = m.accel / g - gravity;
        let message =
            json!({"rotationRate": vector(m.gyro), "gravity": vector(gravity), "userAcceleration": vector(user)});
        ("/motion", START + m.at, message)
    });
    let rotation = six_faces()
        .into_iter()
        .map(|m| ("/motion", START + m.at, json!({"rotation_rate": vector(m.gyro), "acceleration": vector(m.accel)})));
    let pair = six_faces().into_iter().flat_map(|m| {
        [("/phone/gyroscope", START + m.at, vector(m.gyro)), ("/phone/accelerometer", START + m.at, vector(m.accel))]
    });
    for bytes in [recording(phone), recording(rotation), recording(pair)] {
        let folder = Folder::new();
        folder.write("a.mcap", &bytes);
        let topics = folder.say("topics a.mcap --json").ok().json();
        let offered = topics["topics"].as_array().unwrap().iter().find_map(|t| t["configuration"].as_str());
        let offered = offered.unwrap_or_else(|| panic!("nothing is offered: {topics:#}"));
        folder.write("c.toml", offered.as_bytes());
        is_true(&folder.say("annotate a.mcap -o b.mcap -c c.toml --json").ok().json(), GYRO_BIAS);
    }
}

#[test]
fn what_is_no_recording_is_told_apart() {
    let folder = Folder::new();
    for (bytes, word) in [
        (&b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n"[..], "git lfs pull"),
        (b"\x28\xb5\x2f\xfd\x04\x00\x00\x00\x00\x00", "zstd -d"),
        (b"\x89MCAP0\r\r\n\x01\x19\x00\x00", "binary"),
        (b"\x89MCAP0\n\x01\x19\x00\x00\x00", "binary"),
        (b"#ROSBAG V2.0\n", "mcap convert"),
    ] {
        folder.write("a.mcap", bytes);
        folder.refuses("annotate a.mcap -o b.mcap", 1, &[word]);
    }
}
