//! The numbers that people and programs get are those of the message, and its schema says what they mean.

use crate::common::Folder;
use mcap::MessageStream;
use prost::Message as _;
use serde_json::{Value, json};
use stillpoint::messages::{Calibration, Triad, Vector3};

fn vector(v: &Option<Vector3>) -> Value {
    v.as_ref().map(|v| json!([v.x, v.y, v.z])).into()
}

fn rows(matrix: &[f64]) -> Value {
    if matrix.is_empty() { Value::Null } else { matrix.chunks(3).map(|row| json!(row)).collect() }
}

fn list(values: &[f64]) -> Value {
    if values.is_empty() { Value::Null } else { json!(values) }
}

fn assert_same(message: &Triad, exported: &Value) {
    let what = &message.sensor;
    assert_eq!(exported["sensor"], *what);
    assert_eq!(exported["status"], message.status().as_str_name(), "{what}");
    assert_eq!(exported["bias"], vector(&message.bias), "{what}");
    assert_eq!(exported["bias_std"], vector(&message.bias_std), "{what}");
    assert_eq!(exported["sensitivity"], rows(&message.sensitivity), "{what}");
    let stds = rows(&message.sensitivity_std);
    for (r, c) in (0..3).flat_map(|r| (0..3).map(move |c| (r, c))) {
        // What the model holds fixed has no deviation.
        let std = if stds[r][c] == json!(0.0) { &Value::Null } else { &stds[r][c] };
        assert_eq!(exported["sensitivity_std"][r][c], *std, "{what}");
    }
    assert_eq!(exported["covariance"], list(&message.covariance), "{what}");
    for (key, number) in [
        ("residual_rms", message.residual_rms),
        ("chi2_per_dof", message.chi2_per_dof),
        ("worst_case_error", message.worst_case_error),
        ("condition", message.condition),
    ] {
        assert_eq!(exported[key], json!(number), "{what} {key}");
    }
    assert_eq!(exported["notes"], json!(message.notes), "{what}");
    // The bars are the roots of the covariance's diagonal: bias first, then the free entries of S row by row.
    let free = message.sensitivity_std.iter().copied().filter(|std| *std > 0.0);
    let bias_std = message.bias_std.as_ref().map(|v| [v.x, v.y, v.z]).into_iter().flatten();
    let stds: Vec<f64> = bias_std.chain(free).collect();
    assert_eq!(stds.len() * stds.len(), message.covariance.len(), "{what}");
    for (i, std) in stds.iter().enumerate() {
        let variance = message.covariance[i * (stds.len() + 1)];
        assert!((std * std / variance - 1.0).abs() < 1e-12, "{what}");
    }
}

#[test]
fn the_export_carries_the_numbers_of_the_message() {
    let folder =
        Folder::with_scenario("session.mcap", &stillpoint::simulate::Scenario::builtin("thesis-sequence-3").unwrap());
    let highg = r#"imu=[{topic="/imu/data_raw",secondary=[{name="highg",topic="/highg/acceleration"}]}]"#;
    folder
        .run(["annotate", "session.mcap", "-o", "out.mcap", "--set", "output.encoding=protobuf", "--set", highg])
        .ok();
    let exported = folder.say("export out.mcap --format json").ok().json()["imus"][0].clone();
    let bytes = folder.read("out.mcap");
    let messages = MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let last = messages.filter(|message| message.channel.topic.ends_with("/stillpoint/calibration")).last().unwrap();
    let calibration = Calibration::decode(&*last.data).unwrap();

    assert_same(calibration.accelerometer.as_ref().unwrap(), &exported["accelerometer"]);
    assert_same(calibration.gyroscope.as_ref().unwrap(), &exported["gyroscope"]);
    assert_same(&calibration.secondary[0], &exported["secondary"][0]);
    assert_eq!(exported["gravity"], json!(calibration.gravity));
    assert_eq!(exported["gravity_source"], calibration.gravity_source);
    assert_eq!(exported["revision"], calibration.revision);
    assert_eq!(exported["segments"], calibration.segments);
    assert_eq!(exported["placements"], calibration.placements);
    assert_eq!(exported["direction"], "measured = bias + sensitivity * true");
}

#[test]
fn units_and_direction_stand_in_the_schema_that_is_recorded() {
    for encoding in ["protobuf", "ros2"] {
        let folder = Folder::with_demo();
        folder.say(&format!("annotate demo.mcap -o out.mcap --set output.encoding={encoding}")).ok();
        let bytes = folder.read("out.mcap");
        let messages = MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let message = messages.into_iter().find(|m| m.channel.topic.ends_with("/stillpoint/calibration")).unwrap();
        let schema = message.channel.schema.as_ref().unwrap();
        // Of a descriptor set the comments are a part in plain text.
        let text = String::from_utf8_lossy(&schema.data);
        for said in [
            "measured = bias + S * true",
            "true = S^-1 (measured - bias)",
            "accelerometers m/s^2",
            "gyroscopes rad/s",
            "estimate +- 1.96 std is the 95 % interval",
            "m/s^2: what the error of a corrected reading at rest keeps to",
        ] {
            assert!(text.contains(said), "{encoding}: {said:?} is not in the schema");
        }
    }
}
