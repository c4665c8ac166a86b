//! Recordings of several files: rosbag2 folders, and files that are joined. What is learned goes on from one to the next.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::needs::recording;
use crate::common::{Folder, Run, bag_metadata, finish, program, same_folders};
use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions};
use serde_json::{Value, json};

/// The demonstration, cut into files by share of its messages. Each numbers its channels anew.
fn split(whole: &[u8], shares: &[usize]) -> Vec<Vec<u8>> {
    let messages: Vec<_> = MessageStream::new(whole).unwrap().map(Result::unwrap).collect();
    let total: usize = shares.iter().sum();
    let mut from = 0;
    let mut files = Vec::new();
    for (n, share) in shares.iter().enumerate() {
        let until = if n + 1 == shares.len() { messages.len() } else { from + share * messages.len() / total };
        let mut out = std::io::Cursor::new(Vec::new());
        let mut writer = WriteOptions::new().profile("ros2").compression_threads(0).create(&mut out).unwrap();
        for i in 0..n {
            writer.add_channel(0, &format!("/other{i}"), "cdr", &BTreeMap::new()).unwrap();
        }
        for message in &messages[from..until] {
            let channel = &message.channel;
            let schema = channel.schema.as_ref().unwrap();
            let schema_id = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            let encoding = &channel.message_encoding;
            let channel_id = writer.add_channel(schema_id, &channel.topic, encoding, &channel.metadata).unwrap();
            let (log_time, publish_time) = (message.log_time, message.publish_time);
            let header = MessageHeader { channel_id, sequence: message.sequence, log_time, publish_time };
            writer.write_to_known_channel(&header, &message.data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        files.push(out.into_inner());
        from = until;
    }
    files
}

/// A folder with the demonstration in it, as a whole and as a rosbag2 recording of three files.
fn with_bag() -> Folder {
    let folder = Folder::with_demo();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    let files = split(&folder.read("demo.mcap"), &[3, 1, 2]);
    let names: Vec<String> = (0..files.len()).map(|n| format!("bag_{n}.mcap")).collect();
    names.iter().zip(&files).for_each(|(name, file)| folder.write(&format!("bag/{name}"), file));
    folder.write("bag/metadata.yaml", bag_metadata(&names).as_bytes());
    folder
}

fn imus(run: Run) -> Value {
    run.ok().json()["imus"].clone()
}

/// Runs the program where a process may have so many files open.
fn limited(folder: &Folder, files: usize, line: &str) -> Run {
    let command = format!("ulimit -n {files} && exec {} {line}", program());
    finish(std::process::Command::new("sh").args(["-c", &command]).current_dir(folder.path()))
}

#[test]
fn a_folder_of_more_files_than_may_be_open_is_refused_by_name_and_one_less_is_annotated() {
    const FILES: usize = 60;
    let folder = Folder::with_demo();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    let files = split(&folder.read("demo.mcap"), &[1; FILES]);
    let names: Vec<String> = (0..FILES).map(|n| format!("bag_{n:02}.mcap")).collect();
    names.iter().zip(&files).for_each(|(name, file)| folder.write(&format!("bag/{name}"), file));
    folder.write("bag/metadata.yaml", bag_metadata(&names).as_bytes());
    let joined = names.iter().map(|name| format!("bag/{name}")).collect::<Vec<_>>().join(" ");
    for (limit, line, needed) in [
        (64, "annotate bag --sidecar".to_owned(), "ulimit -n 84"),
        (64, format!("annotate --join {joined} --out-dir out"), "ulimit -n 84"),
        (100, "annotate bag --in-place".to_owned(), "ulimit -n 144), or write a copy (-o)"),
    ] {
        let run = limited(&folder, limit, &line);
        assert_eq!(run.code, 1, "{line}: {}", run.stderr);
        for words in ["60 files are one recording", needed, &format!("this process may open {limit}")] {
            assert!(run.error().contains(words), "{line}: no {words} in {}", run.stderr);
        }
    }
    // What is said to suffice does.
    limited(&folder, 84, "annotate bag --sidecar -q").ok();
    limited(&folder, 84, "annotate bag -o copy -q").ok();
    limited(&folder, 144, "annotate bag --in-place -q").ok();
    same_folders(&folder.path().join("bag"), &folder.path().join("copy"));
    limited(&folder, 200, "strip bag -o back -q").ok();
    names.iter().zip(&files).for_each(|(name, file)| assert!(folder.read(&format!("back/{name}")) == *file, "{name}"));
}

#[test]
fn a_folder_teaches_what_its_files_in_one_would() {
    let folder = with_bag();
    let whole = imus(folder.say("annotate demo.mcap --json"));
    assert_eq!(imus(folder.say("annotate bag --json")), whole);
    assert_eq!(whole[0]["accelerometer"]["status"], "PROVISIONAL");
    assert_eq!(imus(folder.say("export bag --format json")), whole);
    assert_eq!(imus(folder.say("export bag.annotated --format json"))[0]["rests"], whole[0]["rests"]);
    let topics = |line: &str| folder.say(line).ok().json()["topics"].as_array().unwrap().len();
    assert_eq!(topics("topics bag --json"), topics("topics demo.mcap --json") + 2);
}

#[test]
fn the_result_of_a_folder_is_a_folder_that_can_be_undone() {
    let folder = with_bag();
    let path = |name: &str| folder.path().join(name);
    folder.say("annotate bag").ok();
    let names = ["bag_0.mcap", "bag_1.mcap", "bag_2.mcap", "metadata.original.yaml", "metadata.yaml"];
    let mut found: Vec<_> = std::fs::read_dir(path("bag.annotated")).unwrap().map(|e| e.unwrap().file_name()).collect();
    found.sort();
    assert_eq!(found, names);
    let metadata = String::from_utf8(folder.read("bag.annotated/metadata.yaml")).unwrap();
    for line in
        ["fleet: \"07\"", "name: /imu/data_raw/stillpoint/calibration", "offered_qos_profiles: \"\"", "version: 5"]
    {
        assert!(metadata.contains(line), "no {line} in {metadata}");
    }
    folder.say("strip bag.annotated -o back").ok();
    same_folders(&path("back"), &path("bag"));
    folder.refuses("strip bag -o out", 1, &["bag"]);

    // Again, and of the result, and in its place.
    assert!(folder.say("annotate bag").ok().stderr.contains("already the result"));
    folder.refuses("annotate bag --set still.min_fit_s=1.5", 1, &["bag.annotated", "exists and is not the result"]);
    folder.say("annotate bag.annotated -o again").ok();
    same_folders(&path("again"), &path("bag.annotated"));
    folder.say("annotate bag --set still.min_fit_s=1.5 --force").ok();
    folder.say("annotate back --in-place").ok();
    same_folders(&path("back"), &path("again"));
    folder.say("annotate back --in-place").ok();
    folder.say("strip back -o once_more").ok();
    same_folders(&path("once_more"), &path("bag"));
    assert_eq!(folder.names(), ["again", "back", "bag", "bag.annotated", "demo.mcap", "once_more"]);
}

/// Log times and data of the corrected messages in files, one behind the other.
fn corrected(folder: &Folder, files: &[&str]) -> Vec<(u64, Vec<u8>)> {
    let mut found = Vec::new();
    for file in files {
        let bytes = folder.read(file);
        let messages = MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        let messages = messages.filter(|message| message.channel.topic == "/imu/data_raw/stillpoint/corrected");
        found.extend(messages.map(|message| (message.log_time, message.data.into_owned())));
    }
    found
}

#[test]
fn corrected_messages_stand_in_the_file_of_those_they_come_from() {
    let folder = with_bag();
    let files = ["bag.annotated/bag_0.mcap", "bag.annotated/bag_1.mcap", "bag.annotated/bag_2.mcap"];
    for when in ["causal", "final"] {
        folder.say(&format!("annotate demo.mcap --force --set output.corrected={when}")).ok();
        folder.say(&format!("annotate bag --force --set output.corrected={when}")).ok();
        let whole = corrected(&folder, &["demo.annotated.mcap"]);
        assert!(whole.len() > 100, "{when}: {}", whole.len());
        assert!(corrected(&folder, &files) == whole, "{when}: what the files hold is not what one would");
        let counts = files.map(|file| corrected(&folder, &[file]).len());
        if when == "final" {
            let messages = |file: &str| MessageStream::new(&folder.read(file)).unwrap().count();
            let sources = ["bag/bag_0.mcap", "bag/bag_1.mcap", "bag/bag_2.mcap"].map(messages);
            assert_eq!(counts, sources, "every message is corrected where it stands");
        }
        let metadata = String::from_utf8(folder.read("bag.annotated/metadata.yaml")).unwrap();
        assert!(metadata.contains(&format!("message_count: {}\n", whole.len())), "{when}: {metadata}");
        folder.say("strip bag.annotated -o back --force").ok();
        same_folders(&folder.path().join("back"), &folder.path().join("bag"));
    }
}

#[test]
fn joined_files_are_one_recording_in_the_order_of_time() {
    let folder = with_bag();
    for (given, name) in ["b", "a", "c"].iter().zip(["bag_0", "bag_1", "bag_2"]) {
        folder.write(&format!("{given}.mcap"), &folder.read(&format!("bag/{name}.mcap")));
    }
    let whole = imus(folder.say("annotate demo.mcap --json"));
    let run = folder.say("annotate a.mcap b.mcap c.mcap --join --json").ok();
    assert_eq!(run.json()["outputs"], json!(["a.annotated.mcap", "b.annotated.mcap", "c.annotated.mcap"]));
    assert_eq!(imus(run), whole);
    folder.say("strip a.annotated.mcap -o a").ok();
    assert!(folder.read("a") == folder.read("a.mcap"), "each output belongs to its input");
    assert_eq!(imus(folder.say("annotate a.mcap b.mcap c.mcap --join --sidecar -o all.mcap --json")), whole);
    folder.say("annotate bag --sidecar").ok();
    let of_folder = folder.read("bag.stillpoint.mcap");
    assert!(of_folder == folder.read("all.mcap"), "the sidecar of a folder is that of its files");
    folder.refuses("annotate a.mcap b.mcap --join -o out.mcap", 2, &["--out-dir"]);
    folder.refuses("annotate a.mcap bag --join --out-dir out", 1, &["bag: is a folder"]);
}

#[test]
fn a_folder_may_have_more_files_than_a_process_may_open_at_first() {
    const FILES: usize = 40;
    let folder = Folder::with_demo();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    let files = split(&folder.read("demo.mcap"), &[1; FILES]);
    let names: Vec<String> = (0..FILES).map(|n| format!("bag_{n}.mcap")).collect();
    names.iter().zip(&files).for_each(|(name, file)| folder.write(&format!("bag/{name}"), file));
    folder.write("bag/metadata.yaml", bag_metadata(&names).as_bytes());
    let program = program();
    let script = format!("ulimit -Sn {FILES}; exec {program} annotate bag --set output.corrected=final");
    finish(std::process::Command::new("bash").args(["-c", &script]).current_dir(folder.path())).ok();
}

#[test]
fn folders_that_cannot_be_read_are_refused_with_the_true_reason() {
    let folder = with_bag();
    let original = String::from_utf8(folder.read("bag/metadata.yaml")).unwrap();
    let with = |from: &str, to: &str| folder.write("bag/metadata.yaml", original.replace(from, to).as_bytes());
    with("identifier: mcap", "identifier: sqlite3");
    folder.refuses("annotate bag", 1, &["bag: ", "sqlite3", "ros2 bag convert"]);
    with("compression_mode: \"\"", "compression_mode: FILE");
    folder.refuses("annotate bag", 1, &["bag: ", "compressed as a whole"]);
    with("bag_1.mcap", "bag_7.mcap");
    folder.refuses("annotate bag", 1, &["bag: ", "bag_7.mcap, which is missing"]);
    std::fs::remove_file(folder.path().join("bag/metadata.yaml")).unwrap();
    folder.refuses("annotate bag", 1, &["bag: ", "without metadata.yaml", "--join"]);

    // What fails in the midst leaves nothing behind.
    folder.write("bag/metadata.yaml", original.as_bytes());
    folder.write("bag/bag_0.mcap", b"not a recording");
    folder.refuses("annotate bag", 1, &["bag_0.mcap: not an MCAP"]);
    folder.write("bag.annotated", b"a file");
    folder.refuses("annotate bag", 1, &["bag.annotated: is a file"]);
    std::fs::create_dir(folder.path().join("precious")).unwrap();
    folder.write("precious/thesis.tex", b"");
    folder.refuses("annotate bag -o precious --force", 1, &["precious: holds more than a recording"]);
}

#[test]
fn a_folder_that_holds_another_recording_is_not_replaced() {
    let folder = with_bag();
    folder.say("annotate bag").ok();
    folder.write("bag.annotated/night.mcap", b"another");
    folder.refuses("annotate bag --force --set still.min_fit_s=1.5", 1, &["holds night.mcap, which would be lost"]);
    assert_eq!(folder.read("bag.annotated/night.mcap"), b"another");
    std::fs::remove_file(folder.path().join("bag.annotated/night.mcap")).unwrap();
    folder.say("annotate bag --force --set still.min_fit_s=1.5").ok();
    assert_eq!(folder.names(), ["bag", "bag.annotated", "demo.mcap"]);
}

#[test]
fn in_place_changes_all_files_of_a_folder_or_none() {
    let folder = with_bag();
    std::fs::hard_link(folder.path().join("bag/bag_1.mcap"), folder.path().join("second name")).unwrap();
    let before = ["bag/bag_0.mcap", "bag/metadata.yaml"].map(|name| folder.read(name));
    folder.refuses("annotate --in-place bag", 1, &["bag_1.mcap: has further names"]);
    assert!(["bag/bag_0.mcap", "bag/metadata.yaml"].map(|name| folder.read(name)) == before);
    assert!(!folder.path().join("bag/metadata.original.yaml").exists());
}

#[test]
fn a_metadata_file_with_files_of_the_wrong_shape_is_used_as_far_as_it_goes() {
    let folder = with_bag();
    let text = String::from_utf8(folder.read("bag/metadata.yaml")).unwrap();
    let text = text.split("  files:").next().unwrap().to_owned() + "  files: [bag_0.mcap, 7, null]\n";
    folder.write("bag/metadata.yaml", text.as_bytes());
    folder.say("annotate bag").ok();
    folder.write("bag/metadata.yaml", b"rosbag2_bagfile_information: none\n");
    folder.refuses("annotate bag -o other", 1, &["metadata.yaml is none"]);
}

#[test]
fn damage_in_one_file_is_told_with_its_name() {
    let folder = with_bag();
    let file = folder.read("bag/bag_1.mcap");
    folder.write("bag/bag_1.mcap", &file[..file.len() / 2]);
    let run = folder.say("annotate bag --json");
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.stderr.contains("bag_1.mcap: "), "{}", run.stderr);
    folder.say("strip bag.annotated -o back").ok();
    same_folders(&folder.path().join("back"), &folder.path().join("bag"));
}

#[test]
fn a_real_rosbag2_recording_agrees_with_the_same_session_in_a_file() {
    let (Some(bag), Some(file)) = (recording("nilspod_six_face.rosbag2"), recording("nilspod_six_face.ros1.mcap"))
    else {
        return;
    };
    let folder = Folder::new();
    let annotate = |input: &Path, output: &str| {
        imus(folder.run(["annotate".as_ref(), input.as_os_str(), "-o".as_ref(), output.as_ref(), "--json".as_ref()]))
    };
    let (bag, file) = (annotate(&bag, "bag"), annotate(&file, "file.mcap"));
    assert_eq!(bag[0]["accelerometer"]["bias"], file[0]["accelerometer"]["bias"]);
    assert_eq!(bag[0]["rests"], file[0]["rests"]);
}
