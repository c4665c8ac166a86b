//! Several readings in one message, each at its own time.

use prost_reflect::{DescriptorPool, DynamicMessage};
use serde_json::json;
use stillpoint::imu::Sensor::{Accelerometer, Gyroscope};
use stillpoint::imu::{Cause, ChannelRole, Sensor, Timing};
use stillpoint::record::{Channel, Schema};

use super::intake::{Door, channel, px4, px4_schema, schema};

/// What depthai-core 3 says of its messages.
pub(super) const DEPTHAI: &str = r#"syntax = "proto3"; package dai.proto.imu_data;
    message Timestamp { int64 sec = 1; int64 nsec = 2; }
    message IMUVec { float x = 1; float y = 2; float z = 3; }
    message IMUReport { int32 sequence = 1; Timestamp ts = 3; Timestamp tsDevice = 4; }
    message IMUReportVec { IMUReport report = 1; IMUVec vec = 2; }
    message IMUPacket { IMUReportVec accelerometer = 1; IMUReportVec gyroscope = 2; IMUReportVec magnetometer = 3; }
    message IMUData { repeated IMUPacket packets = 1; int64 sequenceNum = 2; Timestamp ts = 3; Timestamp tsDevice = 4; }"#;

/// Readings: sensor, stamp in nanoseconds, values.
pub(super) fn told(door: &Door) -> Vec<(Sensor, i64, [f64; 3])> {
    let reading = |(_, sensor, sample): &(_, Sensor, stillpoint::imu::Sample)| {
        (*sensor, sample.stamp.nanos(), sample.value.into())
    };
    door.samples.iter().map(reading).collect()
}

/// The lines that are offered for a channel.
pub(super) fn offered(role: &ChannelRole) -> String {
    let ChannelRole::Other { suggestion: Some(suggestion), .. } = role else { panic!("nothing is offered: {role}") };
    suggestion.config(None).lines()
}

pub(super) const FIFO: &str = "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32 dt\nfloat32 scale\n\
                    uint8 samples\nint16[32] x\nint16[32] y\nint16[32] z\nuint8 ORB_QUEUE_LENGTH = 4\n";

/// A FIFO of px4_msgs that claims so many readings; the n-th counts n along the last axis.
pub(super) fn fifo(micros: f64, device: f64, claimed: f64) -> Vec<u8> {
    let head = [(micros + 9.0, 'Q'), (micros, 'Q'), (device, 'I'), (250.0, 'f'), (0.5, 'f'), (claimed, 'B')];
    let axis = |of: fn(f64) -> f64| (0..32).map(move |n| (of(f64::from(n)), 'h'));
    px4(&head.into_iter().chain(axis(|_| 2.0)).chain(axis(|_| -4.0)).chain(axis(|n| n)).collect::<Vec<_>>())
}

#[test]
fn the_readings_of_a_px4_fifo_end_at_its_stamp_and_are_scaled() {
    let mut door = Door::new("");
    door.channel(1, "/fmu/out/sensor_gyro_fifo", &px4_schema("SensorGyroFifo", FIFO));
    let role = door.channel(2, "/fmu/out/sensor_accel_fifo", &px4_schema("SensorAccelFifo", FIFO)).clone();
    assert!(matches!(role, ChannelRole::Used(_)), "{role}");
    door.message(2, 5, &fifo(1_000_000.0, 7.0, 3.0));
    door.message(1, 6, &fifo(2_000_000.0, 8.0, 2.0));
    let expected = [
        (Accelerometer, 999_500_000, [1.0, -2.0, 0.0]),
        (Accelerometer, 999_750_000, [1.0, -2.0, 0.5]),
        (Accelerometer, 1_000_000_000, [1.0, -2.0, 1.0]),
        (Gyroscope, 1_999_750_000, [1.0, -2.0, 0.0]),
        (Gyroscope, 2_000_000_000, [1.0, -2.0, 0.5]),
    ];
    assert_eq!(told(&door), expected);
    assert_eq!(door.names(), ["/fmu/out/sensor_accel_fifo"]);

    // No reading is none, and 40 are not believed.
    door.samples.clear();
    door.message(2, 7, &fifo(1_000_750.0, 7.0, 0.0));
    assert_eq!(door.faults(), []);
    door.message(2, 8, &fifo(1_000_750.0, 7.0, 40.0));
    assert_eq!((told(&door), door.faults()), (vec![], vec![(Cause::Malformed, 1)]));
    let text = door.intake.take_notices().pop().unwrap().text;
    assert!(text.contains("it claims 40 readings, its lists hold 32"), "{text}");
    door.message(2, 9, &fifo(1_000_750.0, 7.0, 32.0));
    assert_eq!(told(&door).len(), 32);
    // Another device is another IMU.
    door.message(2, 9, &fifo(1_000_750.0, 70.0, 1.0));
    assert_eq!(door.names().len(), 2);
}

#[test]
fn the_packets_of_an_oak_camera_are_read_without_configuration() {
    let data = super::protobuf::compile(DEPTHAI);
    let pool = DescriptorPool::decode(&data[..]).unwrap();
    let of_type = pool.get_message_by_name("dai.proto.imu_data.IMUData").unwrap();
    let report = |nsec: i64, vec: [f32; 3]| {
        // Zeros are left out.
        let axes = ["x", "y", "z"].into_iter().zip(vec).filter(|(_, value)| *value != 0.0);
        let axes: String = axes.map(|(axis, value)| format!("{axis}: {value} ")).collect();
        format!("{{ report {{ sequence: 1 ts {{ sec: 5 nsec: {nsec} }} tsDevice {{ sec: 9 }} }} vec {{ {axes} }} }}")
    };
    // The third packet has no gyroscope.
    let text = format!(
        "ts {{ sec: 7 }} packets {{ accelerometer {} gyroscope {} }} packets {{ accelerometer {} gyroscope {} }} \
         packets {{ accelerometer {} }}",
        report(10, [1.0, 2.0, 9.5]),
        report(12, [0.5, 0.0, 0.0]),
        report(20, [1.0, 0.0, 9.5]),
        report(22, [0.0, 0.25, 0.0]),
        report(30, [0.0, 0.0, 9.5])
    );
    let message = DynamicMessage::parse_text_format(of_type, &text).unwrap();
    let schema =
        Schema { id: 1, name: "dai.proto.imu_data.IMUData".into(), encoding: "protobuf".into(), data: data.clone() };
    let mut door = Door::new("");
    let oak = Channel { message_encoding: "protobuf".into(), ..channel(1, "/oak/imu") };
    let role = door.intake.channel(&oak, Some(&schema)).to_string();
    assert!(role.contains("accelerometer of /oak/imu (packets[*].accelerometer.vec)"), "{role}");
    door.message(1, 1, &prost::Message::encode_to_vec(&message));
    let expected = [
        (Gyroscope, 5_000_000_010, [0.5, 0.0, 0.0]),
        (Accelerometer, 5_000_000_010, [1.0, 2.0, 9.5]),
        (Gyroscope, 5_000_000_020, [0.0, 0.25, 0.0]),
        (Accelerometer, 5_000_000_020, [1.0, 0.0, 9.5]),
        (Accelerometer, 5_000_000_030, [0.0, 0.0, 9.5]),
    ];
    assert_eq!(told(&door), expected);
    assert_eq!(door.faults(), [(Cause::NotFinite, 1)]);
}

#[test]
fn lists_of_readings_in_ros_messages_are_offered_and_the_offered_lines_work() {
    let reading = "===\nMSG: acme/Reading\nbuiltin_interfaces/Time stamp\ngeometry_msgs/Vector3 accel\nbool ok\n\
                   geometry_msgs/Vector3 gyro\n";
    let of =
        |n: f64| [(5.0, 'i'), (n, 'I'), (n, 'd'), (2.0, 'd'), (9.5, 'd'), (1.0, 'B'), (0.5, 'd'), (n, 'd'), (0.0, 'd')];
    let header =
        [(7.0, 'i'), (0.0, 'I'), (5.0, 'I'), (102.0, 'B'), (111.0, 'B'), (111.0, 'B'), (116.0, 'B'), (0.0, 'B')];
    for (list, length) in [("acme/Reading[] readings", Some((3.0, 'I'))), ("acme/Reading[3] readings", None)] {
        let acme = schema("acme/msg/Burst", &format!("std_msgs/Header header\n{list}\nuint8 status\n{reading}"));
        let lines = offered(Door::new("").channel(1, "/burst", &acme));
        let expected = "[[imu]]\ntopic = \"/burst\"\naccel = \"readings[*].accel\"\ngyro = \"readings[*].gyro\"\n";
        assert_eq!(lines, expected);
        let fields = header.into_iter().chain(length).chain([1.0, 2.0, 3.0].into_iter().flat_map(of));
        let mut door = Door::new(&lines);
        door.channel(1, "/burst", &acme);
        door.message(1, 9, &px4(&fields.chain([(1.0, 'B')]).collect::<Vec<_>>()));
        let stamps: Vec<_> = told(&door).into_iter().map(|(sensor, stamp, value)| (sensor, stamp, value[0])).collect();
        let expected = [1, 2, 3].map(|n| {
            let stamp = 5_000_000_000 + n;
            [(Gyroscope, stamp, 0.5), (Accelerometer, stamp, n as f64)]
        });
        assert_eq!(stamps, expected.concat());
        assert_eq!(door.intake.imus()[0].frame_id, "foot", "the frame of the message around them");
    }
}

#[test]
fn lists_of_numbers_are_offered_as_axes_with_their_own_times() {
    let json = Channel { schema_id: 0, message_encoding: "json".into(), ..channel(1, "/j") };
    let columns = json!({"t_us": [10, 20, 30, 40], "ax": [1, 2, 3, 4], "ay": [0, 0, 0, 0], "az": [9, 9, 9, 9],
                         "gx": [5, 6, 7, 8], "gy": [0, 0, 0, 0], "gz": [0, 0, 0, 0]});
    let vectors = json!({"frames": [{"time_ns": 10_000, "accel": {"x": 1, "y": 0, "z": 9}, "gyro": [5, 0, 0]},
                                    {"time_ns": 20_000, "accel": {"x": 2, "y": 0, "z": 9}, "gyro": [6, 0, 0]},
                                    {"time_ns": 30_000, "accel": {"x": 3, "y": 0, "z": 9}, "gyro": [7, 0, 0]},
                                    {"time_ns": 40_000, "accel": {"x": 4, "y": 0, "z": 9}, "gyro": [8, 0, 0]}]});
    let apart = json!({"t_ms": [0.01, 0.02, 0.03, 0.04], "accel": {"x": [1, 2, 3, 4], "y": [0, 0, 0, 0], "z": [9, 9, 9, 9]},
                       "gyro": {"x": [5, 6, 7, 8], "y": [0, 0, 0, 0], "z": [0, 0, 0, 0]}});
    for message in [columns, vectors, apart] {
        let data = message.to_string().into_bytes();
        let mut door = Door::new("");
        door.intake.channel(&json, None);
        door.message(1, 2, &data);
        let mut door = Door::new(&offered(door.intake.verdict(1)));
        door.intake.channel(&json, None);
        door.message(1, 2, &data);
        let found: Vec<_> = told(&door).into_iter().map(|(_, stamp, value)| (stamp, value[0])).collect();
        let expected = [1, 2, 3, 4].map(|n| [(10_000 * n, (n + 4) as f64), (10_000 * n, n as f64)]);
        assert_eq!(found, expected.concat(), "{message}");
    }
}

/// Columns of axes without times, in every encoding that has lists.
pub(super) const COLUMNS: &str = "[[imu]]\ntopic = '/c'\naccel = ['x[*]', 'y[*]', 'z[*]']";

#[test]
fn readings_without_times_are_spread_from_one_message_to_the_next() {
    let mut door = Door::new(COLUMNS);
    door.channel(1, "/c", &schema("acme/msg/C", "float32[] x\nfloat32[] y\nfloat32[] z\n"));
    let axis = |from: f64| [(4.0, 'I'), (from, 'f'), (from + 1.0, 'f'), (from + 2.0, 'f'), (from + 3.0, 'f')];
    let mut timing = Timing::new(0.1);
    let mut stamps = Vec::new();
    for message in 0..3 {
        let log_time = message * 40_000_000;
        let data = px4(&[axis(1.0 + 4.0 * message as f64), axis(0.0), axis(9.0)].concat());
        door.samples.clear();
        let mut readings = Vec::new();
        door.intake.message(1, log_time, &data, &mut |imu, sensor, reading| readings.push((imu, sensor, reading)));
        timing.pass(1, log_time, &readings, &mut |(.., reading)| stamps.push(reading));
    }
    timing.finish(&mut |(.., reading)| stamps.push(reading));
    let sample = |reading: &stillpoint::imu::Reading| match reading {
        stillpoint::imu::Reading::Sample(sample) => (sample.stamp.nanos(), sample.value.x),
        other => panic!("{other:?}"),
    };
    let found: Vec<_> = stamps.iter().map(sample).collect();
    assert_eq!(found, (0..12).map(|i| (i * 10_000_000, (i + 1) as f64)).collect::<Vec<_>>());
}

#[test]
fn an_intake_of_batches_continues_from_its_saved_state() {
    let mut door = Door::new("");
    door.channel(2, "/fifo", &px4_schema("SensorAccelFifo", FIFO));
    door.message(2, 5, &fifo(1_000_000.0, 7.0, 3.0));
    let saved = serde_json::to_string(&door.intake).unwrap();
    let mut resumed = Door::new("");
    resumed.intake = serde_json::from_str(&saved).unwrap();
    door.samples.clear();
    for door in [&mut door, &mut resumed] {
        door.message(2, 6, &fifo(1_000_750.0, 7.0, 3.0));
    }
    assert_eq!((told(&door).len(), told(&resumed)), (3, told(&door)));
}
