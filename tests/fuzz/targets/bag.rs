//! Any `metadata.yaml` beside recordings is read or refused. What is annotated can be annotated again, and strip gives the
//! folder back.

use arbitrary::{Result, Unstructured};
use stillpoint::config::Config;
use stillpoint::run::{self, Access, Input, Options};

use super::session;

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let text = text(u)?;
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    std::fs::write(bag.join("metadata.yaml"), &text).unwrap();
    let recording = session::recording(&mut Unstructured::new(&[]))?;
    std::fs::write(bag.join("bag_0.mcap"), &recording).unwrap();
    if u.arbitrary()? {
        std::fs::write(bag.join("bag_1.mcap"), if u.arbitrary()? { &recording[..] } else { b"" }).unwrap();
    }
    let Ok(input) = Input::open_original(&bag, Access::Read) else { return Ok(()) };
    let config = Config::default();
    let _ = run::channels(&input, &config, &|_| Ok(()));
    let output = folder.path().join("bag.annotated");
    let annotated = run::annotate(&input, std::slice::from_ref(&output), &config, Options::default(), &|_| Ok(()));
    if annotated.is_err() {
        return Ok(());
    }
    let input = Input::open_annotated(&output).expect("what was annotated can be opened");
    let stripped = folder.path().join("bag.stripped");
    run::strip(&input, &stripped, false, false, &|_| Ok(())).expect("and stripped");
    for name in ["metadata.yaml", "bag_0.mcap"] {
        let (before, after) = (std::fs::read(bag.join(name)), std::fs::read(stripped.join(name)));
        // A file that the metadata does not name is left alone.
        if let Ok(after) = after {
            assert!(before.unwrap() == after, "{name} is another one");
        }
    }
    assert!(stripped.join("metadata.yaml").exists());
    Ok(())
}

/// A document like that of rosbag2, line by line, of which some are missing, doubled or something else.
fn text(u: &mut Unstructured<'_>) -> Result<String> {
    let mut text = String::new();
    for line in LINES {
        match u.int_in_range(0..=40)? {
            0 => {}
            1 => text.push_str(&format!("{line}\n{line}\n")),
            2 => text.push_str(&format!("{line}{}\n", u.choose(ODD)?)),
            3 => text.push_str(&format!("{}\n", u.choose(ODD)?)),
            4 => {
                let key = line.split(':').next().unwrap_or_default();
                text.push_str(&format!("{key}: {}\n", u.choose(ODD)?));
            }
            5 => text.push_str(&format!(" {line}\n")),
            _ => text.push_str(&format!("{line}\n")),
        }
    }
    Ok(text)
}

const LINES: &[&str] = &[
    "rosbag2_bagfile_information:",
    "  version: 9",
    "  storage_identifier: mcap",
    "  duration:",
    "    nanoseconds: 5",
    "  starting_time:",
    "    nanoseconds_since_epoch: 10",
    "  message_count: 2",
    "  topics_with_message_count:",
    "    - topic_metadata:",
    "        name: /imu/data_raw",
    "        type: sensor_msgs/msg/Imu",
    "        serialization_format: cdr",
    "        offered_qos_profiles: \"- history: 3\\n  depth: 0\"",
    "      message_count: 2",
    "  compression_format: \"\"",
    "  compression_mode: \"\"",
    "  relative_file_paths:",
    "    - bag_0.mcap",
    "    - bag_1.mcap",
    "  files:",
    "    - path: bag_0.mcap",
    "      starting_time:",
    "        nanoseconds_since_epoch: 10",
    "      duration:",
    "        nanoseconds: 5",
    "      message_count: 2",
    "  custom_data:",
    "    robot: \"07\"",
    "  ros_distro: rolling",
];

const ODD: &[&str] = &[
    "",
    "null",
    "~",
    "[]",
    "{}",
    "a",
    "\"",
    "'",
    "&a [*a]",
    "*a",
    "!!binary aGk=",
    "|",
    ">-",
    "- a",
    "? b",
    "# text",
    "9999999999999999999999",
    "-1",
    "1e999",
    ".nan",
    "yes",
    "\u{0}",
    "é",
    "\t",
    "---",
    "...",
    "<<: {a: 1}",
    "[[[[[[[[[[[[",
    "../a.mcap",
    "/etc/passwd",
    "bag_0.mcap",
    ".",
    "..",
    "bag_0.mcap/",
    "\"a\\u0000b\"",
    "{a: {a: {a: {}}}}",
    "bag_0.mcap bag_1.mcap",
    "\"\\ud800\"",
    "0x10",
    "0o7",
    "07",
];
