//! Several readings in one message: FIFOs of PX4, packets of OAK cameras, lists in JSON and ROS messages. Each learns the
//! truth, as a whole and followed, by itself or with the lines that `topics` offers.

use std::collections::BTreeMap;
use std::io::Cursor;

use serde_json::{Value, json};

use crate::common::Folder;
use crate::real_recordings::{Measured, START, is_true, learns_the_truth, recording, six_faces, vector};
use crate::session::GYRO_BIAS;

/// Groups of this many measurements are a message.
const BATCH: usize = 8;

fn batches() -> Vec<Vec<Measured>> {
    six_faces().chunks(BATCH).map(<[_]>::to_vec).collect()
}

/// When the last measurement of a batch was recorded.
fn logged(batch: &[Measured]) -> i64 {
    START + batch.last().unwrap().at + 2_000_000
}

fn time(stamp: i64) -> Value {
    json!({"sec": stamp.div_euclid(1_000_000_000), "nsec": stamp.rem_euclid(1_000_000_000)})
}

/// A recording with one schema: topic, log time, bytes.
fn encoded(
    (name, encoding, text, message_encoding): (&str, &str, &str, &str),
    messages: impl IntoIterator<Item = (&'static str, i64, Vec<u8>)>,
) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().chunk_size(Some(20_000)).create(&mut out).unwrap();
    let mut channels = BTreeMap::new();
    for (topic, log_time, data) in messages {
        let channel_id = *channels.entry(topic).or_insert_with(|| {
            let name = name.replace('*', if topic.contains("accel") { "Accel" } else { "Gyro" });
            let schema = writer.add_schema(&name, encoding, text.as_bytes()).unwrap();
            writer.add_channel(schema, topic, message_encoding, &BTreeMap::new()).unwrap()
        });
        let log_time = log_time as u64;
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

/// The lines that `topics` offers for the only topic teach the truth.
fn offered_lines_work(bytes: &[u8]) {
    let folder = Folder::new();
    folder.write("a.mcap", bytes);
    let refused = folder.say("annotate a.mcap");
    assert!(refused.code == 1 && refused.stderr.contains("[*]"), "{}", refused.stderr);
    let topics = folder.say("topics a.mcap --json").ok().json();
    let offered = topics["topics"][0]["configuration"].as_str().unwrap_or_else(|| panic!("{topics:#}"));
    folder.write("c.toml", offered.as_bytes());
    is_true(&folder.say("annotate a.mcap -o batch.mcap -c c.toml --json").ok().json(), GYRO_BIAS);
    folder.say("tail a.mcap -o tail.mcap -c c.toml").ok();
    assert!(folder.read("batch.mcap") == folder.read("tail.mcap"), "batch and tail differ");
    folder.say("strip batch.mcap -o original.mcap").ok();
    assert!(folder.read("original.mcap") == bytes);
}

#[test]
fn fifos_of_px4_are_calibrated_without_configuration() {
    let text = "uint64 timestamp\nuint64 timestamp_sample\nuint32 device_id\nfloat32 dt\nfloat32 scale\nuint8 samples\n\
                int16[32] x\nint16[32] y\nint16[32] z\n";
    let fifo = |batch: &[Measured], device: u32, scale: f32, of: fn(&Measured) -> nalgebra::Vector3<f64>| {
        let last = (batch.last().unwrap().at / 1000 + 50_000_000) as u64;
        let mut bytes = vec![0, 1, 0, 0];
        bytes.extend([(last + 300).to_le_bytes(), last.to_le_bytes()].concat());
        bytes.extend([device.to_le_bytes(), 10_000_f32.to_le_bytes(), scale.to_le_bytes()].concat());
        bytes.extend([batch.len() as u8, 0]);
        for axis in 0..3 {
            let counts = batch.iter().map(|m| (of(m)[axis] / f64::from(scale)).round() as i16);
            // What stands behind the valid readings is left over from before.
            let counts = counts.chain(std::iter::repeat(-32768)).take(32);
            bytes.extend(counts.flat_map(i16::to_le_bytes));
        }
        bytes
    };
    let messages = batches().into_iter().flat_map(|batch| {
        let accel = fifo(&batch, 1_310_988, 0.002, |m| m.accel);
        let gyro = fifo(&batch, 2_359_564, 0.0002, |m| m.gyro);
        [("/fmu/out/sensor_gyro_fifo", logged(&batch), gyro), ("/fmu/out/sensor_accel_fifo", logged(&batch), accel)]
    });
    let bytes = encoded(("px4_msgs/msg/Sensor*Fifo", "ros2msg", text, "cdr"), messages);
    let said = learns_the_truth(&bytes, "", GYRO_BIAS);
    assert!(!said.contains("spread"), "{said}");
}

#[test]
fn packets_with_their_own_stamps_are_calibrated_with_the_lines_that_are_offered() {
    // As DepthAI writes them into JSON.
    let report = |v, at: i64| {
        let mut report = vector(v);
        report["timestamp"] = time(START + at);
        report["tsDevice"] = time(at);
        report["sequence"] = json!(at / 10_000_000);
        report
    };
    let packets = batches().into_iter().map(|batch| {
        let packet = |m: &Measured| json!({"acceleroMeter": report(m.accel, m.at), "gyroscope": report(m.gyro, m.at)});
        let packets: Vec<_> = batch.iter().map(packet).collect();
        ("/oak/imu", logged(&batch), json!({"packets": packets, "ts": time(logged(&batch))}))
    });
    offered_lines_work(&recording(packets));
    // Columns, each reading with its time in microseconds.
    let columns = batches().into_iter().map(|batch| {
        let of = |value: &dyn Fn(&Measured) -> f64| batch.iter().map(value).collect::<Vec<_>>();
        let message = json!({
            "t_us": of(&|m| ((START + m.at) / 1000) as f64),
            "accel_x": of(&|m| m.accel.x), "accel_y": of(&|m| m.accel.y), "accel_z": of(&|m| m.accel.z),
            "gyro_x": of(&|m| m.gyro.x), "gyro_y": of(&|m| m.gyro.y), "gyro_z": of(&|m| m.gyro.z)});
        ("/imu", logged(&batch), message)
    });
    offered_lines_work(&recording(columns));
}

#[test]
fn readings_without_times_are_spread_over_their_messages() {
    let messages = batches().into_iter().map(|batch| {
        let samples: Vec<_> = batch.iter().map(|m| json!({"acc": vector(m.accel), "gyr": vector(m.gyro)})).collect();
        ("/imu", logged(&batch), json!({"samples": samples, "status": 0}))
    });
    let bytes = recording(messages);
    offered_lines_work(&bytes);
    let mapping = r#"imu=[{topic="/imu", accel="samples[*].acc", gyro="samples[*].gyr"}]"#;
    let said = learns_the_truth(&bytes, mapping, GYRO_BIAS);
    assert!(said.contains("their times are spread up to the next stamp"), "{said}");
    // A wrong path says what there is.
    let folder = Folder::new();
    folder.write("a.mcap", &bytes);
    let run =
        folder.run(["annotate", "a.mcap", "--set", r#"imu=[{topic="/imu", accel="samples.acc", gyro="samples.gyr"}]"#]);
    assert!(run.code == 1 && run.stderr.contains("samples"), "{}", run.stderr);
}
