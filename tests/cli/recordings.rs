//! Real recordings through the program, against results of programs that are not ours (`data/README.md` beside them).

use std::ffi::OsStr;
use std::path::Path;

use crate::common::needs::{data, recording};
use crate::common::{Folder, Run};
use serde_json::Value;

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| value[i].as_f64().unwrap())
}

fn diagonal(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|i| value[i][i].as_f64().unwrap())
}

fn assert_close(what: &str, found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    let off = found.iter().zip(expected).any(|(found, expected)| (found - expected).abs() > tolerance);
    assert!(!off, "{what}: {found:?}, expected {expected:?} ± {tolerance}");
}

#[test]
fn a_six_face_session_agrees_with_the_references() {
    let Some(input) = recording("nilspod_six_face.ros2.mcap") else { return };
    let folder = Folder::new();
    let setting = r#"imu=[{topic="/imu/data_raw", secondary=[{name="highg", topic="/highg/acceleration"}]}]"#;
    let arguments = ["annotate".as_ref(), input.as_os_str(), "-o".as_ref(), "out.mcap".as_ref()];
    let run = folder.run(arguments.into_iter().chain(["--json", "--set", setting].map(AsRef::as_ref))).ok();
    let result = run.json();
    assert_eq!(result["rests"]["found"], 13);
    let imu = &result["imus"][0];
    assert_close("bias", vector(&imu["accelerometer"]["bias"]), [0.5350, -0.6170, 0.3982], 0.005);
    assert_close("scale", diagonal(&imu["accelerometer"]["sensitivity"]), [0.9969, 1.0028, 1.0236], 5e-4);
    assert_close("gyroscope", vector(&imu["gyroscope"]["bias"]), [-0.01047, -0.00639, 0.00102], 2e-4);
    let highg = &imu["secondary"][0];
    assert_eq!(highg["sensor"], "highg");
    assert_close("high-g bias", vector(&highg["bias"]), [-7.946, 0.185, -1.146], 0.02);
    assert_close("high-g scale", diagonal(&highg["sensitivity"]), [0.942, 0.970, 0.995], 0.002);

    folder.say("strip out.mcap -o stripped.mcap").ok();
    assert!(folder.read("stripped.mcap") == std::fs::read(input).unwrap());
}

fn annotate(input: &Path, settings: &[&str]) -> Run {
    let arguments = ["annotate".as_ref(), input.as_os_str(), "-o".as_ref(), "out.mcap".as_ref(), "--json".as_ref()];
    let settings = settings.iter().flat_map(|setting| ["--set", setting]).map(OsStr::new);
    Folder::new().run(arguments.into_iter().chain(settings)).ok()
}

#[test]
fn spread_poses_determine_the_triangular_model_as_the_references_do() {
    let Some(input) = recording("xsens_38_poses.ros2.mcap") else { return };
    let run = annotate(&input, &["fit.model=triangular", "fit.gravity=9.81744"]);
    let accelerometer = &run.json()["imus"][0]["accelerometer"];
    assert_eq!(accelerometer["model"], "triangular");
    // One placement near +X alone: nothing would show a wrong one.
    assert_eq!(accelerometer["status"], "PROVISIONAL");
    assert!(run.json()["imus"][0]["coverage"]["next_step"].as_str().unwrap().contains("near +X"), "{}", run.stdout);
    // imu_tk, nine parameters.
    assert_close("bias", vector(&accelerometer["bias"]), [0.2991, 0.6647, -1.5350], 0.002);
    assert_close("scale", diagonal(&accelerometer["sensitivity"]), [1.00101, 0.99525, 1.00150], 5e-4);

    let Some(input) = recording("mpu9150_0_19_poses.ros2.mcap") else { return };
    for settings in [&["fit.model=triangular"][..], &[]] {
        let accelerometer = &annotate(&input, settings).json()["imus"][0]["accelerometer"];
        assert_eq!(accelerometer["model"], "triangular");
        assert_close("bias", vector(&accelerometer["bias"]), [0.1023, 0.0976, 0.3461], 0.003);
        assert_close("scale", diagonal(&accelerometer["sensitivity"]), [1.0039, 1.0034, 1.0069], 5e-4);
    }
    // It was never laid on its z faces, and what lies between faces is on none.
    let run = annotate(&input, &[]);
    for said in ["+Z not seen", "-Z not seen", "between faces"] {
        assert!(run.stderr.contains(said), "{said}: {}", run.stderr);
    }
    let faces = &run.json()["imus"][0]["coverage"]["faces"];
    let seen: u64 = faces.as_array().unwrap().iter().map(|face| face["placements"].as_u64().unwrap()).sum();
    assert!(seen < 12, "{faces}");
}

#[test]
fn merging_one_recording_says_of_its_gyroscope_what_annotating_it_said() {
    let Some(input) = recording("mpu6050_hand_held.ros2.mcap") else { return };
    let folder = Folder::new();
    let arguments = ["annotate".as_ref(), input.as_os_str(), "-o".as_ref(), "a.mcap".as_ref(), "--json".as_ref()];
    let annotated = folder.run(arguments).ok().json()["imus"][0]["gyroscope"].clone();
    let merged = folder.say("merge a.mcap --format json").ok().json()["imus"][0]["gyroscope"].clone();
    assert_eq!(annotated["status"], "CONFIRMED");
    for name in ["status", "bias", "bias_std"] {
        assert_eq!(merged[name], annotated[name], "{name}");
    }
}

#[test]
fn six_faces_do_not_determine_the_triangular_model_and_it_is_said() {
    let Some(input) = recording("nilspod_six_face.ros2.mcap") else { return };
    let accelerometer = &annotate(&input, &[]).json()["imus"][0]["accelerometer"];
    assert_eq!(accelerometer["model"], "bias-scale");
    let notes = accelerometer["notes"].to_string();
    assert!(notes.contains("triangular is not determined") && notes.contains("condition"), "{notes}");

    let imu = &annotate(&input, &["fit.model=triangular"]).json()["imus"][0];
    assert_eq!(imu["accelerometer"]["bias"], Value::Null);
    let next = imu["coverage"]["next_step"].to_string();
    assert!(next.contains("the direction between"), "{next}");
}

#[test]
fn sessions_that_show_neither_six_faces_nor_nine_directions_calibrate_no_accelerometer() {
    for name in ["mpu6050_hand_held.ros2.mcap", "robot_localization_test1.mcap", "robot_localization_test2.mcap"] {
        let Some(input) = recording(name) else { return };
        let run = annotate(&input, &[]);
        let imu = &run.json()["imus"][0];
        assert_eq!(imu["accelerometer"]["bias"], Value::Null, "{name}");
        assert_eq!(imu["coverage"]["complete"], false, "{name}");
        assert!(run.stderr.contains("missing") && run.stderr.contains("next"), "{name}: {}", run.stderr);
    }
}

/// Every number in a result, with the path to it.
fn numbers(value: &Value, path: &str, found: &mut Vec<(String, f64)>) {
    match value {
        Value::Number(number) => found.push((path.to_owned(), number.as_f64().unwrap())),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| numbers(v, &format!("{path}[{i}]"), found)),
        Value::Object(map) => map.iter().for_each(|(key, v)| numbers(v, &format!("{path}.{key}"), found)),
        _ => {}
    }
}

#[test]
fn one_session_in_five_encodings_gives_the_same_rests_and_calibration() {
    let mut expected = None;
    for (name, lines) in [
        ("nilspod_six_face.ros2.mcap", ""),
        ("nilspod_six_face.ros1.mcap", ""),
        ("nilspod_six_face.rosbag2", ""),
        (
            "nilspod_six_face.protobuf.mcap",
            "[[imu]]\ntopic = \"/sensors/imu\"\naccel = \"accel_mps2\"\ngyro = \"gyro_radps\"\n",
        ),
        (
            "nilspod_six_face.json.mcap",
            "[[imu]]\ntopic = \"/imu\"\naccel = \"linear_acceleration\"\ngyro = \"angular_velocity\"\n",
        ),
    ] {
        let Some(input) = recording(name) else { return };
        let folder = Folder::new();
        folder.write("map.toml", lines.as_bytes());
        let arguments = ["annotate".as_ref(), input.as_os_str(), "-o".as_ref(), "out.mcap".as_ref()];
        if !lines.is_empty() {
            // The lines are those that are offered.
            let offered = folder.run(["topics".as_ref(), input.as_os_str()]).ok().stdout;
            assert!(offered.contains(lines) && lines.lines().count() <= 4, "{offered}");
            let setting = folder.run(arguments).error().to_owned();
            assert!(lines.lines().skip(1).all(|line| setting.contains(line)), "{setting}");
        }
        let options = ["--require-calibration", "--json", "-c", "map.toml"].map(AsRef::as_ref);
        let result = folder.run(arguments.into_iter().chain(options)).ok().json();
        assert_eq!(result["rests"], serde_json::json!({"found": 13, "accepted": 13, "rejected": 0}), "{name}");
        let mut found = Vec::new();
        numbers(&result["imus"][0], "", &mut found);
        assert!(found.len() > 50, "{found:?}");
        let expected = expected.get_or_insert_with(|| found.clone());
        assert_eq!(found.len(), expected.len(), "{name}");
        for ((path, found), (_, expected)) in found.iter().zip(expected) {
            assert!((*found - *expected).abs() <= 1e-9, "{name}{path}: {found}, in ROS 2 {expected}");
        }
    }
}

#[test]
fn poses_that_are_no_faces_determine_the_triangular_model_in_protobuf_too() {
    let Some(input) = recording("mpu9150_1_20_poses.protobuf.mcap") else { return };
    let setting = r#"imu=[{topic="/sensors/imu", accel="accel_mps2", gyro="gyro_radps"}]"#;
    let accelerometer = &annotate(&input, &[setting]).json()["imus"][0]["accelerometer"];
    assert_eq!(accelerometer["model"], "triangular");
    // The reference is of another recording of the sensor.
    assert_close("bias", vector(&accelerometer["bias"]), [0.1023, 0.0976, 0.3461], 0.03);
    assert_close("scale", diagonal(&accelerometer["sensitivity"]), [1.0039, 1.0034, 1.0069], 4e-3);
}

#[test]
fn an_encoding_that_nobody_knows_is_refused_by_name() {
    let Some(input) = data("containers/rosbag2_wrong_rmw_test_0.mcap") else { return };
    let folder = Folder::new();
    let arguments = ["annotate".as_ref(), input.as_os_str(), "-o".as_ref(), "out.mcap".as_ref()];
    let run = folder.run(arguments);
    assert_eq!(run.code, 1);
    assert!(run.error().contains("the encoding wrong_format is not read"), "{}", run.stderr);
    let run = folder.run(arguments.into_iter().chain(["--allow-no-imu".as_ref(), "--accept-damage".as_ref()])).ok();
    assert!(run.stderr.contains("the encoding wrong_format is not read"), "{}", run.stderr);
    folder.say("strip out.mcap -o stripped.mcap").ok();
    assert!(folder.read("stripped.mcap") == std::fs::read(input).unwrap());
}

#[test]
fn spread_poses_in_protobuf_are_never_taken_for_six_faces() {
    let Some(input) = recording("mpu9150_1_20_poses.protobuf.mcap") else { return };
    let imu = r#"imu=[{topic="TOPIC", accel="accel_mps2", gyro="gyro_radps"}]"#;
    let topics = Folder::new().run(["topics".as_ref(), input.as_os_str(), "--json".as_ref()]).ok().json();
    let imu = imu.replace("TOPIC", topics["topics"][0]["topic"].as_str().unwrap());
    for settings in [&[imu.as_str()][..], &[&imu, "fit.model=bias-scale"]] {
        let accelerometer = &annotate(&input, settings).json()["imus"][0]["accelerometer"];
        assert_ne!(accelerometer["model"], "bias-scale", "{accelerometer}");
        assert_eq!(settings.len() == 1, accelerometer["model"] == "triangular", "{accelerometer}");
    }
}
