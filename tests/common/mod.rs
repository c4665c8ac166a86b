//! A folder with a recording in it, and the program to run there.
#![allow(dead_code, clippy::unwrap_used)]

pub mod needs;
pub mod page;

#[allow(unused_imports)]
pub use needs::{case, recording};

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use stillpoint::simulate::{Scenario, record};

/// The program that is tried: the one that is built with the tests, or another that `STILLPOINT_PROGRAM` names.
pub fn program() -> String {
    std::env::var("STILLPOINT_PROGRAM").unwrap_or_else(|_| env!("CARGO_BIN_EXE_stillpoint").to_owned())
}

/// What a run of the program came to.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Run {
    /// Fails unless the program succeeded.
    pub fn ok(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self
    }

    /// The only line of standard error, which must be an error.
    pub fn error(&self) -> &str {
        let mut lines = self.stderr.lines();
        let line = lines.next().unwrap_or_default();
        assert!(line.starts_with("error: ") && lines.next().is_none(), "not one error: {}", self.stderr);
        line
    }

    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e}: {}", self.stdout))
    }
}

/// A temporary folder that the program runs in.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// One with `demo.mcap`, six faces and two repeats, in it.
    pub fn with_demo() -> Self {
        Self::with_scenario("demo.mcap", &Scenario::builtin("demo").unwrap())
    }

    pub fn with_scenario(name: &str, scenario: &Scenario) -> Self {
        let folder = Self::new();
        let mut bytes = Vec::new();
        record(scenario, &mut bytes).unwrap();
        folder.write(name, &bytes);
        folder
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path().join(name), bytes).unwrap();
    }

    /// The names in the folder, in order.
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs the program here.
    pub fn run<A: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = A>) -> Run {
        finish(Command::new(program()).args(arguments).current_dir(self.path()))
    }

    /// Runs the program with arguments that stand in one line, apart by blanks.
    pub fn say(&self, line: &str) -> Run {
        self.run(line.split_whitespace())
    }

    /// Runs the program and checks that it refuses: this code, one line that holds all of these words, nothing changed.
    pub fn refuses(&self, line: &str, code: i32, words: &[&str]) {
        let before: Vec<_> = self.names().into_iter().map(|name| (self.stamp(&name), name)).collect();
        let run = self.say(line);
        assert_eq!(run.code, code, "{line}: {}", run.stderr);
        let error = run.error();
        words.iter().for_each(|word| assert!(error.contains(word), "{line}: no {word:?} in {error:?}"));
        let after: Vec<_> = self.names().into_iter().map(|name| (self.stamp(&name), name)).collect();
        assert_eq!(after, before, "{line}: something changed");
    }

    fn stamp(&self, name: &str) -> (u64, std::time::SystemTime) {
        let metadata = std::fs::symlink_metadata(self.path().join(name)).unwrap();
        (metadata.len(), metadata.modified().unwrap())
    }
}

/// A `metadata.yaml` as rosbag2 leaves it when it has finished recording into these files.
pub fn bag_metadata(names: &[String]) -> String {
    let listed: String = names.iter().map(|name| format!("    - {name}\n")).collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    nanoseconds: 1\n  \
         starting_time:\n    nanoseconds_since_epoch: 1\n  message_count: 0\n  topics_with_message_count:\n    \
         - topic_metadata:\n        name: /imu/data_raw\n        type: sensor_msgs/msg/Imu\n        \
         serialization_format: cdr\n        offered_qos_profiles: \"- history: 3\\n  depth: 0\"\n      message_count: 0\n  \
         compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n{listed}  fleet: \"07\"\n"
    )
}

/// Two folders hold the same files.
pub fn same_folders(a: &Path, b: &Path) {
    let read = |folder: &Path| -> BTreeMap<_, _> {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
        entries.map(|entry| (entry.file_name(), std::fs::read(entry.path()).unwrap())).collect()
    };
    let (a, b) = (read(a), read(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    assert!(a == b);
}

/// Runs a command to its end.
pub fn finish(command: &mut Command) -> Run {
    let output = command.env("NO_COLOR", "1").stdin(Stdio::null()).output().unwrap();
    Run {
        code: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}
