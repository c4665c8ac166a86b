//! What cannot be read, and what is said of it: schemas that define nothing, messages that are compressed one by one, files
//! that are no recordings.

use std::collections::BTreeMap;
use std::io::Cursor;

use crate::common::Folder;

/// A recording of 20 messages on one topic.
fn recording(schema: Option<(&str, &str, &[u8])>, encoding: &str, message: &[u8]) -> Folder {
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut out).unwrap();
    let schema = schema.map_or(0, |(name, language, data)| writer.add_schema(name, language, data).unwrap());
    let channel_id = writer.add_channel(schema, "/imu/data_raw", encoding, &BTreeMap::new()).unwrap();
    for i in 0..20 {
        let log_time = 1_000_000_000 + 10_000_000 * u64::from(i);
        let header = mcap::records::MessageHeader { channel_id, sequence: i, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, message).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let folder = Folder::new();
    folder.write("a.mcap", &out.into_inner());
    folder
}

const IMU: &str = "sensor_msgs/msg/Imu";
const PLACEHOLDER: &str = "uint8 structure_needs_at_least_one_member\n";
const IDL: &str = "module sensor_msgs { module msg { struct Imu { uint8 structure_needs_at_least_one_member; }; }; };";

#[test]
fn a_schema_that_defines_nothing_is_called_empty_and_no_mapping_of_it_is_advised() {
    for (schema, encoding, words) in [
        ((IMU, "ros2msg", &b""[..]), "cdr", "the schema sensor_msgs/msg/Imu is empty: "),
        ((IMU, "ros2msg", b" \n\n"), "cdr", "the schema sensor_msgs/msg/Imu is empty: "),
        ((IMU, "", b""), "cdr", "the schema sensor_msgs/msg/Imu is empty: "),
        (("", "", b""), "cdr", "the schema is empty: "),
        (("foo.Imu", "protobuf", b""), "protobuf", "the schema foo.Imu is empty: "),
        (
            (IMU, "ros2msg", PLACEHOLDER.as_bytes()),
            "cdr",
            "the schema sensor_msgs/msg/Imu is empty but for a placeholder: ",
        ),
        ((IMU, "ros2idl", IDL.as_bytes()), "cdr", "the schema sensor_msgs/msg/Imu is empty but for a placeholder: "),
    ] {
        let folder = recording(Some(schema), encoding, &[0, 1, 0, 0, 0]);
        folder.refuses("annotate a.mcap", 1, &[words, "give the recording its schema"]);
        let error = folder.say("annotate a.mcap").stderr;
        assert!(!error.contains("map one") && !error.contains("nearest") && !error.contains("  is"), "{error}");
        let verdict = folder.say("topics a.mcap").ok().stdout;
        assert!(verdict.contains(&format!("skipped: {words}")), "{verdict}");
    }
}

#[test]
fn a_message_that_is_meant_to_hold_nothing_is_no_fault() {
    let folder = recording(Some(("std_msgs/msg/Empty", "ros2msg", PLACEHOLDER.as_bytes())), "cdr", &[0, 1, 0, 0, 0]);
    let said = folder.say("topics a.mcap").ok().stdout;
    assert!(said.contains("not an IMU") && !said.contains("skipped"), "{said}");
}

#[test]
fn messages_compressed_one_by_one_are_named_with_what_decompresses_them() {
    let definition = "std_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 linear_acceleration\n\
                      ===\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
                      ===\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
    // A zstd frame, as rosbag2's compression_mode MESSAGE leaves it in a file without its folder.
    let zstd = [0x28, 0xb5, 0x2f, 0xfd, 0x20, 0x05, 0x29, 0x00, 0x00, 0, 1, 0, 0, 0];
    let folder = recording(Some((IMU, "ros2msg", definition.as_bytes())), "cdr", &zstd);
    let words = ["zstd: each message is compressed", "compression_mode MESSAGE", "`ros2 bag convert` decompresses"];
    folder.refuses("annotate a.mcap", 1, &words);
    let run = folder.say("annotate a.mcap -o b.mcap --allow-no-imu").ok();
    let topics = folder.say("topics a.mcap").ok();
    for (said, of) in [(&run.stderr, "annotate"), (&topics.stdout, "topics")] {
        words.iter().for_each(|word| assert!(said.contains(word), "{of}: no {word:?} in {said}"));
    }
    folder.refuses("report b.mcap", 1, &words);
}

#[test]
fn a_channel_without_messages_is_called_so() {
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut out).unwrap();
    let text = b"geometry_msgs/Vector3 angular_velocity\ngeometry_msgs/Vector3 linear_acceleration\n===\n\
                 MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
    let schema = writer.add_schema(IMU, "ros2msg", text).unwrap();
    writer.add_channel(schema, "/imu/data_raw", "cdr", &BTreeMap::new()).unwrap();
    writer.finish().unwrap();
    drop(writer);
    let folder = Folder::new();
    folder.write("a.mcap", &out.into_inner());
    folder.refuses("annotate a.mcap", 1, &["/imu/data_raw has no messages"]);
    folder.say("annotate a.mcap -o b.mcap --allow-no-imu").ok();
    folder.refuses("report b.mcap", 1, &["/imu/data_raw has no messages"]);
}

#[test]
fn a_pointer_in_utf_16_and_a_file_of_zeros_are_called_what_they_are() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n";
    let wide = |bytes: fn(u16) -> [u8; 2]| pointer.encode_utf16().flat_map(bytes).collect::<Vec<_>>();
    let folder = Folder::new();
    for (bytes, words) in [
        ([&[0xff, 0xfe][..], &wide(u16::to_le_bytes)].concat(), "git lfs pull"),
        ([&[0xfe, 0xff][..], &wide(u16::to_be_bytes)].concat(), "git lfs pull"),
        ([b"\xef\xbb\xbf", pointer.as_bytes()].concat(), "git lfs pull"),
        (vec![0; 5000], "nothing but zeros"),
        (b"versatile, as text is\n".to_vec(), "text, CSV perhaps"),
        (vec![0, 0, 0, 7, 1, 2, 3, 4, 5], "it begins with"),
    ] {
        folder.write("a.mcap", &bytes);
        folder.refuses("annotate a.mcap -o b.mcap", 1, &[words]);
    }
}
