//! Recordings without an IMU, from other writers and for other reasons odd: each is annotated, or refused with the true
//! reason, and comes back byte for byte.

use crate::common::needs::data;
use crate::common::{Folder, finish};

/// The file, the code that annotating it ends with, and words of why it is refused.
const EXPECTED: [(&str, i32, &str); 22] = [
    ("cratesio_mcap0.26_chunk_not_closed", 3, "no topics at all"),
    ("cratesio_mcap0.26_compressed", 0, "/tf (tf2_msgs/TFMessage)"),
    ("cratesio_mcap0.26_uncompressed", 0, "/tf (tf2_msgs/TFMessage)"),
    ("cratesio_mcap0.26_zstd_chunk_with_padding", 0, "no topics at all"),
    ("rosbag2_bag_with_topics_and_service_events", 0, "/events/write_split (rosbag2_interfaces/msg/WriteSplitEvent)"),
    ("rosbag2_cdr_test_0", 0, "/test_topic (test_msgs/msg/BasicTypes)"),
    ("rosbag2_multiple_files_0", 0, "/chatter (std_msgs/msg/String)"),
    ("rosbag2_multiple_files_1", 0, "/chatter (std_msgs/msg/String)"),
    ("rosbag2_multiple_files_2", 0, "/chatter (std_msgs/msg/String)"),
    ("rosbag2_only_services", 0, "/add_two_ints/_service_event"),
    ("rosbag2_only_topics", 0, "/rosout (rcl_interfaces/msg/Log)"),
    ("rosbag2_rewriter_a_0", 0, "b_basictypes (test_msgs/msg/BasicTypes)"),
    ("rosbag2_rewriter_b_0", 0, "c_strings (test_msgs/msg/Strings)"),
    ("rosbag2_talker", 0, "/topic (std_msgs/msg/String)"),
    ("rosbag2_test_bag_for_seek_0", 0, "topic1 (test_msgs/BasicTypes)"),
    ("rosbag2_topics_and_services", 0, "/add_two_ints/_service_event"),
    ("rosbag2_wbag_0", 0, "AAA (std_msgs/msg/String)"),
    ("rosbag2_wbag_1", 0, "AAA (std_msgs/msg/String)"),
    ("rosbag2_wbag_2", 0, "AAA (std_msgs/msg/String)"),
    ("rosbag2_wbag_3", 0, "AAA (std_msgs/msg/String)"),
    ("rosbag2_wbag_4", 0, "AAA (std_msgs/msg/String)"),
    ("rosbag2_wrong_rmw_test_0", 0, "wrong_format"),
];

#[test]
fn every_file_is_annotated_or_refused_with_the_true_reason() {
    let Some(containers) = data("containers") else { return };
    let mut found: Vec<_> = std::fs::read_dir(&containers).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    assert_eq!(found.len(), EXPECTED.len());
    for (path, (name, code, reason)) in found.iter().zip(EXPECTED) {
        assert_eq!(path.file_stem().unwrap(), name);
        let folder = Folder::new();
        let original = std::fs::read(path).unwrap();
        folder.write("in.mcap", &original);
        folder.refuses("annotate in.mcap", 1, &["in.mcap: no usable IMU topic", reason]);
        let run = folder.say("annotate in.mcap --allow-no-imu -o out.mcap");
        assert_eq!(run.code, code, "{name}: {}", run.stderr);
        folder.say("strip out.mcap -o back.mcap").ok();
        assert!(folder.read("back.mcap") == original, "{name}");
        if name.contains("wrong_rmw") {
            assert!(run.stderr.contains("/test_topic") && run.stderr.contains("wrong_format"), "{}", run.stderr);
        }
        if name.contains("not_closed") {
            assert!(run.stderr.contains("at byte 39: the recording ends in a chunk that was never closed"));
        }
    }
}

#[test]
fn no_claim_of_a_file_allocates_what_it_does_not_hold() {
    let folder = Folder::new();
    let record = |opcode: u8, claims: u64, body: &[u8]| {
        [&[opcode][..], &(body.len() as u64 + claims).to_le_bytes(), body].concat()
    };
    let head = [mcap::MAGIC, &record(1, 0, &[0; 8])].concat();
    let chunk = |uncompressed: u64, compressed: u64, compression: &str| {
        let name = [&(compression.len() as u32).to_le_bytes()[..], compression.as_bytes()].concat();
        let data = zstd::bulk::compress(&[0; 40], 1).unwrap();
        let length = if compressed == 0 { data.len() as u64 } else { compressed };
        [&[0; 16][..], &uncompressed.to_le_bytes(), &[0; 4], &name, &length.to_le_bytes(), &data].concat()
    };
    let hostile = [
        record(6, 0, &chunk(4 << 30, 0, "zstd")),
        record(6, 0, &chunk(1 << 30, 0, "zstd")),
        record(6, 0, &chunk(1 << 30, 0, "lz4")),
        record(6, 0, &chunk(40, 4 << 30, "zstd")),
        record(5, 4 << 30, &[0; 22]),
        record(3, 0, &[1, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0, 0, 0, 0, 0]),
        record(9, 0, &[0xFF; 60]),
        record(0x0C, 0, &[0xFF; 20]),
    ];
    folder.write("hostile.mcap", &[head, hostile.concat()].concat());
    // Less address space than the least of the claims, and the program and its threads take a part of it.
    let script = format!(
        "ulimit -v 900000; exec {} annotate hostile.mcap --allow-no-imu --accept-damage",
        env!("CARGO_BIN_EXE_stillpoint")
    );
    let run = finish(std::process::Command::new("bash").args(["-c", &script]).current_dir(folder.path())).ok();
    assert!(run.stderr.contains("uncompressed bytes"), "{}", run.stderr);
}
