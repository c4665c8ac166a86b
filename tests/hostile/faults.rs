//! Trouble that passes: a device, a disk or a limit that refuses once. It is told from damage, waited for, and nothing is
//! lost to it.

use crate::common::needs::needed;
use crate::common::{Folder, Run, bag_metadata};
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

/// A tail that was killed half way: what it leaves beside `rec.mcap`, which is whole by now, and the results in `ref`.
fn killed_half_way() -> Folder {
    let folder = Folder::with_demo();
    let script = format!(
        "head -c {CUT} demo.mcap > rec.mcap; $STILLPOINT tail -q rec.mcap -o o.mcap --idle-timeout 60s & \
         until [ \"$(stat -c %s o.stillpoint.checkpoint 2>/dev/null || echo 0)\" -gt 2000 ]; do kill -0 $! || exit 1; sleep 0.02; done; \
         kill -9 $!; wait; cp demo.mcap whole; dd if=whole of=rec.mcap conv=notrunc status=none"
    );
    shell(&folder, &script);
    assert!(folder.names().contains(&"o.stillpoint.checkpoint".to_owned()), "{:?}", folder.names());
    folder.say("annotate rec.mcap -o ref.mcap -q").ok();
    folder.say("annotate --sidecar rec.mcap -o ref.stillpoint.mcap -q").ok();
    folder
}

#[test]
fn what_cannot_be_opened_or_read_once_is_no_strangers_file() {
    for name in ["o.stillpoint.checkpoint", "o.stillpoint.indexes", "o.stillpoint.mcap"] {
        for call in ["openat", "read", "pread64"] {
            let folder = killed_half_way();
            let trace = format!("strace -f -qq -o /dev/null -P $(pwd -P)/{name} -e trace={call}");
            let tail = "tail -q rec.mcap -o o.mcap --idle-timeout 300ms";
            if injected(&folder, "fsync:error=EIO:when=9999", "topics demo.mcap").is_none() {
                return;
            }
            let run = shell(&folder, &format!("{trace} -e inject={call}:error=EIO:when=1 $STILLPOINT {tail}"));
            assert!([0, 5].contains(&run.code), "{name}, {call}: {} {}", run.code, run.stderr);
            folder.say(tail).ok();
            assert!(folder.read("o.mcap") == folder.read("ref.mcap"), "{name}, {call}");
            let ours = |name: &String| name.starts_with("o.") && name != "o.mcap";
            assert!(!folder.names().iter().any(ours), "{name}, {call}: {:?}", folder.names());
        }
    }
}

#[test]
fn an_index_log_that_could_not_be_begun_once_is_begun_again() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o ref.mcap -q").ok();
    let tail = "tail -q demo.mcap -o o.mcap --idle-timeout 2s";
    for call in ["openat", "pwrite64"] {
        let trace = format!("strace -f -qq -o /dev/null -P $(pwd -P)/o.stillpoint.indexes -e trace={call}");
        if injected(&folder, "fsync:error=EIO:when=9999", "topics demo.mcap").is_none() {
            return;
        }
        for when in 1..=3 {
            let _ = std::fs::remove_file(folder.path().join("o.mcap"));
            let run = shell(&folder, &format!("{trace} -e inject={call}:error=ENOSPC:when={when} $STILLPOINT {tail}"));
            assert!([0, 5].contains(&run.code), "{call} {when}: {} {}", run.code, run.stderr);
            folder.say(tail).ok();
            assert!(folder.read("o.mcap") == folder.read("ref.mcap"), "{call} {when}");
        }
    }
}

#[test]
fn a_sidecar_that_is_to_stay_is_there_though_the_result_came_before_it() {
    let folder = killed_half_way();
    folder.say("annotate rec.mcap -o o.mcap -q").ok();
    folder.say("tail -q rec.mcap -o o.mcap --idle-timeout 300ms --keep-sidecar").ok();
    assert!(folder.read("o.stillpoint.mcap") == folder.read("ref.stillpoint.mcap"));
    assert!(!folder.names().contains(&"o.stillpoint.checkpoint".to_owned()));
}

#[test]
fn a_folder_for_which_there_is_no_room_is_trouble_that_passes() {
    let folder = Folder::with_demo();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    folder.write("bag/bag_0.mcap", &folder.read("demo.mcap"));
    folder.write("bag/metadata.yaml", bag_metadata(&["bag_0.mcap".to_owned()]).as_bytes());
    for error in ["ENOSPC", "EIO"] {
        let inject = format!("?mkdir,?mkdirat:error={error}:when=1");
        let Some(run) = injected(&folder, &inject, "annotate bag -o out -q") else { return };
        assert_eq!(run.code, 5, "{error}: {}", run.stderr);
        assert!(!folder.names().iter().any(|name| name.contains("out")), "{error}: {:?}", folder.names());
    }
    folder.say("annotate bag -o out -q").ok();
}

#[test]
fn recordings_are_not_merged_without_one_that_cannot_be_read_now() {
    let folder = Folder::with_demo();
    folder.say("simulate demo -o other.mcap --set recording.seed=2 -q").ok();
    let merge = "merge demo.mcap other.mcap --format json -o merged.json";
    let Some(run) = injected(&folder, "pread64:error=EIO", merge) else { return };
    assert_eq!(run.code, 5, "{}", run.stderr);
    assert!(!folder.names().contains(&"merged.json".to_owned()), "it stands in the way");
    folder.say(merge).ok();
    // An existing result that cannot be read is not another one.
    folder.say("annotate demo.mcap -o out.mcap -q").ok();
    let trace = "strace -f -qq -o /dev/null -P $(pwd -P)/out.mcap -e trace=pread64 -e inject=pread64:error=EIO";
    let run = shell(&folder, &format!("{trace} $STILLPOINT annotate demo.mcap -o out.mcap -q"));
    assert_eq!(run.code, 5, "{}", run.stderr);
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

#[test]
fn a_thread_that_the_system_refuses_is_no_panic() {
    let folder = Folder::with_demo();
    for when in 1..=4 {
        for command in [
            "annotate -q --force demo.mcap -o o.mcap",
            "topics demo.mcap",
            "tail -q --force demo.mcap -o t.mcap --live 127.0.0.1:0 --idle-timeout 100ms",
        ] {
            let inject = format!("clone3:error=EAGAIN:when={when}");
            let Some(run) = injected(&folder, &inject, command) else { return };
            assert!([0, 1, 3, 5].contains(&run.code), "{command}, {inject}: {} {}", run.code, run.stderr);
            assert!(!run.stderr.contains("panicked"), "{command}, {inject}: {}", run.stderr);
        }
    }
}

#[test]
fn a_mistake_that_cannot_be_told_has_its_exit_code_all_the_same() {
    let folder = Folder::new();
    assert_eq!(shell(&folder, "$STILLPOINT nonsense 2> /dev/full").code, 2);
    // Nor does a limit on files end what is asked for before any work by a signal.
    for command in ["--help", "nonsense", "help annotate"] {
        let run = shell(&folder, &format!("(ulimit -f 0; exec $STILLPOINT {command} > out 2> err)"));
        assert!([0, 1, 2].contains(&run.code), "{command}: {}", run.code);
    }
}

#[test]
fn limits_that_the_system_does_not_tell_are_no_trouble() {
    let folder = Folder::with_demo();
    folder.write("second.mcap", &folder.read("demo.mcap"));
    for error in ["EPERM", "ENOSYS", "EACCES"] {
        for command in [
            "topics demo.mcap",
            "annotate -q demo.mcap -o o.mcap --force",
            "annotate -q demo.mcap second.mcap --join --out-dir joined --force",
            "tail -q demo.mcap -o t.mcap --idle-timeout 100ms --force",
        ] {
            let inject = format!("prlimit64:error={error}");
            let Some(run) = injected(&folder, &inject, command) else { return };
            assert!(run.code == 0 && !run.stderr.contains("panicked"), "{command}: {} {}", run.code, run.stderr);
        }
    }
}
