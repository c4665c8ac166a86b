//! What goes wrong with a recording while it is followed: a clear message, and whole output.

use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::Folder;
use crate::common::needs::needed;
use crate::following::{Running, assert_as_batch, length, wait_for};
use crate::recorder::{Session, Style};

/// Follows a recording to which something happens once there are annotations.
fn while_followed(folder: &Folder, arguments: &str, style: Style, happens: impl FnOnce()) -> crate::common::Run {
    let session = Session::six_faces();
    let path = folder.path().join("rec.mcap");
    let sidecar = folder.path().join("rec.stillpoint.mcap");
    let happened = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let recorder = scope.spawn(|| session.record_until(&path, style, 60.0, &happened));
        let tail = Running::start(folder, &format!("tail rec.mcap {arguments}"));
        wait_for("annotations", || length(&sidecar) > 2000);
        happens();
        happened.store(true, Ordering::Relaxed);
        recorder.join().unwrap();
        tail.finish()
    })
}

#[test]
fn a_recorder_that_is_killed_in_a_chunk_leaves_what_the_batch_run_makes_of_it() {
    let session = Session::six_faces();
    for seeking in [true, false] {
        let folder = Folder::new();
        let style = Style { seeking, ..Style::default() };
        let last = session.len() / 2 + 17;
        session.record_while(&folder.path().join("rec.mcap"), style, f64::INFINITY, |written| written < last);
        let run = folder.say("tail rec.mcap --idle-timeout 300ms");
        assert_eq!(run.code, 3, "{}", run.stderr);
        assert!(run.stderr.contains("warning: damaged at byte"), "{}", run.stderr);
        assert_eq!(folder.names(), ["rec.annotated.mcap", "rec.mcap"]);
        assert_as_batch(&folder, "killed recorder");
        let run = folder.say("tail rec.mcap --idle-timeout 300ms").ok();
        assert!(run.stderr.contains("nothing to do"), "{}", run.stderr);
    }
}

#[test]
fn a_recording_that_is_deleted_or_replaced_is_followed_to_its_end() {
    for replaced in [false, true] {
        let folder = Folder::new();
        let run = while_followed(&folder, "", Style::default(), || {
            // A second name keeps the bytes for the comparison.
            std::fs::hard_link(folder.path().join("rec.mcap"), folder.path().join("kept.mcap")).unwrap();
            match replaced {
                true => {
                    folder.write("other.mcap", b"another recording");
                    std::fs::rename(folder.path().join("other.mcap"), folder.path().join("rec.mcap")).unwrap();
                }
                false => std::fs::remove_file(folder.path().join("rec.mcap")).unwrap(),
            }
        });
        assert_eq!(run.code, 0, "{}", run.stderr);
        folder.say("annotate kept.mcap -o batch.mcap").ok();
        assert!(folder.read("batch.mcap") == folder.read("rec.annotated.mcap"), "replaced: {replaced}");
    }
}

#[test]
fn the_annotations_of_a_recording_that_is_cut_off_or_written_anew_are_kept() {
    let session = Session::six_faces();
    for anew in [false, true] {
        let folder = Folder::new();
        let path = folder.path().join("rec.mcap");
        let style = Style { seeking: false, ..Style::default() };
        session.record_while(&path, style, f64::INFINITY, |written| written < session.len() / 2);
        let tail = Running::start(&folder, "tail rec.mcap --idle-timeout 5s");
        wait_for("annotations", || length(&folder.path().join("rec.stillpoint.mcap")) > 2000);
        match anew {
            true => folder.write("rec.mcap", &vec![1; length(&path) as usize + 500_000]),
            false => File::options().write(true).open(&path).unwrap().set_len(100).unwrap(),
        }
        let run = tail.finish();
        // What is there now is nothing to annotate.
        assert_eq!(run.code, 1, "{}", run.stderr);
        assert!(run.stderr.contains("was cut off or written anew"), "{}", run.stderr);
        assert!(run.stderr.contains("stays as rec.before-1.stillpoint.mcap"), "{}", run.stderr);
        assert_eq!(folder.names(), ["rec.before-1.stillpoint.mcap", "rec.mcap"]);
        let sidecar = folder.read("rec.before-1.stillpoint.mcap");
        let summary = mcap::Summary::read(&sidecar).unwrap().unwrap();
        assert!(summary.stats.unwrap().message_count > 5);
        assert!(mcap::MessageStream::new(&sidecar).unwrap().all(|message| message.is_ok()));
        let again = folder.say("tail rec.mcap --idle-timeout 300ms");
        assert!(again.code == 1 && !again.stderr.contains("exists"), "{}", again.stderr);
    }
}

#[test]
fn a_recording_that_is_written_anew_while_it_is_followed_is_followed_anew() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    let (cut, read) = (demo.len() / 4, demo.len() * 3 / 4);
    folder.write("rec.mcap", &demo[..read]);
    let tail = Running::start(&folder, "tail rec.mcap --idle-timeout 3s --poll 20ms --allow-no-imu");
    let kept = |n: usize| folder.path().join(format!("rec.before-{n}.stillpoint.mcap"));
    for n in 1..=2 {
        // More than a quarter shows.
        wait_for("annotations", || length(&folder.path().join("rec.stillpoint.mcap")) > 15_000);
        let file = File::options().write(true).open(folder.path().join("rec.mcap")).unwrap();
        file.set_len(cut as u64).unwrap();
        wait_for("what it was", || kept(n).exists());
        file.write_all_at(&demo[cut..if n == 1 { read } else { demo.len() }], cut as u64).unwrap();
    }
    let run = tail.finish().ok();
    assert_eq!(run.stderr.matches("what is there now is followed").count(), 2, "{}", run.stderr);
    assert!(run.stderr.contains("stays as rec.before-2.stillpoint.mcap"), "{}", run.stderr);
    let names =
        ["demo.mcap", "rec.annotated.mcap", "rec.before-1.stillpoint.mcap", "rec.before-2.stillpoint.mcap", "rec.mcap"];
    assert_eq!(folder.names(), names);
    for n in 1..=2 {
        let sidecar = std::fs::read(kept(n)).unwrap();
        assert!(mcap::Summary::read(&sidecar).unwrap().unwrap().stats.unwrap().message_count > 5);
    }
    assert_as_batch(&folder, "written anew");
    let run = folder.say("tail rec.mcap --idle-timeout 300ms").ok();
    assert!(run.stderr.contains("nothing to do"), "{}", run.stderr);
    // The batch's result is there, too.
    assert_eq!(folder.names().len(), names.len() + 1);
}

#[test]
fn room_that_a_recorder_reserves_and_gives_back_is_no_damage() {
    for (from, ahead) in [(0, 5000), (0, 1 << 20), (30_000, 5000)] {
        let folder = Folder::with_demo();
        let demo = folder.read("demo.mcap");
        let file = File::create(folder.path().join("rec.mcap")).unwrap();
        file.write_all_at(&demo[..from], 0).unwrap();
        let tail = Running::start(&folder, "tail rec.mcap --json --idle-timeout 2s --poll 10ms");
        std::thread::sleep(Duration::from_millis(100));
        file.set_len((demo.len() + ahead) as u64).unwrap();
        for (n, part) in demo[from..].chunks(8000).enumerate() {
            file.write_all_at(part, (from + n * 8000) as u64).unwrap();
            std::thread::sleep(Duration::from_millis(30));
        }
        file.set_len(demo.len() as u64).unwrap();
        let run = tail.finish().ok();
        for event in ["damage", "trouble"] {
            assert!(!run.stdout.contains(&format!("\"event\":\"{event}\"")), "{from}, {ahead}: {}", run.stdout);
        }
        assert!(run.stdout.contains("\"ending\":\"finished\""), "{from}, {ahead}: {}", run.stdout);
        assert_eq!(folder.names(), ["demo.mcap", "rec.annotated.mcap", "rec.mcap"]);
        assert_as_batch(&folder, "reserved room");
    }
}

#[test]
fn room_that_a_recorder_never_filled_is_a_recording_that_was_cut_off() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    let mut whole = 8;
    while whole < demo.len() / 2 {
        whole += 9 + u64::from_le_bytes(demo[whole + 1..whole + 9].try_into().unwrap()) as usize;
    }
    folder.write("rec.mcap", &[&demo[..whole], &[0; 300_000]].concat());
    for command in ["annotate rec.mcap -o batch.mcap", "tail rec.mcap --idle-timeout 300ms --force"] {
        let run = folder.say(command);
        assert_eq!(run.code, 3, "{command}: {}", run.stderr);
        let said = run.stderr.lines().filter(|line| line.starts_with("warning: damaged"));
        assert_eq!(said.clone().count(), 1, "{command}: {}", run.stderr);
        assert!(said.clone().all(|line| line.contains("cut off")), "{command}: {}", run.stderr);
    }
    assert!(folder.read("batch.mcap") == folder.read("rec.annotated.mcap"));
}

#[test]
fn damages_without_number_are_counted_and_take_no_memory() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    let header = 17 + u64::from_le_bytes(demo[9..17].try_into().unwrap()) as usize;
    // Records that end the data, with data behind each.
    let ends = [&[15, 4][..], &[0; 11]].concat().repeat(300_000);
    folder.write("rec.mcap", &[&demo[..header], &ends, &demo[header..]].concat());
    let run = folder.say("tail rec.mcap --idle-timeout 300ms");
    assert_eq!(run.code, 3, "{}", run.stderr);
    let lines = run.stderr.lines().count();
    assert!(lines < 400, "{lines} lines");
    assert!(run.stderr.contains("further warnings, which are in the log of its annotations"), "{}", run.stderr);
    let damages = run.stderr.lines().find_map(|line| line.strip_prefix("warning: ")?.strip_suffix(" damages in all"));
    assert!(damages.unwrap().parse::<u64>().unwrap() >= 299_000, "{damages:?}");
    assert_as_batch(&folder, "many damages");
}

#[test]
fn lost_framing_is_read_around_when_the_recording_has_ended() {
    let folder = Folder::with_demo();
    let mut bytes = folder.read("demo.mcap");
    let third = bytes.len() / 3;
    let chunk = third + bytes[third..].windows(9).position(|nine| nine[0] == 6 && nine[4..] == [0; 5]).unwrap();
    bytes[chunk + 7] = 0x40;
    folder.write("rec.mcap", &bytes);
    let run = folder.say("tail rec.mcap");
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert_as_batch(&folder, "lost framing");
}

#[test]
fn what_is_no_recording_is_refused_and_leaves_nothing_behind() {
    let folder = Folder::new();
    folder.refuses("tail rec.mcap --idle-timeout 100ms -q", 1, &["rec.mcap", "missing or empty"]);
    folder.write("rec.mcap", b"something else altogether");
    folder.refuses("tail rec.mcap -q", 1, &["not an MCAP recording"]);
    let run = folder.say("tail rec.mcap --idle-timeout soon");
    assert!(run.code == 2 && run.stderr.contains("write 500ms, 30s"), "{}", run.stderr);
    let folder = Folder::with_demo();
    folder.refuses(
        "tail demo.mcap --set imu=[{topic='/imu/data_raw',accel='nothing'}] -q",
        1,
        &["no usable IMU topic"],
    );
    folder.say("tail demo.mcap --set imu=[{topic='/imu/data_raw',accel='nothing'}] --allow-no-imu").ok();
}

#[test]
fn an_output_that_is_somebody_elses_is_refused_whether_its_recording_is_there_or_not() {
    let folder = Folder::with_demo();
    folder.write("other.annotated.mcap", b"somebody's");
    for input in ["demo.mcap", "not_there_yet.mcap", "empty.mcap"] {
        folder.write("empty.mcap", b"");
        let line = format!("tail {input} -q -o other.annotated.mcap");
        folder.refuses(&line, 1, &["other.annotated.mcap: exists and is not the result"]);
    }
}

#[test]
fn outputs_whose_names_have_other_endings_share_no_sidecar() {
    let folder = Folder::with_demo();
    let mut expected = vec!["demo.mcap".to_owned()];
    for (output, stem) in [("run.1", "run.1"), ("run.2", "run.2"), ("live.annotated.mcap", "live"), ("on.mcap", "on")] {
        folder.say(&format!("tail demo.mcap --keep-sidecar -o {output}")).ok();
        expected.extend([output.to_owned(), format!("{stem}.stillpoint.mcap")]);
    }
    expected.sort();
    assert_eq!(folder.names(), expected);
}

#[test]
fn a_second_tail_of_the_same_recording_is_refused() {
    let folder = Folder::new();
    let first = Running::start(&folder, "tail rec.mcap");
    wait_for("the sidecar", || folder.path().join("rec.stillpoint.mcap").exists());
    folder.refuses("tail rec.mcap", 1, &["another stillpoint"]);
    first.kill();
    let run = folder.say("tail rec.mcap --idle-timeout 100ms -q");
    assert!(run.code == 1 && run.stderr.contains("missing or empty"), "{}", run.stderr);
    assert!(folder.names().is_empty(), "no lock is left behind");
}

#[test]
fn a_sidecar_that_is_kept_is_the_one_that_the_batch_run_makes() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap --sidecar -o batch.mcap").ok();
    folder.say("tail demo.mcap --keep-sidecar").ok();
    assert!(folder.read("demo.stillpoint.mcap") == folder.read("batch.mcap"));
    assert_eq!(folder.names(), ["batch.mcap", "demo.annotated.mcap", "demo.mcap", "demo.stillpoint.mcap"]);
}

#[test]
fn what_stillpoint_annotated_before_is_annotated_anew() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o rec.mcap").ok();
    folder.say("tail rec.mcap").ok();
    assert!(folder.read("rec.mcap") == folder.read("rec.annotated.mcap"));
    folder.say("annotate demo.mcap --sidecar -o other.mcap").ok();
    folder.refuses("tail other.mcap -q", 1, &["holds annotations alone"]);
}

/// Follows `rec.mcap` into a file system with room for so many kilobytes, some of them taken, until that is complained
/// about. `None` where nobody may make one.
fn on_a_small_disk(folder: &Folder, arguments: &str, kilobytes: usize, taken: usize) -> Option<String> {
    // A file system of our own, that exists for this shell alone.
    let script = format!(
        "mkdir out && mount -t tmpfs -o size={kilobytes}k tmpfs out && head -c {taken} /dev/zero > out/filler || exit 77
        {program} tail rec.mcap -o out/a.mcap {arguments} 2> log & tail=$!
        for i in $(seq 200); do grep -q 'waiting for room' log && break; sleep 0.05; done
        rm out/filler; sleep 1; mount -o remount,size=64m out && wait $tail; code=$?
        ls out > names; cp out/a.mcap a.mcap; exit $code",
        program = env!("CARGO_BIN_EXE_stillpoint")
    );
    let command = ["-rm", "sh", "-c", &script];
    let run = Command::new("unshare").args(command).current_dir(folder.path()).output().unwrap();
    if run.status.code() == Some(77) || String::from_utf8_lossy(&run.stderr).contains("unshare:") {
        return needed(None, format_args!("this machine lets nobody mount a file system ({run:?})"));
    }
    let log = String::from_utf8(folder.read("log")).unwrap();
    assert!(run.status.success(), "{run:?} {log}");
    assert_eq!(folder.read("names"), b"a.mcap\n", "{log}");
    Some(log)
}

#[test]
fn a_full_disk_is_waited_for() {
    let demo = Folder::with_demo().read("demo.mcap");
    let damaged = [&demo[..100_000], &[demo[100_000] ^ 0x55], &demo[100_001..]].concat();
    // While the annotations are written, and when these have room but the result has none.
    for (recording, arguments, kilobytes, taken) in [
        (&demo, "", 64, 60_000),
        (&demo, "", 200, 0),
        (&damaged, "--accept-damage", 200, 0),
        (&demo, "--set output.corrected=final", 200, 0),
    ] {
        let folder = Folder::new();
        folder.write("rec.mcap", recording);
        let Some(log) = on_a_small_disk(&folder, arguments, kilobytes, taken) else { return };
        assert!(log.contains("no space left") && log.contains("waiting for room"), "{log}");
        folder.say(&format!("annotate rec.mcap -o batch.mcap {arguments}")).ok();
        assert!(folder.read("a.mcap") == folder.read("batch.mcap"), "{arguments}");
    }
}
