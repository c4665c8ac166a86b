//! What comes through the door: which topics are IMUs, whose a reading is, when it was measured, what is refused.

use std::collections::BTreeMap;

use stillpoint::Stamp;
use stillpoint::imu::{Cause, ChannelRole, ImuConfig, ImuId, Intake, Reading, Sample, Sensor};
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

pub(super) fn schema(name: &str, text: &str) -> Schema {
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

pub(super) fn channel(id: u16, topic: &str) -> Channel {
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

pub(super) struct Door {
    pub(super) intake: Intake,
    pub(super) samples: Vec<(ImuId, Sensor, Sample)>,
    /// What was not a sample.
    said: Vec<(Sensor, Reading)>,
}

impl Door {
    pub(super) fn new(config: &str) -> Self {
        #[derive(serde::Deserialize)]
        struct Tables {
            #[serde(default)]
            imu: Vec<ImuConfig>,
        }
        let Tables { imu } = toml::from_str(config).unwrap();
        Self { intake: Intake::new(&imu), samples: Vec::new(), said: Vec::new() }
    }

    pub(super) fn channel(&mut self, id: u16, topic: &str, schema: &Schema) -> &ChannelRole {
        self.intake.channel(&channel(id, topic), Some(schema))
    }

    pub(super) fn message(&mut self, channel: u16, log_time: u64, data: &[u8]) {
        let samples = &mut self.samples;
        let said = &mut self.said;
        self.intake.message(channel, log_time, data, &mut |imu, sensor, reading| match reading {
            Reading::Sample(sample) => samples.push((imu, sensor, sample)),
            other => said.push((sensor, other)),
        });
    }

    pub(super) fn sensors(&self) -> Vec<(usize, Sensor)> {
        self.samples.iter().map(|(imu, sensor, _)| (imu.index(), *sensor)).collect()
    }

    pub(super) fn names(&self) -> Vec<&str> {
        self.intake.imus().iter().map(|imu| imu.name.as_str()).collect()
    }

    pub(super) fn faults(&self) -> Vec<(Cause, u64)> {
        self.intake.faults().iter().map(|fault| (fault.cause, fault.count)).collect()
    }
}

use Sensor::{Accelerometer, Gyroscope, Secondary};

#[test]
fn an_imu_is_used_without_configuration_and_its_accelerometer_comes_last() {
    let mut door = Door::new("");
    assert!(matches!(door.channel(1, "/imu", &imu_schema()), ChannelRole::Used(uses) if uses.len() == 2));
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
    assert_eq!(*door.channel(1, "/imu/stillpoint/corrected", &imu_schema()), ChannelRole::Annotation);
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
    let ChannelRole::Other { vectors, suggestion, .. } = door.channel(1, "/acme", &acme()).clone() else { panic!() };
    assert_eq!(vectors.iter().map(ToString::to_string).collect::<Vec<_>>(), ["accel_g"]);
    assert!(!door.intake.wants(1));

    let mut door = Door::new(&suggestion.unwrap().config(None).lines());
    assert!(matches!(door.channel(1, "/acme", &acme()), ChannelRole::Used(_)));
    let mut bytes = message((1, 0), "abcd", &[]);
    bytes.truncate(4 + 8 + 4 + 5);
    bytes.extend([0; 3]);
    [0.0_f32, 0.0, 1.0, 0.1, 0.2, 0.3].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes.extend([1, 0, 0, 0, 0]);
    door.message(1, 1, &bytes);
    let value = |i: usize| door.samples[i].2.value.z;
    assert_eq!((value(0), value(1)), (f64::from(0.3_f32), 9.80665));
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
        assert!(matches!(&verdict, ChannelRole::Skipped(why) if why.contains(reason)), "{verdict}");
        assert!(!door.intake.wants(1));
    }
}

#[test]
fn what_is_not_read_is_named() {
    let mut door = Door::new("");
    let wrong = Channel { message_encoding: "wrong_format".into(), ..channel(1, "/a") };
    assert_eq!(
        door.intake.channel(&wrong, Some(&imu_schema())).to_string(),
        "skipped: the encoding wrong_format is not read"
    );
    let flatbuffer = Schema { encoding: "flatbuffer".into(), ..imu_schema() };
    assert_eq!(
        door.channel(2, "/b", &flatbuffer).to_string(),
        "skipped: the encoding cdr with a flatbuffer schema is not read"
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
    let mut resumed =
        Door { intake: serde_json::from_str(&saved).unwrap(), samples: door.samples.clone(), said: Vec::new() };
    assert_eq!(resumed.intake, door.intake);
    for door in [&mut door, &mut resumed] {
        door.message(1, 2, &imu_message((5, 0), "front"));
        door.message(2, 3, &message((0, 0), "x", &[1.0, 2.0, 3.0]));
    }
    assert_eq!(door.samples, resumed.samples);
    assert_eq!(door.samples.len(), 5);
}

/// As `sensor_msgs/Imu`: one vector measured, the other zero, as the driver of a RealSense camera writes it.
fn half(stamp: (i32, u32), frame: &str, gyro: [f64; 3], accel: [f64; 3]) -> Vec<u8> {
    message(stamp, frame, &[gyro[0], gyro[1], gyro[2], 0.01, accel[0], accel[1], accel[2], 0.01])
}

#[test]
fn an_accelerometer_and_a_gyroscope_on_two_topics_are_one_imu_whichever_comes_first() {
    let accel = |i: u32| half((1, i), "accel_frame", [0.0; 3], [0.0, 9.8, 0.0]);
    let gyro = |i: u32| half((1, i), "gyro_frame", [0.1, 0.2, 0.3], [0.0; 3]);
    for (accel_first, messages_between) in [(true, false), (false, false), (true, true), (false, true)] {
        let mut door = Door::new("");
        let (accel_topic, gyro_topic) = ("/camera/accel/sample", "/camera/gyro/sample");
        let first = if accel_first { (1, accel_topic, accel(0)) } else { (2, gyro_topic, gyro(0)) };
        let second = if accel_first { (2, gyro_topic) } else { (1, accel_topic) };
        door.channel(first.0, first.1, &imu_schema());
        if messages_between {
            door.message(first.0, 0, &first.2);
        }
        door.channel(second.0, second.1, &imu_schema());
        door.samples.clear();
        for i in 1..4 {
            door.message(2, 2 * u64::from(i), &gyro(2 * i));
            door.message(1, 2 * u64::from(i) + 1, &accel(2 * i + 1));
        }
        assert_eq!(door.names(), [accel_topic]);
        assert!(door.sensors().contains(&(0, Gyroscope)));
        let imu = &door.intake.imus()[0];
        assert_eq!(imu.frame_id, "accel_frame");
        let topics: Vec<_> = imu.triads.iter().map(|triad| (triad.sensor, triad.topic.as_str())).collect();
        assert_eq!(topics, [(Accelerometer, accel_topic), (Gyroscope, gyro_topic)]);
        assert!(!door.samples.iter().any(|(.., sample)| sample.value.norm() == 0.0));
        assert_eq!(door.intake.verdict(1).to_string(), "accelerometer of /camera/accel/sample (linear_acceleration)");
        assert_eq!(door.intake.verdict(2).to_string(), "gyroscope of /camera/accel/sample (angular_velocity)");
    }
}

#[test]
fn topics_that_only_sound_like_halves_stay_imus_of_their_own() {
    let mut door = Door::new("");
    let (one, other) = ("/accel/imu", "/gyro/imu");
    door.channel(1, one, &imu_schema());
    door.message(1, 1, &imu_message((1, 0), "a"));
    door.channel(2, other, &imu_schema());
    door.message(2, 1, &imu_message((1, 0), "b"));
    assert_eq!(door.names(), [one, other]);
    assert_eq!(door.sensors(), [(0, Gyroscope), (0, Accelerometer), (1, Gyroscope), (1, Accelerometer)]);
}

#[test]
fn vectors_on_two_topics_are_offered_as_one_imu_and_the_lines_work() {
    let mut door = Door::new("");
    door.channel(1, "/imu/gyro", &vector_schema());
    door.channel(2, "/imu/accel", &vector_schema());
    let ChannelRole::Other { suggestion: Some(suggestion), .. } = door.intake.verdict(2).clone() else { panic!() };
    let lines = suggestion.config(None).lines();
    assert_eq!(lines, "[[imu]]\ntopic = \"/imu/accel\"\ngyro = { topic = \"/imu/gyro\" }\n");
    let mut door = Door::new(&lines);
    door.channel(1, "/imu/gyro", &vector_schema());
    door.channel(2, "/imu/accel", &vector_schema());
    door.message(2, 1, &message((1, 0), "a", &[0.0, 0.0, 9.8]));
    door.message(1, 2, &message((1, 0), "a", &[0.1, 0.0, 0.0]));
    assert_eq!(door.sensors(), [(0, Accelerometer), (0, Gyroscope)]);
}

#[test]
fn imus_inside_other_messages_are_found() {
    let imu = "===\nMSG: sensor_msgs/Imu\nstd_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\n\
               geometry_msgs/Vector3 linear_acceleration\n";
    let one = schema("acme/msg/Status", &format!("uint64 count\nsensor_msgs/Imu imu\n{imu}"));
    let mut door = Door::new("");
    assert!(
        matches!(door.channel(1, "/status", &one), ChannelRole::Used(uses) if uses[1].path == "imu.linear_acceleration")
    );
    let mut bytes = vec![0, 1, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0];
    bytes.extend(&message((5, 6), "link", &[0.1, 0.2, 0.3, 1.0, 2.0, 9.8])[4..]);
    door.message(1, 9, &bytes);
    assert_eq!(door.names(), ["/status"]);
    assert_eq!(door.samples[1].2.value.as_slice(), [1.0, 2.0, 9.8]);
    assert_eq!(door.samples[1].2.stamp, Stamp::from_nanos(5_000_000_006));
    assert_eq!(door.intake.imus()[0].frame_id, "link");

    let two = schema("acme/msg/Pair", &format!("sensor_msgs/Imu front\nsensor_msgs/Imu rear\n{imu}"));
    let mut door = Door::new("");
    door.channel(1, "/pair", &two);
    let front = message((5, 0), "f___", &[0.1, 0.2, 0.3, 1.0, 2.0, 9.8]);
    let rear = message((6, 0), "r___", &[0.4, 0.5, 0.6, 3.0, 4.0, 9.7]);
    door.message(1, 9, &[&front[..], &rear[4..]].concat());
    assert_eq!(door.names(), ["/pair/front", "/pair/rear"]);
    let stamps: Vec<_> = door.samples.iter().map(|(imu, _, sample)| (imu.index(), sample.stamp.nanos())).collect();
    assert_eq!(stamps, [(0, 5_000_000_000), (0, 5_000_000_000), (1, 6_000_000_000), (1, 6_000_000_000)]);
}

/// A message of px4_msgs in little-endian CDR: numbers by their sizes, aligned.
pub(super) fn px4(fields: &[(f64, char)]) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    for &(value, kind) in fields {
        let number = match kind {
            'Q' => (value as u64).to_le_bytes().to_vec(),
            'I' => (value as u32).to_le_bytes().to_vec(),
            'i' => (value as i32).to_le_bytes().to_vec(),
            'f' => (value as f32).to_le_bytes().to_vec(),
            'd' => value.to_le_bytes().to_vec(),
            'h' => (value as i16).to_le_bytes().to_vec(),
            _ => vec![value as u8],
        };
        bytes.resize((bytes.len() - 4).next_multiple_of(number.len()) + 4, 0);
        bytes.extend(number);
    }
    bytes
}

pub(super) fn px4_schema(name: &str, text: &str) -> Schema {
    Schema { id: 1, name: format!("px4_msgs/msg/{name}"), encoding: "ros2msg".into(), data: text.into() }
}

#[test]
fn increments_of_px4_are_divided_by_their_own_time_and_their_flags_are_passed_on() {
    let text = "uint64 timestamp # time since system start (microseconds)\nuint64 timestamp_sample\n\
                uint32 accel_device_id\nuint32 gyro_device_id\nfloat32[3] delta_angle\nfloat32[3] delta_velocity\n\
                uint32 delta_angle_dt\nuint32 delta_velocity_dt\nuint8 CLIPPING_X = 1\nuint8 delta_angle_clipping\n\
                uint8 delta_velocity_clipping\nuint8 accel_calibration_count\nuint8 gyro_calibration_count\n";
    let vehicle = |micros: f64, device: f64, dt: f64, clipping: f64, rounds: (f64, f64)| {
        let vector = |v: [f64; 3]| v.map(|axis| (axis, 'f'));
        let head = [(micros + 300.0, 'Q'), (micros, 'Q'), (device, 'I'), (device + 1.0, 'I')];
        let tail = [(5000.0, 'I'), (dt, 'I'), (0.0, 'B'), (clipping, 'B'), (rounds.0, 'B'), (rounds.1, 'B')];
        px4(&[&head[..], &vector([0.0005, 0.0, 0.0]), &vector([0.0, 0.0, -0.0390625]), &tail].concat())
    };
    let mut door = Door::new("");
    door.channel(1, "/fmu/out/vehicle_imu", &px4_schema("VehicleImu", text));
    door.message(1, 1, &vehicle(1_000_000.0, 7.0, 4000.0, 0.0, (3.0, 5.0)));
    assert_eq!(door.samples[1].2.stamp, Stamp::from_nanos(1_000_000_000));
    assert_eq!(door.samples[1].2.value.as_slice(), [0.0, 0.0, -0.0390625 / 0.004]);
    assert!((door.samples[0].2.value.x - 0.1).abs() < 1e-8);
    assert_eq!(door.said, []);

    door.message(1, 2, &vehicle(1_005_000.0, 7.0, 4000.0, 4.0, (3.0, 5.0)));
    let stamp = Stamp::from_nanos(1_005_000_000);
    assert_eq!(door.said, [(Accelerometer, Reading::Clipped(stamp))]);
    door.said.clear();
    door.message(1, 3, &vehicle(1_010_000.0, 7.0, 4000.0, 0.0, (4.0, 5.0)));
    let stamp = Stamp::from_nanos(1_010_000_000);
    assert_eq!(door.said, [(Accelerometer, Reading::NewRound { stamp, log_time: 3 })]);
    door.message(1, 4, &vehicle(1_015_000.0, 7.0, 0.0, 0.0, (4.0, 5.0)));
    assert_eq!(door.faults(), [(Cause::NoTime, 1)]);
    // Another device is another IMU.
    door.message(1, 5, &vehicle(1_015_000.0, 70.0, 4000.0, 0.0, (4.0, 5.0)));
    assert_eq!(door.names(), ["/fmu/out/vehicle_imu", "/fmu/out/vehicle_imu/70"]);
}

#[test]
fn the_sensors_of_px4_are_paired_by_instance_and_device() {
    let text = "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32 x\nfloat32 y\nfloat32 z\n\
                float32 temperature\nuint32 error_count\nuint8[3] clip_counter\nuint8 samples\n";
    let reading = |micros: f64, device: f64, xyz: [f64; 3], clips: f64| {
        let head = [(micros, 'Q'), (micros, 'Q'), (device, 'I')];
        let tail = [(20.0, 'f'), (0.0, 'I'), (0.0, 'B'), (clips, 'B'), (0.0, 'B'), (1.0, 'B')];
        px4(&[&head[..], &xyz.map(|axis| (axis, 'f')), &tail].concat())
    };
    let mut door = Door::new("");
    for (id, topic, name) in [
        (1, "/fmu/out/sensor_gyro", "SensorGyro"),
        (2, "/fmu/out/sensor_accel", "SensorAccel"),
        (3, "/fmu/out/sensor_accel1", "SensorAccel"),
        (4, "/fmu/out/sensor_gyro1", "SensorGyro"),
    ] {
        door.channel(id, topic, &px4_schema(name, text));
    }
    let gravity = [0.0, 0.0, -9.75];
    door.message(2, 1, &reading(1000.0, 100.0, gravity, 0.0));
    let temperatures: Vec<_> = door.intake.take_temperatures().map(|(imu, celsius)| (imu.index(), celsius)).collect();
    assert_eq!(temperatures, [(0, 20.0)], "the accelerometer's own");
    door.message(2, 1, &reading(1000.0, 101.0, gravity, 0.0));
    door.message(3, 1, &reading(1000.0, 102.0, gravity, 2.0));
    assert_eq!(door.names(), ["/fmu/out/sensor_accel", "/fmu/out/sensor_accel/101", "/fmu/out/sensor_accel1"]);
    assert_eq!(door.said, [(Accelerometer, Reading::Clipped(Stamp::from_nanos(1_000_000)))]);
    door.samples.clear();
    for (channel, device) in [(1, 200.0), (1, 201.0), (4, 202.0), (1, 201.0)] {
        door.message(channel, 2, &reading(2000.0, device, [0.5, 0.0, 0.0], 0.0));
    }
    assert_eq!(door.sensors(), [(0, Gyroscope), (1, Gyroscope), (2, Gyroscope), (1, Gyroscope)]);
    assert_eq!(door.faults(), []);
}

#[test]
fn json_without_a_schema_is_known_from_its_first_message() {
    let json = |topic: &str| Channel { schema_id: 0, message_encoding: "json".into(), ..channel(1, topic) };
    let data = br#"{"stamp": {"sec": 5, "nsec": 6}, "frame_id": "link", "acc": {"x": 1, "y": 2, "z": 9.8}, "gyro": [0.1, 0.2, 0.3]}"#;
    let mut door = Door::new("");
    assert_eq!(*door.intake.channel(&json("/j"), None), ChannelRole::Untold);
    door.message(1, 1, b"not yet");
    assert!(door.intake.wants(1));
    door.message(1, 2, data);
    let ChannelRole::Other { suggestion: Some(suggestion), .. } = door.intake.verdict(1).clone() else { panic!() };
    assert!(!door.intake.wants(1));

    let mut door = Door::new(&suggestion.config(None).lines());
    door.intake.channel(&json("/j"), None);
    door.message(1, 1, data);
    door.message(1, 2, br#"{"stamp": {"sec": 5, "nsec": 7}, "acc": {"x": 1, "y": "NaN", "z": 9.8}}"#);
    assert_eq!(door.sensors(), [(0, Gyroscope), (0, Accelerometer)]);
    assert_eq!(door.samples[1].2.stamp, Stamp::from_nanos(5_000_000_006));
    assert_eq!(door.samples[0].2.value.as_slice(), [0.1, 0.2, 0.3]);
    assert_eq!(door.faults(), [(Cause::NotFinite, 1), (Cause::NotFinite, 1)]);
}

#[test]
fn axes_that_are_set_are_taken_in_their_order_and_written_back_in_the_messages_own() {
    let mut door = Door::new("[[imu]]\ntopic = '/imu'\ngyro = { axes = ['y', '-x', 'z'] }");
    door.channel(1, "/imu", &imu_schema());
    let data = imu_message((1, 0), "link");
    door.message(1, 1, &data);
    assert_eq!(door.samples[0].2.value.as_slice(), [0.2, -0.1, 0.3]);
    assert_eq!(door.samples[1].2.value.as_slice(), [1.0, 2.0, 9.8]);
    let change = |_, sensor, _, _| (sensor == Gyroscope).then_some([4.0, 5.0, 6.0].into());
    let rewritten = door.intake.rewrite(1, &data, change);
    let expected = message((1, 0), "link", &[-5.0, 4.0, 6.0, 0.0, 1.0, 2.0, 9.8, 0.0]);
    assert!(rewritten == [("/imu", expected)], "{rewritten:?}");
}

#[test]
fn numbers_called_like_axes_are_offered_as_vectors() {
    let text = "std_msgs/Header header\nfloat64 ax\nfloat64 ay\nfloat64 az\nfloat64 gx\nfloat64 gy\nfloat64 gz\n";
    let mut door = Door::new("");
    let ChannelRole::Other { suggestion: Some(suggestion), .. } =
        door.channel(1, "/raw", &schema("acme/msg/Raw", text))
    else {
        panic!()
    };
    let lines = suggestion.config(None).lines();
    assert_eq!(lines, "[[imu]]\ntopic = \"/raw\"\naccel = [\"ax\", \"ay\", \"az\"]\ngyro = [\"gx\", \"gy\", \"gz\"]\n");
    let mut door = Door::new(&lines);
    door.channel(1, "/raw", &schema("acme/msg/Raw", text));
    door.message(1, 1, &message((1, 0), "", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(door.samples[0].2.value.as_slice(), [4.0, 5.0, 6.0]);
}

#[test]
fn messages_become_samples_without_memory() {
    let mut intake = Intake::new(&[]);
    intake.channel(&channel(1, "/imu"), Some(&imu_schema()));
    let data = imu_message((1, 0), "link");
    let mut samples = 0;
    // The first message makes the IMU.
    intake.message(1, 1, &data, &mut |_, _, _| samples += 1);
    let memory = allocation_counter::measure(|| {
        (0..100).for_each(|i| intake.message(1, i, &data, &mut |_, _, _| samples += 1));
    });
    assert_eq!((samples, memory.count_total), (202, 0));
}

#[test]
fn a_temperature_is_read_from_the_topic_that_is_configured_and_is_refused_where_it_is_none() {
    let text = "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n";
    let warmth = |celsius: f64| message((1, 0), "thermometer", &[celsius, 0.0]);
    for (config, read, expected) in [
        ("{ topic = '/warmth' }", 20.5, Some(20.5)),
        ("{ topic = '/warmth', path = 'temperature', unit = 'K' }", 300.0, Some(300.0 - 273.15)),
        ("{ topic = '/warmth' }", f64::NAN, None),
        ("{ topic = '/warmth' }", 1e6, None),
    ] {
        let mut door = Door::new(&format!("[[imu]]\ntopic = '/imu'\ntemperature = {config}"));
        door.channel(1, "/imu", &imu_schema());
        let role = door.channel(2, "/warmth", &schema("sensor_msgs/msg/Temperature", text));
        let temperature = ChannelRole::Temperature { imu: "/imu".to_owned(), path: "temperature".to_owned() };
        assert_eq!(*role, temperature);
        door.message(2, 1, &warmth(read));
        assert_eq!(door.intake.take_temperatures().count(), 0, "there is no IMU yet");
        door.message(1, 2, &imu_message((1, 0), "imu"));
        door.message(2, 3, &warmth(read));
        let taken = door.intake.take_temperatures().next().map(|(_, celsius)| celsius);
        assert_eq!(taken, expected, "{config}");
        assert_eq!(door.intake.temperature(ImuId::of(0)), expected);
    }
    // Without configuration nobody knows whose temperature it is.
    let mut door = Door::new("");
    door.channel(1, "/imu", &imu_schema());
    let role = door.channel(2, "/warmth", &schema("sensor_msgs/msg/Temperature", text));
    assert!(matches!(role, ChannelRole::Other { .. }), "{role}");
    let mut door = Door::new("[[imu]]\ntopic = '/imu'\ntemperature = { path = 'temprature' }");
    let role = door.channel(1, "/imu", &imu_schema());
    assert!(matches!(role, ChannelRole::Skipped(why) if why.contains("temprature")), "{role}");
}

#[test]
fn a_gyroscope_whose_messages_have_room_for_an_accelerometer_is_called_alone_if_that_was_not_measured() {
    let rates = [0.1, 0.2, 0.3];
    let obstacles = |accel: [f64; 3], marks: [f64; 2]| {
        let mut door = Door::new("");
        door.channel(1, "/camera/gyro/sample", &imu_schema());
        let numbers = [&rates[..], &marks[..1], &accel[..], &marks[1..]].concat();
        (0..120).for_each(|i| door.message(1, i, &message((1, i as u32), "link", &numbers)));
        door.intake.obstacles().join("; ")
    };
    let alone = "/camera/gyro/sample is a gyroscope alone; an IMU needs an accelerometer";
    for (accel, marks) in [([0.0; 3], [0.0; 2]), ([0.0; 3], [0.0, -1.0]), ([1.0, 2.0, 9.8], [0.0, -1.0])] {
        let said = obstacles(accel, marks);
        assert!(said.contains(alone) && said.contains("accelerometer: 120 readings refused"), "{said}");
    }
    // Neither was measured, or the accelerometer reads nonsense.
    for (accel, marks) in [([1.0, 2.0, 9.8], [-1.0, -1.0]), ([f64::NAN, 2.0, 9.8], [0.0, 0.0])] {
        let said = obstacles(accel, marks);
        assert!(!said.contains("alone") && said.contains("accelerometer: 120 readings refused"), "{said}");
    }
    assert_eq!(obstacles([1.0, 2.0, 9.8], [0.0; 2]), "");
}
