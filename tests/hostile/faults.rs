//! Trouble that passes: a device, a disk or a limit that refuses once. It is told from damage, waited for, and nothing is
//! lost to it.

use crate::common::needs::needed;
use crate::common::{Folder, Run};
use crate::{shell, watch};

const CUT: usize = 60_000;

/// Runs the program with a fault injected into its system calls; nothing where that cannot be done.
fn injected(folder: &Folder, inject: &str, command: &str) -> Option<Run> {
    let probe = shell(folder, "strace -f -o /dev/null -e trace=fsync true");
    needed((probe.code == 0).then_some(()), format_args!("strace, or leave to trace: {}", probe.stderr))?;
    let call = inject.split(':').next().unwrap_or_default();
    // What reads is the recording: the program itself is read, too.
    let path = if call == "pread64" { "-P $(pwd -P)/demo.mcap" } else { "" };
    let strace = format!("strace -f -qq -o /dev/null {path} -e trace={call} -e inject={inject}");
    Some(shell(folder, &format!("{strace} $STILLPOINT {command}")))
}

#[test]
fn no_annotation_is_lost_to_a_checkpoint_that_could_not_be_saved_once() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o ref.mcap -q").ok();
    for (call, errors) in [("fsync", &["EIO", "ENOSPC"][..]), ("linkat", &["EIO"]), ("write", &["ENOSPC"])] {
        for error in errors {
            for when in 1..=3 {
                for name in ["o.mcap", "o.stillpoint.mcap", "o.stillpoint.checkpoint"] {
                    let _ = std::fs::remove_file(folder.path().join(name));
                }
                let inject = format!("{call}:error={error}:when={when}");
                let Some(first) = injected(&folder, &inject, "tail -q demo.mcap -o o.mcap --idle-timeout 2s") else {
                    return;
                };
                assert!([0, 5].contains(&first.code), "{inject}: {} {}", first.code, first.stderr);
                folder.say("tail -q demo.mcap -o o.mcap --idle-timeout 2s").ok();
                assert!(folder.read("o.mcap") == folder.read("ref.mcap"), "{inject}");
            }
        }
    }
}

#[test]
fn a_read_that_fails_once_is_no_damage() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o ref.mcap -q").ok();
    for error in ["EIO", "ESTALE"] {
        for when in [1, 3, 5, 8] {
            for name in ["o.mcap", "o.stillpoint.mcap", "o.stillpoint.checkpoint"] {
                let _ = std::fs::remove_file(folder.path().join(name));
            }
            let inject = format!("pread64:error={error}:when={when}");
            let Some(run) = injected(&folder, &inject, "tail demo.mcap -o o.mcap --idle-timeout 2s") else { return };
            assert!([0, 5].contains(&run.code), "{inject}: {} {}", run.code, run.stderr);
            assert!(!run.stderr.contains("cut off"), "{inject}: {}", run.stderr);
            folder.say("tail -q demo.mcap -o o.mcap --idle-timeout 2s").ok();
            assert!(folder.read("o.mcap") == folder.read("ref.mcap"), "{inject}");
        }
        // For good, it is trouble all the same.
        let inject = format!("pread64:error={error}");
        for command in
            ["annotate demo.mcap -o x.mcap", "topics demo.mcap", "tail demo.mcap -o x.mcap --idle-timeout 300ms"]
        {
            if let Some(run) = injected(&folder, &inject, command) {
                assert_eq!(run.code, 5, "{command}, {inject}: {}", run.stderr);
            }
        }
    }
}

#[test]
fn the_gravest_code_of_several_inputs_is_that_of_the_table() {
    let folder = Folder::with_demo();
    folder.write("cut.mcap", &folder.read("demo.mcap")[..CUT]);
    folder.write("none.mcap", b"nothing");
    // 1 before 5 before 3: one input cannot be read at all, one is damaged, and one finds the disk full.
    let full = "copy_file_range:error=ENOSPC";
    let of = |inputs: &str| injected(&folder, full, &format!("annotate -q --force --out-dir out {inputs}"));
    let Some(passing) = of("demo.mcap cut.mcap") else { return };
    assert_eq!(passing.code, 5, "{}", passing.stderr);
    assert_eq!(of("demo.mcap none.mcap").unwrap().code, 1);
    assert_eq!(folder.say("annotate -q --force --out-dir out demo.mcap cut.mcap").code, 3);
}

#[test]
fn watch_waits_for_room_and_keeps_every_rest() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o ref -q").ok();
    // Calls are counted thread by thread, and each attempt is a thread of its own: the first would fail each time.
    for when in 2..=3 {
        let script = format!(
            "rm -rf out; timeout 20 strace -f -qq -o /dev/null -e trace=fsync -e inject=fsync:error=ENOSPC:when={when} \
             $STILLPOINT watch . --out-dir out --interval 100ms --idle-timeout 200ms & \
             until cmp -s ref out/demo.annotated.mcap; do kill -0 $! || exit 9; sleep 0.1; done; kill $!; wait"
        );
        if injected(&folder, "fsync:error=EIO:when=9999", "topics demo.mcap").is_none() {
            return;
        }
        let run = shell(&folder, &script);
        assert!(run.code != 9 && folder.path().join("out/demo.annotated.mcap").exists(), "{when}: {}", run.stderr);
    }
}

#[test]
fn a_kept_sidecar_of_a_damaged_recording_locks_nobody_out() {
    let demo = Folder::with_demo();
    let whole = demo.read("demo.mcap");
    let mut flipped = whole.clone();
    flipped[CUT] ^= 0x55;
    for (name, bytes) in [("cut", &whole[..CUT]), ("flipped", &flipped), ("whole", &whole)] {
        let folder = Folder::new();
        folder.write("a.mcap", bytes);
        let accepted = "--idle-timeout 300ms --keep-sidecar --accept-damage";
        folder.say(&format!("tail a.mcap -o o.mcap {accepted}")).ok();
        folder.say("annotate a.mcap -o ref.mcap --accept-damage -q").ok();
        folder.say("annotate --sidecar a.mcap -o ref.stillpoint.mcap --accept-damage -q").ok();
        assert!(folder.read("o.mcap") == folder.read("ref.mcap"), "{name}");
        assert!(folder.read("o.stillpoint.mcap") == folder.read("ref.stillpoint.mcap"), "{name}");
        folder.say(&format!("tail a.mcap -o o.mcap {accepted}")).ok();
        let watched = Folder::new();
        watched.write("a.mcap", bytes);
        let said = watch(&watched, "--keep-sidecar", |said| said.contains("a.mcap: annotated"));
        assert!(!said.contains("at work"), "{said}");
    }
}

#[test]
fn a_limit_of_the_system_is_an_error_and_no_signal_or_panic() {
    let folder = Folder::with_demo();
    for (limit, command) in [
        ("-f 8", "annotate demo.mcap -o out.mcap"),
        ("-f 8", "annotate --in-place demo.mcap"),
        ("-f 8", "tail demo.mcap -o t.mcap --idle-timeout 300ms"),
        ("-f 8", "simulate demo -o truth.mcap"),
        ("-f 1", "report demo.mcap -o page.html"),
        ("-n 4", "annotate demo.mcap -o out.mcap"),
        ("-n 6", "annotate demo.mcap -o out.mcap"),
        ("-n 9", "annotate demo.mcap -o out.mcap"),
        ("-n 12", "tail demo.mcap -o t.mcap --idle-timeout 300ms"),
    ] {
        let before = folder.read("demo.mcap");
        let run = shell(&folder, &format!("ulimit -c 0; ulimit {limit}; exec $STILLPOINT {command}"));
        assert!([0, 1, 5].contains(&run.code), "{limit} {command}: {} {}", run.code, run.stderr);
        assert!(!run.stderr.contains("panicked"), "{limit} {command}: {}", run.stderr);
        assert!(folder.read("demo.mcap") == before, "{limit} {command}");
    }
}
