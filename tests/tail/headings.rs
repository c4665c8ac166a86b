//! A tail of a drive beside a heading reference, killed now and then, makes and says what the batch run does.

use std::time::Duration;

use stillpoint::simulate::Encoding;

use crate::common::Folder;
use crate::drives::{Shown, drive};
use crate::following::Running;
use crate::recorder::{Session, Style};

#[test]
fn headings_survive_a_kill_and_tail_equals_batch() {
    let session = Session::of(&drive(Shown::Odometry(Encoding::Ros2)));
    let folder = Folder::new();
    let path = folder.path().join("rec.mcap");
    folder.write("odom.toml", b"[fit.heading]\ntopic = '/odom'\n");
    let line = "tail rec.mcap -c odom.toml";
    std::thread::scope(|scope| {
        let recorder = scope.spawn(|| session.record(&path, Style::default(), 12.0));
        for millis in [1500, 1300] {
            let tail = Running::start(&folder, line);
            std::thread::sleep(Duration::from_millis(millis));
            tail.kill();
        }
        recorder.join().unwrap();
    });
    let tail = Running::start(&folder, line).finish();
    assert_eq!(tail.code, 0, "{}", tail.stderr);
    let batch = folder.say("annotate rec.mcap -c odom.toml -o batch.mcap --json").ok();
    assert!(folder.read("rec.annotated.mcap") == folder.read("batch.mcap"), "tail and batch differ");
    let gyroscope = &batch.json()["imus"][0]["gyroscope"];
    assert_eq!(gyroscope["combinations"].as_array().map(Vec::len), Some(1), "{gyroscope}");
}
