//! Inputs after public bug reports (`cases/README.md` beside them), each held to its right value. Their siblings are built in
//! `real_recordings`.

use crate::common::{Folder, Run, case};
use crate::real_recordings::is_true;

const GYRO_BIAS: [f64; 3] = [0.004, -0.006, 0.002];

/// A folder with a case in it, as `a.mcap`.
fn folder(name: &str) -> Option<Folder> {
    let folder = Folder::new();
    folder.write("a.mcap", &std::fs::read(case(name)?).unwrap());
    Some(folder)
}

fn annotate(folder: &Folder, code: i32, more: &str) -> Run {
    let run = folder.say(&format!("annotate a.mcap -o b.mcap --json {more}"));
    assert_eq!(run.code, code, "{}", run.stderr);
    folder.say("strip b.mcap -o c.mcap").ok();
    assert!(folder.read("c.mcap") == folder.read("a.mcap"), "strip is not exact");
    run
}

#[test]
fn a_turntable_in_radians_is_not_called_degrees() {
    let Some(folder) = folder("03_spin_then_rest.mcap") else { return };
    let topics = folder.say("topics a.mcap").ok();
    assert!(topics.stdout.contains("its unit, rad/s, is unconfirmed") && !topics.stdout.contains("deg/s"));
    let run = annotate(&folder, 0, "");
    assert!(!run.stdout.contains("deg/s") && !run.stderr.contains("deg/s"), "{}{}", run.stdout, run.stderr);
    assert_ne!(run.json()["imus"][0]["gyroscope"]["status"], "CONFIRMED");
    // A unit that is set is not asked for again.
    let set = r#"imu=[{topic="/imu/data_raw", gyro={unit="rad/s"}}]"#;
    for command in
        [&["topics", "a.mcap", "--set", set][..], &["annotate", "a.mcap", "-o", "d.mcap", "--json", "--set", set]]
    {
        let run = folder.run(command).ok();
        assert!(!run.stdout.contains("unconfirmed") && !run.stdout.contains("deg/s"), "{}", run.stdout);
    }
}

#[test]
fn a_quiet_gyroscope_in_degrees_is_named_and_calibrated_once_that_is_set() {
    let Some(folder) = folder("04_gyro_deg_quiet.mcap") else { return };
    let run = annotate(&folder, 0, "");
    let gyroscope = &run.json()["imus"][0]["gyroscope"];
    assert_eq!(gyroscope["status"], "UNDETERMINED", "{gyroscope}");
    assert!(gyroscope["notes"].to_string().contains("deg/s"), "{gyroscope}");
    let topics = folder.say("topics a.mcap --json").ok().json();
    folder.write("c.toml", topics["topics"][0]["configuration"].as_str().unwrap().as_bytes());
    let result = folder.say("annotate a.mcap -o d.mcap -c c.toml --json").ok().json();
    is_true(&result, [0.0004, -0.0006, 0.0002]);
    assert_eq!(result["imus"][0]["gyroscope"]["status"], "CONFIRMED");
}

#[test]
fn records_with_unknown_fields_are_no_damage() {
    let Some(folder) = folder("06_padded_one_message.mcap") else { return };
    let run = annotate(&folder, 0, "");
    assert_eq!(run.json()["damage"]["count"], 0, "{}", run.stdout);
    // Of one message no level is known.
    assert!(run.stdout.contains("the readings are too few") && !run.stdout.contains("unknown"), "{}", run.stdout);
}

#[test]
fn a_compression_that_is_not_read_is_named() {
    let Some(folder) = folder("07_compression_bz2.mcap") else { return };
    let run = annotate(&folder, 3, "--allow-no-imu");
    assert!(run.stderr.contains("compression `bz2` is not read"), "{}", run.stderr);
}

#[test]
fn a_second_recording_behind_the_first_is_named() {
    let Some(folder) = folder("08_concatenated.mcap") else { return };
    let run = annotate(&folder, 3, "");
    assert!(run.stderr.contains("another recording of 199555 bytes"), "{}", run.stderr);
    is_true(&run.json(), GYRO_BIAS);
}

#[test]
fn an_empty_schema_is_said_to_be_empty() {
    let Some(folder) = folder("11_schema_empty.mcap") else { return };
    let run = annotate(&folder, 0, "--allow-no-imu");
    assert!(run.stderr.contains("the schema sensor_msgs/msg/Imu is empty"), "{}", run.stderr);
    folder.refuses("annotate a.mcap -o e.mcap", 1, &["is empty"]);
}

#[test]
fn a_git_lfs_pointer_is_told_what_to_run() {
    let Some(folder) = folder("12_lfs_pointer.mcap") else { return };
    folder.refuses("annotate a.mcap -o b.mcap", 1, &["git lfs pull"]);
}

#[test]
fn what_a_phone_records_is_calibrated_with_the_lines_that_are_offered() {
    let Some(folder) = folder("13b_ios_names.mcap") else { return };
    let topics = folder.say("topics a.mcap --json").ok().json();
    folder.write("c.toml", topics["topics"][0]["configuration"].as_str().unwrap().as_bytes());
    is_true(&folder.say("annotate a.mcap -o b.mcap -c c.toml --json").ok().json(), GYRO_BIAS);
}

#[test]
fn one_message_at_the_beginning_of_time_spoils_no_rate() {
    let Some(folder) = folder("14_rate.mcap") else { return };
    let topics = folder.say("topics a.mcap --json").ok().json()["topics"].clone();
    let imu = topics.as_array().unwrap().iter().find(|topic| topic["topic"] == "/imu/data_raw").unwrap().clone();
    assert_eq!(imu["hz"], 100.0);
    is_true(&annotate(&folder, 0, "").json(), GYRO_BIAS);
}

#[test]
fn rotations_among_the_parameters_of_an_autopilot_are_refused_by_name() {
    let (Some(path), Some(folder)) = (case("16_cal_acc0_rot.params"), folder("14_rate.mcap")) else { return };
    folder.write("p.params", &std::fs::read(path).unwrap());
    annotate(&folder, 0, "");
    let run = folder.say("export b.mcap --format px4 --axes flu --in-force p.params");
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(run.stderr.contains("CAL_ACC0_ROT"), "{}", run.stderr);
}

#[test]
fn a_recording_that_is_cut_off_and_damaged_twice_is_annotated_as_it_is() {
    let Some(folder) = folder("17_damaged_then_annotated.mcap") else { return };
    let run = annotate(&folder, 3, "--allow-no-imu");
    assert!(run.stderr.contains("damaged at byte 2573"), "{}", run.stderr);
}

/// The demo with its chunks compressed like this, and a sequence of bytes exchanged throughout.
fn altered(compression: stillpoint::simulate::Compression, from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut scenario = stillpoint::simulate::Scenario::builtin("demo").unwrap();
    scenario.recording.compression = compression;
    let mut bytes = Vec::new();
    stillpoint::simulate::record(&scenario, &mut bytes).unwrap();
    let places: Vec<_> = (0..bytes.len() - from.len()).filter(|&at| bytes[at..].starts_with(from)).collect();
    assert!(!places.is_empty() && from.len() == to.len());
    places.into_iter().for_each(|at| bytes[at..at + to.len()].copy_from_slice(to));
    bytes
}

#[test]
fn compressions_that_are_spelled_or_framed_otherwise_are_named() {
    use stillpoint::simulate::Compression;
    for (bytes, words) in [
        (
            altered(Compression::Zstd, b"\x04\0\0\0zstd", b"\x04\0\0\0Zstd"),
            "compression `Zstd` is not read (MCAP spells its own `zstd`",
        ),
        (
            altered(Compression::Lz4, b"\x03\0\0\0lz4", b"\x03\0\0\0LZ4"),
            "compression `LZ4` is not read (MCAP spells its own",
        ),
        (altered(Compression::Lz4, b"\x04\x22\x4d\x18", b"\xf0\x22\x4d\x18"), "is no lz4 frame (a raw block?)"),
        (altered(Compression::Zstd, b"\x28\xb5\x2f\xfd", b"\x28\xb5\x2f\xfc"), "is no zstd frame"),
    ] {
        let folder = Folder::new();
        folder.write("a.mcap", &bytes);
        let run = annotate(&folder, 3, "--allow-no-imu");
        assert!(run.stderr.contains(words), "no {words:?} in {}", run.stderr);
    }
}
