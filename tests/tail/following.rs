//! A `stillpoint tail` that runs beside the test.

use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Folder, Run};

/// A running program.
pub struct Running(Child, [File; 2]);

impl Running {
    /// Starts the program in the folder, with arguments that stand in one line.
    pub fn start(folder: &Folder, line: &str) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.args(line.split_whitespace()).current_dir(folder.path()).env("NO_COLOR", "1");
        // Files, since nobody reads a pipe meanwhile.
        let said = [tempfile::tempfile().unwrap(), tempfile::tempfile().unwrap()];
        let [stdout, stderr] = said.each_ref().map(|file| file.try_clone().unwrap());
        Self(command.stdin(Stdio::null()).stdout(stdout).stderr(stderr).spawn().unwrap(), said)
    }

    /// The same, with standard error in a file of the folder.
    pub fn start_logged(folder: &Folder, line: &str, log: &str) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.args(line.split_whitespace()).current_dir(folder.path()).env("NO_COLOR", "1").stdin(Stdio::null());
        let options = File::options().read(true).write(true).create(true).truncate(true).clone();
        let log = options.open(folder.path().join(log)).unwrap();
        let said = [tempfile::tempfile().unwrap(), log.try_clone().unwrap()];
        Self(command.stdout(Stdio::null()).stderr(log).spawn().unwrap(), said)
    }

    pub fn id(&self) -> u32 {
        self.0.id()
    }

    pub fn has_ended(&mut self) -> bool {
        self.0.try_wait().unwrap().is_some()
    }

    /// Ends it as a power failure would.
    pub fn kill(mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    /// Waits for its end.
    pub fn finish(mut self) -> Run {
        let began = Instant::now();
        while !self.has_ended() {
            if began.elapsed() > Duration::from_secs(300) {
                self.0.kill().unwrap();
                panic!("still running after five minutes");
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        let code = self.0.wait().unwrap().code().unwrap_or(-1);
        let [stdout, stderr] = self.1.map(|mut file| {
            let mut text = String::new();
            file.rewind().and_then(|()| file.read_to_string(&mut text)).unwrap();
            text
        });
        Run { code, stdout, stderr }
    }
}

/// Waits until a condition holds.
pub fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < Duration::from_secs(60), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Which file stands there, and when it was written; a checkpoint is replaced with each save.
pub fn saved(checkpoint: &Path) -> Option<(u64, i64, i64)> {
    let metadata = std::fs::metadata(checkpoint).ok()?;
    Some((metadata.ino(), metadata.mtime(), metadata.mtime_nsec()))
}

/// Lets a tail run until it has saved where it stands, or `is_over`, and kills it.
pub fn kill_when_saved(tail: Running, checkpoint: &Path, before: Option<(u64, i64, i64)>, is_over: impl Fn() -> bool) {
    wait_for("a checkpoint", || is_over() || saved(checkpoint).is_some_and(|now| before != Some(now)));
    tail.kill();
}

/// Length of a file, 0 if it is not there.
pub fn length(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// What the batch path makes of `rec.mcap` must be what the tail made of it.
pub fn assert_as_batch(folder: &Folder, context: &str) {
    let run = folder.say("annotate rec.mcap -o batch.mcap --accept-damage -q");
    assert_eq!(run.code, 0, "{context}: {}", run.stderr);
    assert!(folder.read("rec.annotated.mcap") == folder.read("batch.mcap"), "{context}: tail and batch differ");
}
