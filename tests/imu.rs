//! What comes through the door: which topics are IMUs, whose a reading is, when it was measured, what is refused.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

use stillpoint::Stamp;
use stillpoint::imu::{Cause, ImuConfig, ImuId, Intake, Sample, Sensor, Verdict};
use stillpoint::record::{Channel, Schema};

const HEADER: &str = "===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
";

const VECTOR3: &str = "===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

fn schema(name: &str, text: &str) -> Schema {
    let data = format!("{text}{HEADER}{VECTOR3}").into_bytes();
    Schema { id: 1, name: name.into(), encoding: "ros2msg".into(), data }
}

/// As `sensor_msgs/Imu`, without orientation and with only the first element of the covariances.
fn imu_schema() -> Schema {
    let text = "std_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\nfloat64[1] angular_velocity_covariance\n\
                geometry_msgs/Vector3 linear_acceleration\nfloat64[1] linear_acceleration_covariance\n";
    schema("sensor_msgs/msg/Imu", text)
}

fn vector_schema() -> Schema {
    schema("geometry_msgs/msg/Vector3Stamped", "std_msgs/Header header\ngeometry_msgs/Vector3 vector\n")
}

fn channel(id: u16, topic: &str) -> Channel {
    Channel { id, schema_id: 1, topic: topic.into(), message_encoding: "cdr".into(), metadata: BTreeMap::new() }
}

/// A header, then numbers, in little-endian CDR.
fn message(stamp: (i32, u32), frame_id: &str, numbers: &[f64]) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(stamp.0.to_le_bytes());
    bytes.extend(stamp.1.to_le_bytes());
    bytes.extend((frame_id.len() as u32 + 1).to_le_bytes());
    bytes.extend(frame_id.bytes());
    bytes.push(0);
    bytes.resize((bytes.len() - 4).next_multiple_of(8) + 4, 0);
    numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes
}

fn imu_message(stamp: (i32, u32), frame_id: &str) -> Vec<u8> {
    message(stamp, frame_id, &[0.1, 0.2, 0.3, 0.0, 1.0, 2.0, 9.8, 0.0])
}

struct Door {
    intake: Intake,
    samples: Vec<(ImuId, Sensor, Sample)>,
}

impl Door {
    fn new(config: &str) -> Self {
        #[derive(serde::Deserialize)]
        struct Tables {
            #[serde(default)]
            imu: Vec<ImuConfig>,
        }
        let Tables { imu } = toml::from_str(config).unwrap();
        Self { intake: Intake::new(&imu), samples: Vec::new() }
    }

    fn channel(&mut self, id: u16, topic: &str, schema: &Schema) -> &Verdict {
        self.intake.channel(&channel(id, topic), Some(schema))
    }

    fn message(&mut self, channel: u16, log_time: u64, data: &[u8]) {
        let samples = &mut self.samples;
        self.intake.message(channel, log_time, data, &mut |imu, sensor, sample| samples.push((imu, sensor, sample)));
    }

    fn sensors(&self) -> Vec<(usize, Sensor)> {
        self.samples.iter().map(|(imu, sensor, _)| (imu.index(), *sensor)).collect()
    }

    fn names(&self) -> Vec<&str> {
        self.intake.imus().iter().map(|imu| imu.name.as_str()).collect()
    }

    fn faults(&self) -> Vec<(Cause, u64)> {
        self.intake.faults().iter().map(|fault| (fault.cause, fault.count)).collect()
    }
}

use Sensor::{Accelerometer, Gyroscope, Secondary};

#[test]
fn an_imu_is_used_without_configuration_and_its_accelerometer_comes_last() {
    let mut door = Door::new("");
    assert!(matches!(door.channel(1, "/imu", &imu_schema()), Verdict::Used(uses) if uses.len() == 2));
    door.message(1, 7, &imu_message((5, 6), "link"));

    assert_eq!(door.sensors(), [(0, Gyroscope), (0, Accelerometer)]);
    let accel = door.samples[1].2;
    assert_eq!((accel.stamp, accel.log_time), (Stamp::from_nanos(5_000_000_006), 7));
    assert_eq!(accel.value.as_slice(), [1.0, 2.0, 9.8]);
    let imu = &door.intake.imus()[0];
    assert_eq!((imu.name.as_str(), imu.topic.as_str(), imu.frame_id.as_str()), ("/imu", "/imu", "link"));
    let triads: Vec<_> = imu.triads.iter().map(|triad| triad.name.as_str()).collect();
    assert_eq!(triads, ["accelerometer", "gyroscope"]);
}

#[test]
fn annotations_are_never_a_source() {
    let mut door = Door::new("");
    assert_eq!(*door.channel(1, "/imu/stillpoint/corrected", &imu_schema()), Verdict::Annotation);
    assert!(!door.intake.wants(1));
}

#[test]
fn frames_on_one_topic_are_imus_of_their_own() {
    let mut door = Door::new("");
    door.channel(1, "/imu", &imu_schema());
    for (i, frame) in ["front", "/rear link", "front", "rear_link"].into_iter().enumerate() {
        door.message(1, i as u64, &imu_message((1, i as u32), frame));
    }
    assert_eq!(door.names(), ["/imu", "/imu/rear_link", "/imu/rear_link_2"]);
    let imus: Vec<_> = door.samples.iter().step_by(2).map(|(imu, ..)| imu.index()).collect();
    assert_eq!(imus, [0, 1, 0, 2]);
}

#[test]
fn too_many_frames_are_noise() {
    let mut door = Door::new("");
    door.channel(1, "/imu", &imu_schema());
    for i in 0..100 {
        door.message(1, i, &imu_message((1, i as u32), &format!("frame{i}")));
    }
    assert_eq!(door.intake.imus().len(), 16);
    assert_eq!(door.faults(), [(Cause::TooManyFrames, 84), (Cause::TooManyFrames, 84)]);
}

#[test]
fn a_name_replaces_the_topic() {
    let mut door = Door::new("[[imu]]\ntopic = '/imu'\nname = 'front'");
    door.channel(1, "/imu", &imu_schema());
    door.message(1, 1, &imu_message((1, 0), ""));
    assert_eq!(door.names(), ["/front"]);
    assert_eq!(door.samples.len(), 2);
}

#[test]
fn log_time_is_used_if_the_first_stamp_is_zero_and_the_choice_stays() {
    let mut door = Door::new("");
    door.channel(1, "/unset", &imu_schema());
    door.channel(2, "/set", &imu_schema());
    for (channel, stamps) in [(1, [(0, 0), (9, 0)]), (2, [(9, 0), (0, 0)])] {
        door.message(channel, 100, &imu_message(stamps[0], ""));
        door.message(channel, 200, &imu_message(stamps[1], ""));
    }
    let stamps: Vec<_> = door.samples.iter().step_by(2).map(|(_, _, sample)| sample.stamp.nanos()).collect();
    assert_eq!(stamps, [100, 200, 9_000_000_000, 0]);
}

#[test]
fn bad_readings_are_refused_counted_and_told_once() {
    let mut door = Door::new("");
    door.channel(1, "/imu", &imu_schema());
    let good = imu_message((1, 0), "link");
    for _ in 0..2 {
        door.message(1, 1, &good[..good.len() - 1]);
        door.message(1, u64::MAX, &good);
        door.message(1, 1, &message((1, 0), "link", &[0.1, 0.2, 0.3, -1.0, 1.0, f64::NAN, 9.8, 0.0]));
    }
    assert_eq!(door.samples, []);
    let causes = [Cause::Malformed, Cause::LogTime, Cause::NotMeasured, Cause::NotFinite];
    assert_eq!(door.faults(), causes.map(|cause| (cause, 2)));
    let notices: Vec<_> = door.intake.take_notices().into_iter().map(|notice| notice.text).collect();
    assert_eq!(notices.len(), 4);
    assert!(notices.iter().all(|text| text.starts_with("/imu")), "{notices:?}");
    assert!(notices[0].contains("the payload ends after 91 bytes"), "{notices:?}");
    assert_eq!(door.intake.take_notices(), []);
}

#[test]
fn a_vector_that_is_zero_from_the_start_is_absent() {
    let mut door = Door::new("");
    door.channel(1, "/imu", &imu_schema());
    let without_gyro = message((1, 0), "", &[0.0, -0.0, 0.0, 0.0, 1.0, 2.0, 9.8, 0.0]);
    for i in 0..99 {
        door.message(1, i, &without_gyro);
    }
    assert_eq!((door.faults(), door.intake.take_notices()), (vec![], vec![]));
    door.message(1, 99, &without_gyro);
    assert_eq!(door.faults(), [(Cause::Zero, 100)]);
    assert!(door.intake.take_notices()[0].text.contains("gyroscope: exactly zero from the start"));
    assert!(door.sensors().iter().all(|&(_, sensor)| sensor == Accelerometer));

    // Once it has read something, a zero is a reading like any other.
    door.samples.clear();
    door.message(1, 100, &imu_message((1, 0), ""));
    door.message(1, 101, &without_gyro);
    assert_eq!(door.sensors(), [(0, Gyroscope), (0, Accelerometer), (0, Gyroscope), (0, Accelerometer)]);
}

const HIGHG: &str = "[[imu]]\ntopic = '/imu'\n[[imu.secondary]]\nname = 'highg'\ntopic = '/highg'";

#[test]
fn a_secondary_on_its_own_topic_belongs_to_the_first_imu() {
    let mut door = Door::new(HIGHG);
    door.channel(1, "/imu", &imu_schema());
    door.channel(2, "/highg", &vector_schema());
    let highg = |frame| message((1, 0), frame, &[4.0, 5.0, 6.0]);
    door.message(2, 0, &highg("board"));
    assert_eq!(door.sensors(), [], "nothing is known of the IMU yet");
    door.message(1, 1, &imu_message((1, 0), "front"));
    door.message(1, 1, &imu_message((1, 0), "rear"));
    door.samples.clear();
    door.message(2, 2, &highg("board"));
    door.message(2, 3, &highg("elsewhere"));
    assert_eq!(door.sensors(), [(0, Secondary(0))]);
    assert_eq!(door.samples[0].2.value.as_slice(), [4.0, 5.0, 6.0]);
    assert_eq!(door.faults(), [(Cause::ForeignFrame, 1)]);
    let names = |i: usize| door.intake.imus()[i].triads.iter().map(|triad| triad.name.clone()).collect::<Vec<_>>();
    assert_eq!((names(0).len(), names(1).len()), (3, 2));
    assert_eq!(names(0)[2], "highg");
}

#[test]
fn a_gyroscope_may_have_its_own_topic_and_unit() {
    let mut door =
        Door::new("[[imu]]\ntopic = '/accel'\naccel = { unit = 'g' }\ngyro = { topic = '/gyro', unit = 'deg/s' }");
    door.channel(1, "/accel", &vector_schema());
    door.channel(2, "/gyro", &vector_schema());
    door.message(1, 1, &message((1, 0), "a", &[0.0, 0.0, 1.0]));
    door.message(2, 1, &message((1, 0), "b", &[180.0, 0.0, 0.0]));
    assert_eq!(door.sensors(), [(0, Accelerometer), (0, Gyroscope)]);
    assert_eq!(door.samples[0].2.value.as_slice(), [0.0, 0.0, 9.80665]);
    assert!((door.samples[1].2.value.x - std::f64::consts::PI).abs() < 1e-15);
}

fn acme() -> Schema {
    let text = "std_msgs/Header header\nfloat32[3] accel_g\nfloat32 gx\nfloat32 gy\nfloat32 gz\nstring note\n";
    schema("acme/msg/Sample", text)
}

#[test]
fn a_topic_of_another_type_is_offered_and_the_offered_lines_work() {
    let mut door = Door::new("");
    let Verdict::Other { vectors, suggestion } = door.channel(1, "/acme", &acme()).clone() else { panic!() };
    assert_eq!(vectors.iter().map(ToString::to_string).collect::<Vec<_>>(), ["accel_g"]);
    assert!(!door.intake.wants(1));

    let mut door = Door::new(&suggestion.unwrap());
    assert!(matches!(door.channel(1, "/acme", &acme()), Verdict::Used(_)));
    let mut bytes = message((1, 0), "abcd", &[]);
    bytes.truncate(4 + 8 + 4 + 5);
    bytes.extend([0; 3]);
    [0.0_f32, 0.0, 1.0, 0.1, 0.2, 0.3].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes.extend([1, 0, 0, 0, 0]);
    door.message(1, 1, &bytes);
    assert_eq!(door.samples[0].2.value.z, 9.80665);
}

#[test]
fn a_wrong_mapping_skips_the_channel_and_names_the_nearest_field() {
    for (lines, reason) in [
        ("accel = 'acel_g'", "no field `acel_g`; the nearest is `accel_g`"),
        ("accel = 'note'", "`note` of acme/Sample is a string, not a message with x, y, z or a list of three numbers"),
        ("accel = ['gx', 'gy', 'header']", "`header` of acme/Sample is std_msgs/Header, not a number"),
        ("accel = 'accel_g[3]'", "no field `accel_g[3]`"),
        ("", "which field is the accelerometer? Set `accel` to `accel_g`"),
    ] {
        let mut door = Door::new(&format!("[[imu]]\ntopic = '/acme'\n{lines}"));
        let verdict = door.channel(1, "/acme", &acme()).clone();
        assert!(matches!(&verdict, Verdict::Skipped(why) if why.contains(reason)), "{verdict}");
        assert!(!door.intake.wants(1));
    }
}

#[test]
fn what_is_not_read_yet_is_named() {
    let mut door = Door::new("");
    let protobuf = Schema { encoding: "protobuf".into(), ..imu_schema() };
    let verdict =
        door.intake.channel(&Channel { message_encoding: "wrong_format".into(), ..channel(1, "/a") }, Some(&protobuf));
    assert_eq!(verdict.to_string(), "skipped: the encoding wrong_format is not read yet");
    let idl = Schema { encoding: "ros2idl".into(), ..imu_schema() };
    assert_eq!(
        door.channel(2, "/b", &idl).to_string(),
        "skipped: the encoding cdr with a ros2idl schema is not read yet"
    );
}

#[test]
fn a_configured_topic_that_is_not_there_is_reported_with_the_nearest() {
    let mut door = Door::new(HIGHG);
    door.channel(1, "/imu", &imu_schema());
    door.channel(2, "/hig", &vector_schema());
    let missing = door.intake.missing_topics();
    assert_eq!(missing.len(), 1);
    assert_eq!((missing[0].topic.as_str(), missing[0].nearest.as_deref()), ("/highg", Some("/hig")));
}

#[test]
fn an_intake_continues_from_its_saved_state() {
    let mut door = Door::new(HIGHG);
    door.channel(1, "/imu", &imu_schema());
    door.channel(2, "/highg", &vector_schema());
    door.message(1, 1, &imu_message((0, 0), "front"));
    let saved = serde_json::to_string(&door.intake).unwrap();
    let mut resumed = Door { intake: serde_json::from_str(&saved).unwrap(), samples: door.samples.clone() };
    assert_eq!(resumed.intake, door.intake);
    for door in [&mut door, &mut resumed] {
        door.message(1, 2, &imu_message((5, 0), "front"));
        door.message(2, 3, &message((0, 0), "x", &[1.0, 2.0, 3.0]));
    }
    assert_eq!(door.samples, resumed.samples);
    assert_eq!(door.samples.len(), 5);
}
