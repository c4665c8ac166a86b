//! A tail of a sensor that warms, killed now and then, makes what the batch run makes.

use std::time::Duration;

use stillpoint::simulate::{Encoding, record};

use crate::common::Folder;
use crate::following::Running;
use crate::recorder::{Session, Style};
use crate::warm::warming;

#[test]
fn temperatures_survive_a_kill_and_tail_equals_batch() {
    let mut bytes = Vec::new();
    record(&warming(Encoding::Ros2, 25.0, 0.3), &mut bytes).unwrap();
    let session = Session::of(&bytes);
    let folder = Folder::new();
    let path = folder.path().join("rec.mcap");
    let config = "[[imu]]\ntopic = '/imu/data_raw'\ntemperature = { topic = '/imu/temperature' }\n";
    folder.write("warm.toml", config.as_bytes());
    let line = "tail rec.mcap -c warm.toml --set output.corrected=causal";
    std::thread::scope(|scope| {
        let recorder = scope.spawn(|| session.record(&path, Style::default(), 120.0));
        for millis in [1500, 1200, 1700] {
            let tail = Running::start(&folder, line);
            std::thread::sleep(Duration::from_millis(millis));
            tail.kill();
        }
        recorder.join().unwrap();
    });
    let run = Running::start(&folder, line).finish();
    assert_eq!(run.code, 0, "{}", run.stderr);
    folder.say("annotate rec.mcap -c warm.toml --set output.corrected=causal -o batch.mcap -q").ok();
    assert!(folder.read("rec.annotated.mcap") == folder.read("batch.mcap"), "tail and batch differ");
    let json = folder.say("export batch.mcap --format json").ok().json();
    assert!(json["imus"][0]["gyroscope"]["temperature"].is_object(), "{json}");
}
