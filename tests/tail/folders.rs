//! A rosbag2 folder is followed from file to file, and its result is the batch run's.

use std::time::Duration;

use crate::common::{Folder, Run, same_folders};
use crate::following::{Running, kill_when_saved, length, saved, wait_for};
use crate::recorder::{Session, Style};

fn assert_folder_as_batch(folder: &Folder, context: &str) {
    let run = folder.say("annotate bag -o batch --force --accept-damage -q");
    assert_eq!(run.code, 0, "{context}: {}", run.stderr);
    same_folders(&folder.path().join("bag.annotated"), &folder.path().join("batch"));
}

fn result(run: &Run) -> serde_json::Value {
    serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap()
}

#[test]
fn a_folder_is_followed_from_file_to_file() {
    let session = Session::six_faces();
    for (parts, start) in [(1, ""), (4, ""), (12, "bag_2.mcap"), (3, "metadata.yaml")] {
        let context = format!("{parts} files, started with {start:?}");
        let folder = Folder::new();
        let bag = folder.path().join("bag");
        let arguments = "tail bag --json --keep-sidecar";
        let run = std::thread::scope(|scope| {
            let early = start.is_empty().then(|| Running::start(&folder, arguments));
            let recorder = scope.spawn(|| session.record_bag(&bag, parts, Style::default(), 100.0));
            let tail = early.unwrap_or_else(|| {
                wait_for(start, || bag.join(start).exists());
                Running::start(&folder, arguments)
            });
            recorder.join().unwrap();
            tail.finish()
        });
        assert_eq!(run.code, 0, "{context}: {}", run.stderr);
        assert_eq!(result(&run)["messages"], session.len(), "{context}");
        assert_eq!(run.stdout.matches(r#""event":"split""#).count(), parts - 1, "{context}");
        assert_eq!(folder.names(), ["bag", "bag.annotated", "bag.stillpoint.mcap"], "{context}");
        assert_folder_as_batch(&folder, &context);
        folder.say("annotate bag --sidecar -o batch.mcap -q").ok();
        assert!(folder.read("bag.stillpoint.mcap") == folder.read("batch.mcap"), "{context}");
        let run = folder.say("tail bag").ok();
        assert!(run.stderr.contains("nothing to do"), "{context}: {}", run.stderr);
    }
}

#[test]
fn a_tail_of_a_folder_that_is_killed_goes_on_in_the_file_where_it_was() {
    let session = Session::six_faces();
    let folder = Folder::new();
    let (bag, checkpoint) = (folder.path().join("bag"), folder.path().join("bag.stillpoint.checkpoint"));
    let mut went_on = 0;
    std::thread::scope(|scope| {
        let recorder = scope.spawn(|| session.record_bag(&bag, 5, Style::default(), 12.0));
        while !recorder.is_finished() {
            let before = saved(&checkpoint);
            let tail = Running::start_logged(&folder, "tail bag", "log");
            kill_when_saved(tail, &checkpoint, before, || recorder.is_finished());
            went_on += String::from_utf8_lossy(&folder.read("log")).matches("going on at byte").count();
        }
    });
    assert!(went_on > 2, "{went_on}");
    Running::start(&folder, "tail bag").finish().ok();
    assert_folder_as_batch(&folder, "after kills");
    assert_eq!(folder.names(), ["bag", "bag.annotated", "batch", "log"]);
}

#[test]
fn a_folder_whose_recorder_dies_is_annotated_as_its_files_would_be() {
    let session = Session::six_faces();
    let folder = Folder::new();
    session.record_bag(&folder.path().join("bag"), 3, Style::default(), f64::INFINITY);
    std::fs::remove_file(folder.path().join("bag/metadata.yaml")).unwrap();
    let run = folder.say("tail bag --idle-timeout 300ms");
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.stderr.contains("the recorder has not finished it"), "{}", run.stderr);
    std::fs::create_dir(folder.path().join("batch")).unwrap();
    folder.say("annotate bag/bag_0.mcap bag/bag_1.mcap bag/bag_2.mcap --join --out-dir batch").ok();
    for n in 0..3 {
        let (one, other) = (format!("bag.annotated/bag_{n}.mcap"), format!("batch/bag_{n}.annotated.mcap"));
        assert!(folder.read(&one) == folder.read(&other), "{one}");
    }
    let run = folder.say("tail bag --idle-timeout 300ms").ok();
    assert!(run.stderr.contains("nothing to do"), "{}", run.stderr);
    assert_eq!(folder.names(), ["bag", "bag.annotated", "batch"]);
}

#[test]
fn a_file_that_its_recorder_left_for_the_next_one_is_damaged_as_for_the_batch_run() {
    let parts = Session::six_faces().parts(2);
    let folder = Folder::new();
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    let run = std::thread::scope(|scope| {
        let tail = Running::start(&folder, "tail bag --json");
        let half = parts[0].len() / 2;
        parts[0].record_while(&bag.join("bag_0.mcap"), Style::default(), f64::INFINITY, |written| written < half);
        scope.spawn(|| parts[1].record(&bag.join("bag_1.mcap"), Style::default(), 100.0)).join().unwrap();
        let names = ["bag_0.mcap", "bag_1.mcap"].map(str::to_owned);
        std::fs::write(bag.join("metadata.yaml"), crate::common::bag_metadata(&names)).unwrap();
        tail.finish()
    });
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.stderr.contains("bag_0.mcap"), "{}", run.stderr);
    assert_folder_as_batch(&folder, "a file that was left");
}

#[test]
fn a_folder_that_vanishes_leaves_its_annotations() {
    let session = Session::six_faces();
    let folder = Folder::new();
    let bag = folder.path().join("bag");
    session.record_bag(&bag, 2, Style::default(), f64::INFINITY);
    std::fs::remove_file(bag.join("metadata.yaml")).unwrap();
    let tail = Running::start(&folder, "tail bag");
    let sidecar = folder.path().join("bag.stillpoint.mcap");
    wait_for("annotations", || length(&sidecar) > 20_000);
    std::fs::remove_dir_all(&bag).unwrap();
    let run = tail.finish();
    assert!(run.stderr.contains("was deleted"), "{}", run.stderr);
    assert_eq!(folder.names(), ["bag.stillpoint.mcap"]);
    assert!(mcap::MessageStream::new(&folder.read("bag.stillpoint.mcap")).unwrap().count() > 20);
}

#[test]
fn a_folder_that_is_no_recording_is_refused_with_the_true_reason() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    folder.refuses("tail bag --idle-timeout 100ms -q", 1, &["bag: nothing was recorded"]);
    let text =
        crate::common::bag_metadata(&["bag_0.db3".to_owned()]).replace("identifier: mcap", "identifier: sqlite3");
    folder.write("bag/metadata.yaml", text.as_bytes());
    folder.refuses("tail bag -q", 1, &["bag: ", "sqlite3", "ros2 bag convert"]);
}

#[test]
fn a_file_in_which_nothing_was_recorded_does_not_undo_the_ones_before() {
    let session = Session::six_faces();
    for blank in [vec![], vec![0; 5000], b"PK".to_vec()] {
        let folder = Folder::new();
        let bag = folder.path().join("bag");
        session.record_bag(&bag, 2, Style::default(), f64::INFINITY);
        std::fs::remove_file(bag.join("metadata.yaml")).unwrap();
        folder.write("bag/bag_2.mcap", &blank);
        let run = folder.say("tail bag --idle-timeout 300ms");
        assert_eq!(run.code, 3, "{}", run.stderr);
        assert!(run.stderr.contains("bag_2.mcap"), "{}", run.stderr);
        assert!(folder.read("bag.annotated/bag_2.mcap") == blank);
        assert_eq!(folder.names(), ["bag", "bag.annotated"]);
        let run = folder.say("tail bag --idle-timeout 300ms").ok();
        assert!(run.stderr.contains("nothing to do"), "{}", run.stderr);

        // One that stands between the others, too.
        let files = "bag/bag_0.mcap bag/bag_2.mcap bag/bag_1.mcap";
        let run = folder.say(&format!("annotate {files} --join --out-dir ."));
        assert!(run.code == 3 && run.stderr.contains("bag_2.mcap"), "{}", run.stderr);
        for n in 0..2 {
            assert!(
                folder.read(&format!("bag.annotated/bag_{n}.mcap")) == folder.read(&format!("bag_{n}.annotated.mcap"))
            );
        }

        let names = ["bag_0.mcap", "bag_2.mcap", "bag_1.mcap"].map(str::to_owned);
        folder.write("bag/metadata.yaml", crate::common::bag_metadata(&names).as_bytes());
        let run = folder.say("annotate bag -o whole");
        assert_eq!(run.code, 3, "{}", run.stderr);
        assert!(run.stderr.contains("bag_2.mcap"), "{}", run.stderr);
        assert!(folder.say("annotate bag -o whole").stderr.contains("nothing to do"));
        folder.say("strip whole -o again").ok();
        same_folders(&bag, &folder.path().join("again"));
        for line in ["report bag -o report.html", "export bag --format json"] {
            let run = folder.say(line);
            assert_eq!(run.code, 3, "{line}: {}", run.stderr);
        }
        assert!(String::from_utf8(folder.read("report.html")).unwrap().contains("bag_2.mcap"));
    }
}

#[test]
fn a_file_whose_beginning_comes_late_is_waited_for() {
    let parts = Session::six_faces().parts(2);
    let folder = Folder::new();
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    parts[0].record(&bag.join("bag_0.mcap"), Style::default(), f64::INFINITY);
    parts[1].record(&folder.path().join("second"), Style::default(), f64::INFINITY);
    let second = folder.read("second");
    // Its place on the disk was taken in advance.
    folder.write("bag/bag_1.mcap", &vec![0; second.len()]);
    let tail = Running::start(&folder, "tail bag --json");
    wait_for("the second file", || length(&folder.path().join("bag.stillpoint.mcap")) > 2000);
    std::thread::sleep(Duration::from_millis(300));
    let file = std::fs::File::options().write(true).open(bag.join("bag_1.mcap")).unwrap();
    std::io::Write::write_all(&mut &file, &second).unwrap();
    let names = ["bag_0.mcap", "bag_1.mcap"].map(str::to_owned);
    std::fs::write(bag.join("metadata.yaml"), crate::common::bag_metadata(&names)).unwrap();
    tail.finish().ok();
    assert_folder_as_batch(&folder, "a late beginning");
}
