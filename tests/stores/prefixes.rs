//! Prefixes of a bucket: lists, folders that are kept, a service, and what does or does not pass.

use std::io::{BufRead as _, BufReader, Lines};
use std::process::{Child, ChildStdout, Stdio};

use serde_json::Value;
use stillpoint::simulate::{Scenario, record};

use crate::bucket::Bucket;
use crate::common::Folder;

/// A demo, each with noise of its own, and its local sidecar.
fn demo(folder: &Folder, seed: u64) -> (Vec<u8>, Vec<u8>) {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.recording.seed = seed;
    let mut bytes = Vec::new();
    record(&scenario, &mut bytes).unwrap();
    folder.write("local.mcap", &bytes);
    folder.say("annotate local.mcap --sidecar --force -q").ok();
    (bytes, folder.read("local.stillpoint.mcap"))
}

fn outcomes(folder: &Folder) -> Vec<String> {
    let text = String::from_utf8(folder.read("outcome.jsonl")).unwrap();
    let outcome = |line: &str| serde_json::from_str::<Value>(line).unwrap()["outcome"].as_str().unwrap().to_owned();
    text.lines().map(outcome).collect()
}

#[test]
fn folders_below_a_prefix_are_kept_in_the_folder_of_the_results() {
    let (folder, bucket) = (Folder::new(), Bucket::new(|_| None));
    let ((one, of_one), (two, of_two)) = (demo(&folder, 1), demo(&folder, 2));
    bucket.put("in/s01/r.mcap", &one);
    bucket.put("in/s02/r.mcap", &two);
    bucket.put("in/top.mcap", &one);
    bucket.say(&folder, "annotate s3://bucket/in/ --out-dir s3://bucket/out/ -q").ok();
    let names = ["out/s01/r.stillpoint.mcap", "out/s02/r.stillpoint.mcap", "out/top.stillpoint.mcap"];
    assert_eq!(bucket.keys("out/"), names);
    assert!(bucket.get(names[0]) == of_one && bucket.get(names[1]) == of_two);
    bucket.say(&folder, "annotate s3://bucket/in/ --out-dir s3://bucket/out --manifest outcome.jsonl -q").ok();
    assert_eq!(outcomes(&folder), ["skipped"; 3], "the same places");
    bucket.say(&folder, "annotate s3://bucket/in/ --out-dir out -q").ok();
    assert!(folder.read("out/s02/r.stillpoint.mcap") == of_two);
}

/// A watch, and the lines that it says.
struct Watch(Child, Lines<BufReader<ChildStdout>>);

impl Watch {
    fn of(bucket: &Bucket, folder: &Folder) -> Self {
        let mut command = bucket.command(folder, "--json watch s3://bucket/w --interval 100ms -q");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        Self(child, lines)
    }

    fn next(&mut self) -> (String, String) {
        let line: Value = serde_json::from_str(&self.1.next().unwrap().unwrap()).unwrap();
        (line["event"].as_str().unwrap().to_owned(), line["input"].as_str().unwrap().to_owned())
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_recording_that_is_replaced_under_a_watched_prefix_is_annotated_anew() {
    let (folder, bucket) = (Folder::new(), Bucket::new(|_| None));
    let ((one, of_one), (two, of_two), (three, of_three)) = (demo(&folder, 1), demo(&folder, 2), demo(&folder, 3));
    let annotated = |name: &str| ("annotated".to_owned(), format!("s3://bucket/w/{name}"));
    let mut watch = Watch::of(&bucket, &folder);
    bucket.put("w/1.mcap", &one);
    assert_eq!(watch.next(), annotated("1.mcap"));
    assert!(bucket.get("w/1.stillpoint.mcap") == of_one);
    bucket.put("w/1.mcap", &two);
    assert_eq!(watch.next(), annotated("1.mcap"));
    assert!(bucket.get("w/1.stillpoint.mcap") == of_two);
    drop(watch);
    // Replaced while nobody watched. What was not is left as it is.
    bucket.put("w/1.mcap", &three);
    bucket.put("w/0.mcap", &one);
    bucket.say(&folder, "annotate s3://bucket/w/0.mcap -q").ok();
    let mut watch = Watch::of(&bucket, &folder);
    assert_eq!(watch.next(), annotated("1.mcap"));
    assert!(bucket.get("w/1.stillpoint.mcap") == of_three);
    let puts = bucket.requests().iter().filter(|line| line.starts_with("PUT") && line.contains("/0.still")).count();
    assert_eq!(puts, 1);
}

#[test]
fn credentials_that_expire_in_the_middle_of_a_list_leave_the_rest_to_the_next_attempt() {
    let folder = Folder::new();
    for status in ["400 Bad Request", "403 Forbidden"] {
        let trouble: crate::bucket::Trouble = match status {
            "400 Bad Request" => {
                |line| line.contains("/2.").then_some(("400 Bad Request", "<Code>ExpiredToken</Code>"))
            }
            _ => |line| line.contains("/2.").then_some(("403 Forbidden", "<Code>ExpiredToken</Code>")),
        };
        let bucket = Bucket::new(trouble);
        let (recording, _) = demo(&folder, 1);
        bucket.put("in/1.mcap", &recording);
        bucket.put("in/2.mcap", &recording);
        let run = bucket.say(&folder, "annotate s3://bucket/in/ --manifest outcome.jsonl -q");
        assert_eq!(run.code, 5, "{}", run.stderr);
        assert!(run.stderr.contains("the credentials have expired; renew them"), "{}", run.stderr);
        assert_eq!(outcomes(&folder), ["written", "passing"], "{status}");
    }
}

#[test]
fn what_no_attempt_mends_is_no_passing_trouble() {
    let folder = Folder::new();
    let bucket = Bucket::new(|line| line.starts_with("PROPFIND").then_some(("501 Not Implemented", "")));
    let run = bucket.say(&folder, &format!("annotate {}/run/ -q", bucket.web()));
    assert!(run.code == 1 && run.error().contains("name each by itself"), "{}: {}", run.code, run.stderr);
    let mut command = bucket.command(&folder, "annotate az://robots/17.mcap -q");
    command.env_remove("AZURE_STORAGE_ACCOUNT_NAME");
    let run = crate::common::finish(&mut command);
    assert!(run.code == 1 && run.error().contains("AZURE_STORAGE_ACCOUNT_NAME"), "{}: {}", run.code, run.stderr);
    assert!(!run.stderr.contains("AWS"), "{}", run.stderr);
}
