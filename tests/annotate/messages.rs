//! Annotations read back as what they say, by readers that are not ours: one in `reader.rs`, written for these
//! tests, and the public Python ones through `tests/interop/annotations.py`.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use proptest::prelude::*;
use prost::Message as _;
use stillpoint::annotate::{Annotator, Encoding, read};
use stillpoint::engine::{Event, Message};
use stillpoint::messages::{Calibration, Coverage, Noise, Segment, Stillness, Triad, Turn, Vector3, foxglove};
use stillpoint::record::{Annotation, Block, Topic};

use crate::common::needs::{python, root};
use crate::reader::{Schema, Value};
use crate::{arbitrary, expected, session};

/// Annotates events of IMUs, each a chunk of input of its own if asked.
fn annotate(encoding: Encoding, events: &[(&str, Event)], chunk_ends: bool) -> (Vec<Topic>, Vec<Block>) {
    let mut annotator = Annotator::new(encoding);
    let mut blocks = Vec::new();
    for (imu, event) in events {
        blocks.extend(annotator.push(imu, event));
        if chunk_ends {
            blocks.extend(annotator.input_chunk_ended());
        }
    }
    blocks.extend(annotator.finish());
    (annotator.topics().to_vec(), blocks)
}

fn at(log_time: u64, message: Message) -> Event {
    Event { log_time, message }
}

/// One annotation, alone.
pub fn alone(encoding: Encoding, message: Message) -> (Topic, Annotation) {
    let (topics, mut blocks) = annotate(encoding, &[("/imu", at(0, message))], false);
    (topics[0].clone(), blocks.remove(0).annotations.remove(0))
}

pub fn one_of_each() -> [Message; 7] {
    [
        Message::Stillness(Stillness::default()),
        Message::Segment(Segment::default()),
        Message::Turn(Turn::default()),
        Message::Noise(Noise::default()),
        Message::Coverage(Coverage::default()),
        Message::Calibration(Box::default()),
        Message::Log(foxglove::Log::default()),
    ]
}

fn ros2_schema(message: Message) -> Schema {
    let (topic, _) = alone(Encoding::Ros2, message);
    Schema::parse(&topic.schema_name, &String::from_utf8(topic.schema).unwrap())
}

fn field<'a>(value: &'a Value, path: &str) -> &'a Value {
    path.split('.').fold(value, |value, name| match value {
        Value::Message(fields) => &fields[name],
        other => panic!("{other:?} has no {name}"),
    })
}

proptest! {
    #[test]
    fn a_ros_2_annotation_reads_as_what_the_message_says(message in arbitrary::message()) {
        let expected = expected::expected(&message);
        let (topic, annotation) = alone(Encoding::Ros2, message);
        let schema = Schema::parse(&topic.schema_name, &String::from_utf8(topic.schema).unwrap());
        prop_assert_eq!(schema.decode(&annotation.data), expected);
    }

    #[test]
    fn a_protobuf_annotation_is_read_back_as_the_message_it_was(message in arbitrary::message()) {
        let (topic, annotation) = alone(Encoding::Protobuf, message.clone());
        prop_assert_eq!(read(&topic.schema_name, &topic.message_encoding, &annotation.data), Ok(message));
    }

    #[test]
    fn a_ros_2_annotation_read_back_says_the_same(message in arbitrary::message()) {
        let (topic, annotation) = alone(Encoding::Ros2, message);
        let back = read(&topic.schema_name, &topic.message_encoding, &annotation.data).unwrap();
        prop_assert_eq!(alone(Encoding::Ros2, back).1, annotation);
    }

    #[test]
    fn damaged_annotations_are_refused_without_panic(
        message in arbitrary::message(),
        cut in any::<prop::sample::Index>(),
        at in any::<prop::sample::Index>(),
        byte: u8,
    ) {
        for encoding in [Encoding::Ros2, Encoding::Protobuf] {
            let (topic, Annotation { mut data, .. }) = alone(encoding, message.clone());
            if encoding == Encoding::Ros2 {
                let cut = &data[..cut.index(data.len())];
                prop_assert!(read(&topic.schema_name, &topic.message_encoding, cut).is_err());
            }
            if !data.is_empty() {
                let at = at.index(data.len());
                data[at] = byte;
                let _ = read(&topic.schema_name, &topic.message_encoding, &data);
            }
        }
    }
}

#[test]
fn an_absent_triad_is_undetermined_and_its_numbers_are_nan() {
    let calibration = Message::Calibration(Box::default());
    let (_, annotation) = alone(Encoding::Ros2, calibration.clone());
    let read = ros2_schema(calibration).decode(&annotation.data);
    assert_eq!(field(&read, "gyroscope.status"), &Value::Integer(0));
    assert_eq!(field(&read, "gyroscope.bias.x"), &Value::Float(f64::NAN));
    assert_eq!(field(&read, "gyroscope.residual_rms"), &Value::Float(f64::NAN));
    assert_eq!(field(&read, "gyroscope.sensitivity"), &Value::Sequence(vec![]));
    assert_eq!(field(&read, "gravity"), &Value::Float(0.0));
}

#[test]
fn what_is_absent_in_ros_2_is_absent_again_when_read_back() {
    let zero = Vector3::default();
    let gyroscope = Triad { bias: Some(zero), residual_rms: Some(0.0), ..Triad::default() };
    let calibration = Calibration { gyroscope: Some(gyroscope), ..Calibration::default() };
    let message = Message::Calibration(Box::new(calibration));
    let (topic, annotation) = alone(Encoding::Ros2, message.clone());
    assert_eq!(read(&topic.schema_name, &topic.message_encoding, &annotation.data), Ok(message));
}

#[test]
fn a_message_that_is_no_annotation_is_refused_with_its_type() {
    let error = read("sensor_msgs/msg/Imu", "cdr", &[]).unwrap_err();
    assert!(error.to_string().contains("sensor_msgs/msg/Imu"), "{error}");
}

#[test]
fn a_time_beyond_2038_saturates_in_ros_2_and_is_kept_in_protobuf() {
    let late = prost_types::Timestamp { seconds: 1 << 33, nanos: 5 };
    let segment = Segment { start: Some(late), ..Segment::default() };
    let (_, ros2) = alone(Encoding::Ros2, Message::Segment(segment.clone()));
    let read = ros2_schema(Message::Segment(Segment::default())).decode(&ros2.data);
    assert_eq!(field(&read, "start.sec"), &Value::Integer(i32::MAX.into()));
    let (_, protobuf) = alone(Encoding::Protobuf, Message::Segment(segment));
    assert_eq!(Segment::decode(protobuf.data.as_slice()).unwrap().start, Some(late));
}

#[test]
fn enumerations_become_constants_of_their_message() {
    let constants = |pairs: &[(&str, i128)]| -> BTreeMap<String, i128> {
        pairs.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
    };
    let [stillness, segment, _, _, coverage, _, log] = one_of_each().map(ros2_schema);
    assert_eq!(*stillness.constants(), constants(&[("UNKNOWN", 0), ("MOVING", 1), ("STILL", 2)]));
    assert_eq!(segment.constants().len(), 8);
    assert_eq!(segment.constants()["SENSOR_FAULT"], 6);
    assert_eq!(*coverage.constants(), constants(&[]));
    let levels = [("DEBUG", 10), ("INFO", 20), ("WARN", 30), ("ERROR", 40), ("FATAL", 50)];
    assert_eq!(*log.constants(), constants(&levels));
}

#[test]
fn both_schemas_state_units_and_direction() {
    for encoding in [Encoding::Ros2, Encoding::Protobuf] {
        let (topic, _) = alone(encoding, Message::Calibration(Box::default()));
        let text = String::from_utf8_lossy(&topic.schema);
        for statement in ["measured = bias + S * true", "accelerometers m/s^2", "One standard deviation", "row by row"]
        {
            assert!(text.contains(statement), "{encoding:?}: {statement}");
        }
    }
}

#[test]
fn a_protobuf_schema_is_a_descriptor_set_with_all_that_it_depends_on() {
    for message in one_of_each() {
        let (topic, _) = alone(Encoding::Protobuf, message);
        let pool = prost_reflect::DescriptorPool::decode(topic.schema.as_slice()).unwrap();
        assert!(pool.get_message_by_name(&topic.schema_name).is_some(), "{}", topic.schema_name);
        assert_eq!(pool.files().len(), 2, "{}", topic.schema_name);
    }
}

#[test]
fn every_topic_has_the_name_and_types_of_the_contract() {
    let events = one_of_each().map(|message| ("/imu/data", at(0, message)));
    let (ros2, _) = annotate(Encoding::Ros2, &events, false);
    let named = |topics: &[Topic]| -> Vec<(String, String)> {
        topics.iter().map(|topic| (topic.name.clone(), topic.schema_name.clone())).collect()
    };
    let pair = |topic: &str, schema: &str| (topic.to_owned(), schema.to_owned());
    assert_eq!(
        named(&ros2),
        [
            pair("/imu/data/stillpoint/stillness", "stillpoint_msgs/msg/Stillness"),
            pair("/imu/data/stillpoint/segment", "stillpoint_msgs/msg/Segment"),
            pair("/imu/data/stillpoint/turn", "stillpoint_msgs/msg/Turn"),
            pair("/imu/data/stillpoint/noise", "stillpoint_msgs/msg/Noise"),
            pair("/imu/data/stillpoint/coverage", "stillpoint_msgs/msg/Coverage"),
            pair("/imu/data/stillpoint/calibration", "stillpoint_msgs/msg/Calibration"),
            pair("/stillpoint/log", "rcl_interfaces/msg/Log"),
        ]
    );
    assert!(ros2.iter().all(|topic| (&*topic.schema_encoding, &*topic.message_encoding) == ("ros2msg", "cdr")));
    let (protobuf, _) = annotate(Encoding::Protobuf, &events, false);
    let schemas: Vec<_> = protobuf.iter().map(|topic| topic.schema_name.as_str()).collect();
    assert_eq!(
        schemas,
        [
            "stillpoint.Stillness",
            "stillpoint.Segment",
            "stillpoint.Turn",
            "stillpoint.Noise",
            "stillpoint.Coverage",
            "stillpoint.Calibration",
            "foxglove.Log"
        ]
    );
    assert!(
        protobuf.iter().all(|topic| (&*topic.schema_encoding, &*topic.message_encoding) == ("protobuf", "protobuf"))
    );
}

#[test]
fn each_imu_has_its_own_topics_and_all_share_the_log() {
    let [stillness, .., log] = one_of_each();
    let events = [
        ("/b", at(0, stillness.clone())),
        ("/a", at(0, log.clone())),
        ("/a", at(1, stillness.clone())),
        ("/b", at(1, stillness)),
        ("/b", at(1, log)),
    ];
    let (topics, blocks) = annotate(Encoding::Protobuf, &events, false);
    let names: Vec<_> = topics.iter().map(|topic| topic.name.as_str()).collect();
    assert_eq!(names, ["/b/stillpoint/stillness", "/stillpoint/log", "/a/stillpoint/stillness"]);
    let counted: Vec<_> = blocks[0].annotations.iter().map(|a| (a.topic, a.sequence, a.log_time)).collect();
    assert_eq!(counted, [(0, 0, 0), (1, 0, 0), (2, 0, 1), (0, 1, 1), (1, 1, 1)]);
}

#[test]
fn the_end_of_an_input_chunk_closes_a_block_that_holds_a_segment_or_calibration() {
    let lengths = |messages: [Message; 3]| -> Vec<usize> {
        let events = messages.map(|message| ("/imu", at(0, message)));
        annotate(Encoding::Protobuf, &events, true).1.iter().map(|block| block.annotations.len()).collect()
    };
    let [stillness, segment, _, _, coverage, calibration, log] = one_of_each();
    assert_eq!(lengths([stillness.clone(), coverage, log]), [3]);
    assert_eq!(lengths([stillness.clone(), segment, stillness.clone()]), [2, 1]);
    assert_eq!(lengths([calibration, stillness.clone(), stillness]), [1, 2]);
}

#[test]
fn other_programs_read_what_was_written() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let [ros2, protobuf] = [Encoding::Ros2, Encoding::Protobuf].map(|encoding| {
        let path = folder.path().join(format!("{encoding:?}.mcap"));
        write(&path, encoding, &session::events());
        path
    });
    let script = root().join("tests/interop/annotations.py");
    let run = Command::new(python).arg(script).args([ros2, protobuf]).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout) + String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
}

/// Writes a recording of annotations alone.
fn write(path: &Path, encoding: Encoding, events: &[(&str, Event)]) {
    let (topics, blocks) = annotate(encoding, events, false);
    let profile = if encoding == Encoding::Ros2 { "ros2" } else { "" };
    let file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    let mut writer = mcap::WriteOptions::new().profile(profile).create(file).unwrap();
    let ids: Vec<u16> = topics
        .iter()
        .map(|topic| {
            let schema = writer.add_schema(&topic.schema_name, &topic.schema_encoding, &topic.schema).unwrap();
            writer.add_channel(schema, &topic.name, &topic.message_encoding, &BTreeMap::new()).unwrap()
        })
        .collect();
    for annotation in blocks.iter().flat_map(|block| &block.annotations) {
        let header = mcap::records::MessageHeader {
            channel_id: ids[annotation.topic],
            sequence: annotation.sequence,
            log_time: annotation.log_time,
            publish_time: annotation.log_time,
        };
        writer.write_to_known_channel(&header, &annotation.data).unwrap();
    }
    writer.finish().unwrap();
}
