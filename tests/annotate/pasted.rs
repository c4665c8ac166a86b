//! The numbers that a report has to be pasted correct raw readings as `output.corrected` does.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use stillpoint::config::{Config, Layer};

use super::corrected::{Messages, messages, read};
use crate::common::Folder;
use crate::common::needs::recording;
use crate::common::page::pasted;

/// A sensor's index among samples, its name, and the topic that holds it.
type Source<'a> = (usize, &'a str, &'a str);

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator((0..3).map(|i| value[i].as_f64().unwrap()))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| value[row][column].as_f64().unwrap())
}

/// Array that stands under a name in Python.
fn array(python: &str, name: &str) -> Value {
    let (_, behind) = python.split_once(&format!("{name} = np.array(")).unwrap();
    serde_json::from_str(behind.split_once(")\n").unwrap().0).unwrap()
}

/// Reading corrected by what was pasted; `force` is the true acceleration of the same instant, m/s².
fn correct(triad: &Value, measured: Vector3<f64>, force: Vector3<f64>) -> Vector3<f64> {
    let felt = match &triad["g_sensitivity"] {
        Value::Null => Vector3::zeros(),
        rows => matrix(rows) * force,
    };
    matrix(&triad["sensitivity"]).try_inverse().unwrap() * (measured - vector(&triad["bias"]) - felt)
}

/// Values of a secondary accelerometer: the vector is the end of the message, by `geometry_msgs/Vector3Stamped`.
fn vectors(messages: &Messages, index: usize) -> BTreeMap<(u64, usize), Vector3<f64>> {
    let numbers = |data: &[u8]| {
        let numbers = data[data.len() - 24..].chunks(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()));
        Vector3::from_iterator(numbers)
    };
    messages.list.iter().map(|(log_time, data)| ((*log_time, index), numbers(data))).collect()
}

/// Compares every reading of these sensors, and returns what was pasted.
fn compare(input: &Path, map: &str, sources: &[Source<'_>]) -> Value {
    let folder = Folder::new();
    let run = |verb: &str, rest: &[&str]| {
        let arguments = [OsStr::new(verb), input.as_os_str(), "-q".as_ref(), "--set".as_ref(), map.as_ref()];
        folder.run(arguments.into_iter().chain(rest.iter().map(OsStr::new))).ok();
    };
    run("report", &["-o", "page.html"]);
    run("annotate", &["-o", "out.mcap", "--set", "output.corrected=final"]);
    let html = String::from_utf8(folder.read("page.html")).unwrap();
    let json: Value = serde_json::from_str(&pasted(&html, "JSON")).unwrap();
    let numpy = pasted(&html, "numpy");
    let imus = Config::load(&[Layer::set(map).unwrap()]).unwrap().imu;
    let file = folder.read("out.mcap");
    for &(index, sensor, topic) in sources {
        let triad = &json[sensor];
        for (key, name) in [("bias", "bias"), ("sensitivity", "S"), ("g_sensitivity", "G")] {
            if !triad[key].is_null() {
                assert_eq!(array(&numpy, &format!("{sensor}_{name}")), triad[key], "{sensor} {key}");
            }
        }
        let values = |messages| if index < 4 { read(&messages, topic, &imus) } else { vectors(&messages, index) };
        let source = values(messages(&file, topic).unwrap());
        let corrected = values(messages(&file, &format!("{topic}/stillpoint/corrected")).unwrap());
        let mut compared = 0;
        for ((log_time, _), measured) in source.iter().filter(|((_, of), _)| *of == index) {
            let force =
                source.get(&(*log_time, 0)).map(|force| correct(&json["accelerometer"], *force, Vector3::zeros()));
            let expected = correct(triad, *measured, force.unwrap_or_default());
            let written = corrected[&(*log_time, index)];
            let error = (written - expected).norm();
            assert!(error < 1e-12 * (1.0 + measured.norm()), "{sensor} at {log_time}: off by {error}");
            assert_ne!(written, *measured, "{sensor} at {log_time}: nothing is corrected");
            compared += 1;
        }
        assert!(compared > 1000, "{sensor}: {compared} readings");
    }
    json
}

const IMU: &str = "/imu/data_raw";

#[test]
fn what_the_report_of_a_simulated_session_offers_corrects_as_the_program_does() {
    let folder = Folder::with_demo();
    let sources = [(0, "accelerometer", IMU), (1, "gyroscope", IMU)];
    compare(&folder.path().join("demo.mcap"), "imu=[]", &sources);
}

#[test]
fn so_does_a_whole_matrix_with_g_sensitivity() {
    let Some(input) = recording("xsens_38_poses.ros2.mcap") else { return };
    let sources = [(0, "accelerometer", IMU), (1, "gyroscope", IMU)];
    let pasted = compare(&input, "imu=[]", &sources);
    assert!(pasted["gyroscope"]["g_sensitivity"].is_array(), "{pasted}");
    assert_ne!(pasted["accelerometer"]["sensitivity"][1][0], 0.0, "{pasted}");
}

#[test]
fn so_does_that_of_a_secondary_accelerometer() {
    let Some(input) = recording("nilspod_six_face.ros2.mcap") else { return };
    let map = r#"imu=[{topic="/imu/data_raw", secondary=[{name="highg", topic="/highg/acceleration"}]}]"#;
    let sources = [(0, "accelerometer", IMU), (1, "gyroscope", IMU), (4, "highg", "/highg/acceleration")];
    compare(&input, map, &sources);
}
