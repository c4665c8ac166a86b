//! `output.corrected`: the source's messages with true values in the place of the measured ones, and nothing else changed.

use std::collections::BTreeMap;

use crate::common::Folder;
use crate::common::needs::recording;
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use serde_json::Value;
use stillpoint::annotate;
use stillpoint::config::{Config, Layer};
use stillpoint::engine::Message;
use stillpoint::imu::{Decoder, ImuConfig, Intake, Layout, Reading, Sensor};
use stillpoint::messages::Triad;
use stillpoint::record::{Channel, Schema};

/// Messages of a topic, with the channel they are on.
pub struct Messages {
    channel: Channel,
    schema: Schema,
    /// Log time and bytes.
    pub list: Vec<(u64, Vec<u8>)>,
}

pub fn messages(file: &[u8], topic: &str) -> Option<Messages> {
    let mut found: Option<Messages> = None;
    for message in mcap::MessageStream::new(file).unwrap() {
        let message = message.unwrap();
        if message.channel.topic != topic {
            continue;
        }
        let schema = message.channel.schema.as_ref().unwrap();
        let found = found.get_or_insert_with(|| Messages {
            channel: Channel {
                id: message.channel.id,
                schema_id: schema.id,
                topic: topic.to_owned(),
                message_encoding: message.channel.message_encoding.clone(),
                metadata: message.channel.metadata.clone(),
            },
            schema: Schema {
                id: schema.id,
                name: schema.name.clone(),
                encoding: schema.encoding.clone(),
                data: schema.data.to_vec(),
            },
            list: Vec::new(),
        });
        found.list.push((message.log_time, message.data.to_vec()));
    }
    found
}

/// What an intake reads from messages, as if they were on the topic of their source: by time, of each triad.
pub fn read(messages: &Messages, topic: &str, imus: &[ImuConfig]) -> BTreeMap<(u64, usize), Vector3<f64>> {
    let mut intake = Intake::new(imus);
    intake.channel(&Channel { topic: topic.to_owned(), ..messages.channel.clone() }, Some(&messages.schema));
    let mut values = BTreeMap::new();
    for (log_time, data) in &messages.list {
        intake.message(messages.channel.id, *log_time, data, &mut |_, sensor: Sensor, reading| {
            if let Reading::Sample(sample) = reading {
                values.insert((*log_time, sensor.index()), sample.value);
            }
        });
    }
    values
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator((0..3).map(|i| value[i].as_f64().unwrap()))
}

/// `S⁻¹ (measured − bias)` of a triad as `annotate --json` prints it.
fn truth(triad: &Value, measured: &Vector3<f64>) -> Vector3<f64> {
    let sensitivity = match triad["sensitivity"].is_null() {
        true => Matrix3::identity(),
        false => Matrix3::from_fn(|row, column| triad["sensitivity"][row][column].as_f64().unwrap()),
    };
    sensitivity.try_inverse().unwrap() * (measured - vector(&triad["bias"]))
}

#[test]
fn every_message_is_corrected_by_the_last_calibration_whatever_its_encoding() {
    for encoding in ["ros2", "ros1", "protobuf", "json"] {
        let folder = Folder::new();
        folder.say(&format!("simulate demo -o x.mcap -q --set recording.encoding={encoding}")).ok();
        // Types that are not known are mapped.
        let map = match encoding {
            "ros2" | "ros1" => "imu=[]",
            _ => r#"imu=[{topic="/imu/data_raw",accel="accel",gyro="gyro"}]"#,
        };
        let imus = Config::load(&[Layer::set(map).unwrap()]).unwrap().imu;
        let annotate = |from: &str, to: &str, corrected: &str| {
            let arguments = ["annotate", from, "-o", to, "--json", "-q", "--set", map, "--set", corrected];
            folder.run(arguments).ok().json()
        };
        let plain = annotate("x.mcap", "plain.mcap", "output.corrected=off");
        let run = annotate("x.mcap", "out.mcap", "output.corrected=final");
        assert_eq!(plain["imus"], run["imus"], "{encoding}: what is learned does not depend on it");
        let topic = run["imus"][0]["topic"].as_str().unwrap();
        let file = folder.read("out.mcap");
        let source = messages(&file, topic).unwrap();
        let corrected = messages(&file, &format!("{topic}/stillpoint/corrected")).unwrap();
        assert_eq!(source.list.len(), corrected.list.len());
        assert_eq!((&corrected.schema.name, &corrected.schema.data), (&source.schema.name, &source.schema.data));
        assert_eq!(corrected.schema.id, source.schema.id, "{encoding}: the schema is not written twice");
        assert_eq!(corrected.channel.message_encoding, source.channel.message_encoding);
        assert_eq!(corrected.channel.metadata, source.channel.metadata);

        let (before, after) = (read(&source, topic, &imus), read(&corrected, topic, &imus));
        assert_eq!(before.len(), after.len());
        let (accel, gyro) = (&run["imus"][0]["accelerometer"], &run["imus"][0]["gyroscope"]);
        for (key, measured) in &before {
            let expected = truth(if key.1 == 0 { accel } else { gyro }, measured);
            let error = (after[key] - expected).norm();
            assert!(error < 1e-11, "{encoding}: off by {error} at {key:?}");
        }
        if encoding != "json" {
            for ((_, before), (_, after)) in source.list.iter().zip(&corrected.list) {
                // Protobuf leaves zeros out: what is not zero any more is appended.
                assert!(before.len() == after.len() || (encoding == "protobuf" && before.len() < after.len()));
                let changed = before.iter().zip(after).filter(|(before, after)| before != after).count();
                assert!(changed <= 48, "{encoding}: {changed} bytes changed, six numbers have 48");
            }
        }
        folder.say("strip out.mcap -o back.mcap -q").ok();
        assert!(folder.read("back.mcap") == folder.read("x.mcap"));
        annotate("out.mcap", "twice.mcap", "output.corrected=final");
        assert!(folder.read("twice.mcap") == file, "{encoding}: twice is once");
    }
}

/// Messages of a JSON recording, so many in a list of each.
fn packed(file: &[u8], each: usize) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut out).unwrap();
    let channel_id = writer.add_channel(0, "/imu/packets", "json", &BTreeMap::new()).unwrap();
    let all: Vec<_> = mcap::MessageStream::new(file).unwrap().map(|message| message.unwrap()).collect();
    for (i, packet) in all.chunks(each).enumerate() {
        let text: Vec<_> = packet.iter().map(|message| std::str::from_utf8(&message.data).unwrap()).collect();
        let (log_time, sequence) = (packet[packet.len() - 1].log_time, i as u32);
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        let data = format!("{{\"readings\": [{}], \"kept\": {i}}}", text.join(", "));
        writer.write_to_known_channel(&header, data.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

#[test]
fn each_reading_of_a_message_that_holds_several_is_corrected() {
    let folder = Folder::new();
    folder.say("simulate demo -o x.mcap -q --set recording.encoding=json").ok();
    folder.write("packets.mcap", &packed(&folder.read("x.mcap"), 7));
    let map = "imu=[{topic='/imu/packets', accel='readings[*].accel', gyro='readings[*].gyro'}]";
    for form in ["final", "causal"] {
        let set = format!("output.corrected={form}");
        let arguments =
            ["annotate", "packets.mcap", "-o", "out.mcap", "--force", "--json", "-q", "--set", map, "--set", &set];
        let run = folder.run(arguments).ok().json();
        let file = folder.read("out.mcap");
        let of = |topic: &str| -> BTreeMap<u64, Value> {
            let all = mcap::MessageStream::new(&file).unwrap().map(|message| message.unwrap());
            let own = all.filter(|message| message.channel.topic == topic);
            own.map(|message| (message.log_time, serde_json::from_slice(&message.data).unwrap())).collect()
        };
        let (source, corrected) = (of("/imu/packets"), of("/imu/packets/stillpoint/corrected"));
        assert!(corrected.len() > 50 && (form == "causal" || corrected.len() == source.len()), "{}", corrected.len());
        let last = *corrected.keys().last().unwrap();
        for (log_time, after) in &corrected {
            let before = &source[log_time];
            assert_eq!(before["kept"], after["kept"]);
            let readings = |message: &Value| message["readings"].as_array().unwrap().clone();
            assert_eq!(readings(before).len(), readings(after).len());
            for (before, after) in readings(before).iter().zip(&readings(after)) {
                assert_eq!(before["stamp"], after["stamp"]);
                for (name, triad) in [("accel", "accelerometer"), ("gyro", "gyroscope")] {
                    let vector = |value: &Value| {
                        Vector3::from_iterator(["x", "y", "z"].map(|axis| value[axis].as_f64().unwrap()))
                    };
                    let expected = truth(&run["imus"][0][triad], &vector(&before[name]));
                    match form {
                        "final" => assert!((vector(&after[name]) - expected).norm() < 1e-11, "{before} {after}"),
                        // By the last calibration before, none of which is far from the last.
                        _ if *log_time == last => {
                            assert!((vector(&after[name]) - expected).norm() < 0.05, "{before} {after}");
                            assert_ne!(before[name], after[name]);
                        }
                        _ => {}
                    }
                }
            }
        }
        folder.say("strip out.mcap -o back.mcap -q --force").ok();
        assert!(folder.read("back.mcap") == folder.read("packets.mcap"));
    }
}

#[test]
fn a_causal_correction_begins_with_the_first_calibration_and_follows_each() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o out.mcap -q --set output.corrected=causal").ok();
    let file = folder.read("out.mcap");
    let topic = "/imu/data_raw";
    let source = messages(&file, topic).unwrap();
    let corrected = messages(&file, &format!("{topic}/stillpoint/corrected")).unwrap();
    let calibrations = messages(&file, &format!("{topic}/stillpoint/calibration")).unwrap();
    let calibrations: Vec<_> = calibrations
        .list
        .iter()
        .map(|(log_time, data)| {
            let Ok(Message::Calibration(said)) = annotate::read("stillpoint_msgs/msg/Calibration", "cdr", data) else {
                panic!("no calibration")
            };
            (*log_time, said)
        })
        .collect();
    assert!(calibrations.len() > 3, "{}", calibrations.len());
    // What is known in part corrects nothing.
    let determined = |triad: &Option<Triad>| triad.as_ref().is_some_and(|triad| triad.status != 0);
    let mut first = calibrations.iter().filter(|(_, c)| determined(&c.accelerometer) || determined(&c.gyroscope));
    let first = first.next().unwrap().0;
    let expected = source.list.iter().filter(|(log_time, _)| *log_time >= first).count();
    assert_eq!(corrected.list.len(), expected);
    assert!(expected < source.list.len());

    let (before, after) = (read(&source, topic, &[]), read(&corrected, topic, &[]));
    let correct = |triad: &Triad, measured: Vector3<f64>| {
        let Some(bias) = triad.bias.as_ref().filter(|_| triad.status != 0) else { return measured };
        let sensitivity = match triad.sensitivity.is_empty() {
            true => Matrix3::identity(),
            false => Matrix3::from_row_slice(&triad.sensitivity),
        };
        sensitivity.try_inverse().unwrap() * (measured - Vector3::new(bias.x, bias.y, bias.z))
    };
    let mut untouched = 0;
    for (key, value) in &after {
        let (_, in_force) = calibrations.iter().rev().find(|(log_time, _)| *log_time <= key.0).unwrap();
        let triad = if key.1 == 0 { &in_force.accelerometer } else { &in_force.gyroscope };
        let expected = correct(triad.as_ref().unwrap(), before[key]);
        assert!((value - expected).norm() < 1e-11, "{key:?}");
        untouched += usize::from(*value == before[key]);
    }
    assert!(untouched > 100, "the accelerometer stays as it is before its faces were seen");
    let log = messages(&file, "/stillpoint/log").unwrap();
    let says =
        log.list.iter().filter(|(_, data)| String::from_utf8_lossy(data).contains("leave what is not determined"));
    assert_eq!(says.count(), 1, "said once");
}

#[test]
fn a_secondary_accelerometer_has_corrected_messages_of_its_own() {
    let Some(input) = recording("nilspod_six_face.ros2.mcap") else { return };
    let folder = Folder::new();
    let imu = r#"imu=[{topic="/imu/data_raw", secondary=[{name="highg", topic="/highg/acceleration"}]}]"#;
    let arguments = ["-o", "out.mcap", "--json", "-q", "--set", imu, "--set", "output.corrected=final"];
    let run = folder.run(["annotate".as_ref(), input.as_os_str()].into_iter().chain(arguments.map(AsRef::as_ref))).ok();
    let highg = &run.json()["imus"][0]["secondary"][0];
    let file = folder.read("out.mcap");
    let source = messages(&file, "/highg/acceleration").unwrap();
    let corrected = messages(&file, "/highg/acceleration/stillpoint/corrected").unwrap();
    assert_eq!(source.list.len(), corrected.list.len());
    assert!(messages(&file, "/imu/data_raw/stillpoint/corrected").is_some());
    for ((_, before), (_, after)) in source.list.iter().zip(&corrected.list) {
        // The vector is the end of the message, by `geometry_msgs/Vector3Stamped`.
        let numbers = |data: &[u8]| {
            let numbers = data[data.len() - 24..].chunks(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()));
            Vector3::from_iterator(numbers)
        };
        assert!((numbers(after) - truth(highg, &numbers(before))).norm() < 1e-11);
        assert_eq!(after[..after.len() - 24], before[..before.len() - 24]);
    }
}

#[test]
fn without_a_calibration_nothing_is_corrected() {
    let Some(input) = recording("mpu6050_hand_held.ros2.mcap") else { return };
    let folder = Folder::new();
    for form in ["causal", "final"] {
        let corrected = format!("output.corrected={form}");
        let arguments = ["-o", "out.mcap", "--force", "-q", "--json", "--set", &corrected];
        let run = folder.run(["annotate".as_ref(), input.as_os_str()].into_iter().chain(arguments.map(AsRef::as_ref)));
        let calibrated = !run.ok().json()["imus"][0]["gyroscope"]["bias"].is_null();
        let topics = mcap::Summary::read(&folder.read("out.mcap")).unwrap().unwrap().channels;
        let written = topics.values().any(|channel| channel.topic.ends_with("/stillpoint/corrected"));
        assert_eq!(written, calibrated, "{form}");
    }
}

const VECTORS: &str = "string before
geometry_msgs/Vector3 rate
float32[] list
geometry_msgs/Vector3[2] force
===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
";

fn ros_decoder(language: &str, encoding: &str) -> Decoder {
    let schema = Schema { id: 1, name: "a/msg/B".into(), encoding: language.into(), data: VECTORS.as_bytes().to_vec() };
    let layout = Layout::new(encoding, Some(&schema)).unwrap();
    let places = ["rate.y", "list[1]", "force[1].z"].map(|path| layout.number(&path.parse().unwrap()).unwrap());
    Decoder::new(&layout, &places, None).unwrap()
}

proptest! {
    #[test]
    fn a_rewritten_message_reads_as_told_and_back(
        text in "[a-z]{0,9}",
        list in prop::collection::vec(any::<f32>(), 2..6),
        values in prop::array::uniform9(-1e9_f64..1e9),
        told in prop::array::uniform3(-1e9_f64..1e9),
        big in any::<bool>(),
        cdr in any::<bool>(),
    ) {
        // Written by the rules of CDR, or those of ROS 1, which aligns nothing.
        let mut out = if cdr { vec![0, u8::from(!big), 0, 0] } else { Vec::new() };
        let big = big && cdr;
        let origin = out.len();
        let mut put = |align: usize, mut bytes: Vec<u8>| {
            let at = out.len() - origin;
            out.resize(origin + if cdr { at.next_multiple_of(align) } else { at }, 0);
            if big {
                bytes.reverse();
            }
            out.extend(bytes);
        };
        put(4, ((text.len() + usize::from(cdr)) as u32).to_le_bytes().to_vec());
        text.bytes().chain(cdr.then_some(0)).for_each(|byte| put(1, vec![byte]));
        values[..3].iter().for_each(|value| put(8, value.to_le_bytes().to_vec()));
        put(4, (list.len() as u32).to_le_bytes().to_vec());
        list.iter().for_each(|value| put(4, value.to_le_bytes().to_vec()));
        values[3..].iter().for_each(|value| put(8, value.to_le_bytes().to_vec()));

        let decoder = if cdr { ros_decoder("ros2msg", "cdr") } else { ros_decoder("ros1msg", "ros1") };
        let mut before = [0.0; 3];
        decoder.read(&out, &mut before).unwrap();
        prop_assert_eq!([before[0], before[2]], [values[1], values[8]]);
        let changes: Vec<_> = told.iter().copied().enumerate().collect();
        let rewritten = decoder.rewrite(&out, 3, &changes).unwrap();
        let mut after = [0.0; 3];
        decoder.read(&rewritten, &mut after).unwrap();
        prop_assert_eq!(after, [told[0], f64::from(told[1] as f32), told[2]]);
        if !before[1].is_nan() {
            let back: Vec<_> = before.iter().copied().enumerate().collect();
            prop_assert_eq!(decoder.rewrite(&rewritten, 3, &back).unwrap(), out);
        }
    }
}

#[test]
fn of_a_json_message_only_the_numbers_change() {
    let data = br#"{ "z" : [{"y":1}, {"y" :-2.50e1 , "y2": 7}],"unknown":"\u00e9 \"x\"", "x":0.1}"#;
    let layout = Layout::of_example("the message", data).unwrap();
    let places = ["x", "z[1].y"].map(|path| layout.number(&path.parse().unwrap()));
    let [Ok(x), Ok(y)] = places else { panic!("the paths are not found") };
    let decoder = Decoder::new(&layout, &[x, y], None).unwrap();
    let rewritten = decoder.rewrite(data, 2, &[(0, 9.80665), (1, -0.125)]).unwrap();
    let expected = r#"{ "z" : [{"y":1}, {"y" :-0.125 , "y2": 7}],"unknown":"\u00e9 \"x\"", "x":9.80665}"#;
    assert_eq!(String::from_utf8(rewritten).unwrap(), expected);
}
