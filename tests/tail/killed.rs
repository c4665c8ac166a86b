//! A tail that is killed at any instant goes on where it was, and its result is that of one that never was.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rand::RngExt as _;

use crate::common::Folder;
use crate::common::needs::randomness;
use crate::following::{Running, assert_as_batch, kill_when_saved, length, saved, wait_for};
use crate::recorder::{Session, Style};

/// What a long test varies from round to round.
fn corrected(round: u32) -> &'static str {
    if round % 3 == 2 { "--set output.corrected=causal" } else { "" }
}

fn kills() -> u32 {
    std::env::var("STILLPOINT_KILLS").map_or(16, |kills| kills.parse().unwrap())
}

#[test]
fn a_tail_that_is_killed_over_and_over_makes_what_an_undisturbed_one_makes() {
    let session = Session::six_faces();
    let mut rng = randomness();
    let rounds = kills().div_ceil(30);
    for round in 0..rounds {
        let kills = kills() / rounds;
        let folder = Folder::new();
        let path = folder.path().join("rec.mcap");
        let seconds = 0.4 * f64::from(kills);
        let line = format!("tail rec.mcap {}", corrected(round));
        std::thread::scope(|scope| {
            let recorder = scope.spawn(|| {
                // The recording ends when two thirds of the kills are done: the rest meets the end and the fold.
                session.record(&path, Style { seeking: round % 2 == 0, ..Style::default() }, 101.0 / seconds);
            });
            for _ in 0..kills {
                let tail = Running::start(&folder, &line);
                // Checkpoints are a second apart, so that many of the instants are about then; the end comes at once.
                let millis = match (recorder.is_finished(), rng.random()) {
                    (true, _) => rng.random_range(0..120),
                    (false, true) => rng.random_range(0..300),
                    (false, false) => rng.random_range(950..1150),
                };
                std::thread::sleep(Duration::from_millis(millis));
                tail.kill();
            }
            recorder.join().unwrap();
        });
        let run = Running::start(&folder, &line).finish();
        assert_eq!(run.code, 0, "{}", run.stderr);
        assert_eq!(folder.names(), ["rec.annotated.mcap", "rec.mcap"]);
        folder.say(&format!("annotate rec.mcap -o batch.mcap -q {}", corrected(round))).ok();
        assert!(folder.read("rec.annotated.mcap") == folder.read("batch.mcap"), "round {round}");
    }
}

#[test]
fn a_tail_that_is_stopped_says_where_it_goes_on_and_does() {
    for signal in ["-INT", "-TERM"] {
        let folder = Folder::new();
        let path = folder.path().join("rec.mcap");
        let session = Session::six_faces();
        let stopped = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let recorder = scope.spawn(|| session.record_until(&path, Style::default(), 60.0, &stopped));
            let sidecar = folder.path().join("rec.stillpoint.mcap");
            let tail = Running::start(&folder, "tail rec.mcap");
            wait_for("annotations", || length(&sidecar) > 2000);
            std::process::Command::new("kill").args([signal, &tail.id().to_string()]).status().unwrap();
            let run = tail.finish();
            stopped.store(true, Ordering::Relaxed);
            assert_eq!(run.code, if signal == "-INT" { 130 } else { 143 }, "{}", run.stderr);
            assert!(run.stderr.contains("goes on from here"), "{}", run.stderr);
            assert!(folder.names().contains(&"rec.stillpoint.checkpoint".to_owned()), "{:?}", folder.names());
            let run = Running::start(&folder, "tail rec.mcap").finish().ok();
            assert!(run.stderr.contains("where it was stopped"), "{}", run.stderr);
            recorder.join().unwrap();
        });
        assert_as_batch(&folder, signal);
    }
}

#[test]
fn a_tail_that_has_finished_has_nothing_to_do_when_it_is_started_again() {
    let folder = Folder::with_demo();
    folder.write("rec.mcap", &folder.read("demo.mcap"));
    folder.say("tail rec.mcap").ok();
    let before = std::fs::metadata(folder.path().join("rec.annotated.mcap")).unwrap().modified().unwrap();
    let run = folder.say("tail rec.mcap").ok();
    assert!(run.stderr.contains("nothing to do"), "{}", run.stderr);
    let after = std::fs::metadata(folder.path().join("rec.annotated.mcap")).unwrap().modified().unwrap();
    assert_eq!(before, after);
    assert_eq!(folder.names(), ["demo.mcap", "rec.annotated.mcap", "rec.mcap"]);
    folder.refuses("tail rec.mcap --set still.min_fit_s=1.5", 1, &["exists and is not the result"]);
    folder.say("tail rec.mcap --set still.min_fit_s=1.5 --force").ok();
}

#[test]
fn a_checkpoint_of_another_configuration_is_not_gone_on_with() {
    let folder = Folder::with_demo();
    let whole = folder.read("demo.mcap");
    folder.write("rec.mcap", &whole[..whole.len() / 2]);
    let tail = Running::start(&folder, "tail rec.mcap");
    wait_for("annotations", || length(&folder.path().join("rec.stillpoint.mcap")) > 2000);
    tail.kill();
    folder.write("rec.mcap", &whole);
    let run = folder.say("tail rec.mcap --set still.min_fit_s=1.5").ok();
    assert!(run.stderr.contains("the checkpoint is of another configuration: starting anew"), "{}", run.stderr);
    folder.say("annotate rec.mcap -o batch.mcap --set still.min_fit_s=1.5").ok();
    assert!(folder.read("batch.mcap") == folder.read("rec.annotated.mcap"));
}

#[test]
fn a_tail_that_writes_corrected_messages_goes_on_with_the_calibrations_in_force() {
    let session = Session::six_faces();
    let folder = Folder::new();
    let line = "tail rec.mcap --set output.corrected=causal";
    let checkpoint = folder.path().join("rec.stillpoint.checkpoint");
    let mut went_on = 0;
    std::thread::scope(|scope| {
        let recorder = scope.spawn(|| session.record(&folder.path().join("rec.mcap"), Style::default(), 25.0));
        while !recorder.is_finished() {
            let before = saved(&checkpoint);
            let tail = Running::start_logged(&folder, line, "log");
            kill_when_saved(tail, &checkpoint, before, || recorder.is_finished());
            went_on += String::from_utf8_lossy(&folder.read("log")).matches("going on at byte").count();
        }
    });
    assert!(went_on > 0);
    Running::start(&folder, line).finish().ok();
    folder.say("annotate rec.mcap -o batch.mcap --set output.corrected=causal -q").ok();
    assert!(folder.read("batch.mcap") == folder.read("rec.annotated.mcap"));
}

#[test]
fn a_checkpoint_that_cannot_be_read_is_not_gone_on_with() {
    let half = Session::six_faces();
    let folder = Folder::new();
    half.record_while(&folder.path().join("rec.mcap"), Style::default(), f64::INFINITY, |written| written < 9000);
    let checkpoint = folder.path().join("rec.stillpoint.checkpoint");
    let tail = Running::start(&folder, "tail rec.mcap");
    wait_for("a checkpoint", || length(&checkpoint) > 5000);
    tail.kill();
    let (good, sidecar) = (std::fs::read(&checkpoint).unwrap(), folder.read("rec.stillpoint.mcap"));
    // A digit of its version, and a bit of what it holds.
    for (at, why) in [(15, "is of another version"), (3000, "is damaged")] {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        folder.write("rec.stillpoint.checkpoint", &bytes);
        folder.write("rec.stillpoint.mcap", &sidecar);
        let run = folder.say("tail rec.mcap --idle-timeout 200ms --accept-damage --force").ok();
        assert!(run.stderr.contains(&format!("the checkpoint {why}: starting anew")), "{}", run.stderr);
        assert_as_batch(&folder, why);
        std::fs::remove_file(folder.path().join("batch.mcap")).unwrap();
    }
}

/// A tail that was killed when it had annotated the larger part of `rec.mcap`, into `out`.
fn killed(folder: &Folder) {
    let session = Session::six_faces();
    let most = session.len() * 2 / 3;
    session.record_while(&folder.path().join("rec.mcap"), Style::default(), f64::INFINITY, |written| written < most);
    std::fs::create_dir(folder.path().join("out")).unwrap();
    let tail = Running::start(folder, "tail rec.mcap -o out/rec.annotated.mcap");
    wait_for("a checkpoint", || length(&folder.path().join("out/rec.stillpoint.checkpoint")) > 5000);
    tail.kill();
}

#[test]
fn what_a_killed_tail_had_written_stays_while_its_recording_is_out_of_reach() {
    let folder = Folder::new();
    killed(&folder);
    let path = |name: &str| folder.path().join(name);
    std::fs::rename(path("rec.mcap"), path("away.mcap")).unwrap();
    let again = "tail rec.mcap -o out/rec.annotated.mcap --idle-timeout 100ms";
    let kept = || ["mcap", "checkpoint", "indexes"].map(|ending| folder.read(&format!("out/rec.stillpoint.{ending}")));
    let before = kept();
    let run = folder.say(&format!("{again} -q"));
    assert!(run.code == 1 && run.error().contains("missing or empty"), "{}", run.stderr);
    std::fs::create_dir(path("rec.mcap")).unwrap();
    folder.write("rec.mcap/metadata.yaml", b"none");
    let run = folder.say(&format!("{again} -q"));
    assert!(run.code == 1 && run.error().contains("no rosbag2 recording"), "{}", run.stderr);
    assert!(kept() == before);
    std::fs::remove_dir_all(path("rec.mcap")).unwrap();
    std::fs::rename(path("away.mcap"), path("rec.mcap")).unwrap();
    let run = folder.say(&format!("{again} --accept-damage")).ok();
    assert!(run.stderr.contains("going on at byte"), "{}", run.stderr);
    folder.say("annotate rec.mcap -o batch.mcap --accept-damage").ok();
    assert!(folder.read("out/rec.annotated.mcap") == folder.read("batch.mcap"));
}

#[test]
fn what_was_learned_of_a_recording_outlives_another_one_under_its_name() {
    let folder = Folder::new();
    killed(&folder);
    // Killed while it wrote the next block.
    let sidecar = [folder.read("out/rec.stillpoint.mcap").as_slice(), &[6, 99, 0, 0, 0, 0, 0, 0, 0, 1, 2]].concat();
    folder.write("out/rec.stillpoint.mcap", &sidecar);
    let messages = |name: &str| {
        let bytes = folder.read(name);
        let stream = mcap::MessageStream::new_with_options(&bytes, mcap::read::Options::IgnoreEndMagic.into()).unwrap();
        stream
            .map_while(Result::ok)
            .map(|message| (message.channel.topic.clone(), message.sequence))
            .collect::<Vec<_>>()
    };
    let before = messages("out/rec.stillpoint.mcap");
    folder.write("rec.mcap", &Folder::with_demo().read("demo.mcap"));
    let run = folder.say("tail rec.mcap -o out/rec.annotated.mcap").ok();
    assert!(run.stderr.contains("of another recording"), "{}", run.stderr);
    assert!(run.stderr.contains("stays as out/rec.before-1.stillpoint.mcap"), "{}", run.stderr);
    folder.say("annotate rec.mcap -o batch.mcap").ok();
    assert!(folder.read("out/rec.annotated.mcap") == folder.read("batch.mcap"));
    let kept = folder.read("out/rec.before-1.stillpoint.mcap");
    assert!(mcap::Summary::read(&kept).unwrap().unwrap().stats.unwrap().message_count as usize == before.len());
    assert!(before.len() > 20 && messages("out/rec.before-1.stillpoint.mcap") == before);
    assert_eq!(std::fs::read_dir(folder.path().join("out")).unwrap().count(), 2);
}

#[test]
fn a_folder_does_not_go_on_where_a_file_with_results_of_its_name_was() {
    let folder = Folder::new();
    killed(&folder);
    Session::six_faces().record_bag(&folder.path().join("bag"), 2, Style::default(), f64::INFINITY);
    let run = folder.say("tail bag -o out/rec.annotated").ok();
    assert!(run.stderr.contains("stays as out/rec.before-1.stillpoint.mcap"), "{}", run.stderr);
    folder.say("annotate bag -o batch").ok();
    crate::common::same_folders(&folder.path().join("out/rec.annotated"), &folder.path().join("batch"));
}

#[test]
fn a_tail_that_looks_seldom_is_stopped_at_once() {
    let folder = Folder::new();
    let tail = Running::start(&folder, "tail rec.mcap --poll 10m");
    wait_for("the sidecar", || folder.path().join("rec.stillpoint.mcap").exists());
    let began = std::time::Instant::now();
    std::process::Command::new("kill").args(["-INT", &tail.id().to_string()]).status().unwrap();
    assert_eq!(tail.finish().code, 130);
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
}
