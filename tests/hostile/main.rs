//! What a stranger, a broken disk or a hostile file may do to Stillpoint, and what must not come of it.
#![allow(clippy::unwrap_used)]

mod bounds;
#[path = "../common/mod.rs"]
mod common;
mod faults;
mod hangs;
mod itself;
mod planted;
mod printed;
mod service;
mod specials;
#[cfg(feature = "live")]
mod viewers;

use std::fs::File;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::{Folder, Run, finish};

const PROGRAM: &str = env!("CARGO_BIN_EXE_stillpoint");

/// Runs a script in a folder, in which `$STILLPOINT` is the program.
fn shell(folder: &Folder, script: &str) -> Run {
    finish(Command::new("bash").args(["-c", script]).env("STILLPOINT", PROGRAM).current_dir(folder.path()))
}

/// Watches a folder until `done` with what was said, then ends the watch, which must stop soon.
fn watch(folder: &Folder, arguments: &str, done: impl Fn(&str) -> bool) -> String {
    let said = folder.path().join(".said");
    let mut watch = Command::new(PROGRAM)
        .args(["watch", ".", "--interval", "50ms", "--idle-timeout", "100ms"])
        .args(arguments.split_whitespace())
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&said).unwrap())
        .spawn()
        .unwrap();
    let text = || std::fs::read_to_string(&said).unwrap();
    let until = |patience: u64, done: &mut dyn FnMut() -> bool| {
        let began = Instant::now();
        while !done() {
            assert!(began.elapsed() < Duration::from_secs(patience), "waited too long: {}", text());
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    until(60, &mut || done(&text()));
    assert!(Command::new("kill").arg(watch.id().to_string()).status().unwrap().success());
    until(20, &mut || watch.try_wait().unwrap().is_some());
    assert_eq!(watch.wait().unwrap().code(), Some(0), "{}", text());
    let said = text();
    std::fs::remove_file(folder.path().join(".said")).unwrap();
    said
}
