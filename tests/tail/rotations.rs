//! A tail of a session with declared rotations, killed now and then, makes and says what the batch run does.

use std::time::Duration;

use crate::common::Folder;
use crate::common::needs::recording;
use crate::following::Running;
use crate::recorder::{Session, Style};

#[test]
fn declared_rotations_survive_a_kill_and_tail_equals_batch() {
    let Some(input) = recording("nilspod_six_face.ros2.mcap") else { return };
    let session = Session::of(&std::fs::read(input).unwrap());
    let folder = Folder::new();
    let path = folder.path().join("rec.mcap");
    let table = |begin: f64, end: f64, angle: i32| {
        format!("[[fit.rotations]]\nbegin_s = {begin}\nend_s = {end}\nangle_deg = {angle}\n")
    };
    // One that was, and one that was not.
    folder.write("both.toml", [table(66.11, 69.27, 360), table(78.92, 82.08, -3600)].concat().as_bytes());
    let line = "tail rec.mcap -c both.toml";
    std::thread::scope(|scope| {
        let recorder = scope.spawn(|| session.record(&path, Style::default(), 20.0));
        for millis in [1500, 1300] {
            let tail = Running::start(&folder, line);
            std::thread::sleep(Duration::from_millis(millis));
            tail.kill();
        }
        recorder.join().unwrap();
    });
    let tail = Running::start(&folder, line).finish();
    assert_eq!(tail.code, 0, "{}", tail.stderr);
    let batch = folder.say("annotate rec.mcap -c both.toml -o batch.mcap").ok();
    assert!(folder.read("rec.annotated.mcap") == folder.read("batch.mcap"), "tail and batch differ");
    let unused = "fit.rotations declares -3600° about the vertical from 78.92 s to 82.08 s, which is not used: ";
    for run in [tail, batch] {
        assert!(run.stderr.contains(unused), "{}", run.stderr);
    }
}
