//! `annotate --in-place`: the recording itself becomes the annotated one, or stays what it was, whatever happens.

use std::fs::{self, File};
use std::io::Write as _;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use rand::RngExt as _;

use crate::common::needs::{needed, randomness};
use crate::common::{Folder, Run, finish, program};

const BACKUP: &str = "x.mcap.stillpoint-backup";
/// A configuration of its own, so that the second annotation differs from the first.
const OTHER: &str = "fit.gravity=9.8";

/// What `x.mcap` may be: a recording, and what `run` would make of it.
struct Case {
    folder: Folder,
    before: Vec<u8>,
    after: Vec<u8>,
}

impl Case {
    /// An original, to be annotated.
    fn first() -> Self {
        let folder = Folder::with_demo();
        folder.say(&format!("annotate demo.mcap -o after.mcap --set {OTHER} -q")).ok();
        Self { before: folder.read("demo.mcap"), after: folder.read("after.mcap"), folder }
    }

    /// An annotated recording, to be annotated otherwise.
    fn again() -> Self {
        let first = Self::first();
        first.folder.say("annotate demo.mcap -o before.mcap -q").ok();
        Self { before: first.folder.read("before.mcap"), ..first }
    }

    fn reset(&self) {
        self.folder.write("x.mcap", &self.before);
    }

    /// Reading says what is to be done and changes nothing; then the file is either, and nothing else is left.
    fn settles(&self, what: &str) -> bool {
        let backup = self.folder.path().join(BACKUP).exists();
        if backup {
            let found = self.folder.read("x.mcap");
            self.folder.refuses("topics x.mcap", 1, &["x.mcap: ", "`stillpoint repair`", "annotate --in-place"]);
            assert!(self.folder.read("x.mcap") == found && self.folder.path().join(BACKUP).exists(), "{what}");
        }
        let run = self.folder.say("repair x.mcap").ok();
        assert_eq!(run.stderr.contains("taken back"), backup, "{what}: {}", run.stderr);
        self.folder.say("topics x.mcap").ok();
        let now = self.folder.read("x.mcap");
        assert!(now == self.before || now == self.after, "{what}: {} bytes of something else", now.len());
        assert!(!self.folder.path().join(BACKUP).exists(), "{what}: the backup stays");
        now == self.after
    }

    fn shell(&self, script: &str) -> Run {
        finish(Command::new("bash").args(["-c", script]).current_dir(self.folder.path()))
    }

    fn command() -> String {
        format!("{} annotate --in-place x.mcap -q --set {OTHER}", program())
    }
}

#[test]
fn the_result_is_that_of_a_copy_and_can_be_replaced_and_undone() {
    for case in [Case::first(), Case::again()] {
        case.reset();
        let inode = fs::metadata(case.folder.path().join("x.mcap")).unwrap().ino();
        let run = case.folder.say(&format!("annotate --in-place x.mcap --set {OTHER}")).ok();
        assert!(run.stderr.contains("wrote x.mcap"), "{}", run.stderr);
        assert!(case.folder.read("x.mcap") == case.after);
        assert_eq!(fs::metadata(case.folder.path().join("x.mcap")).unwrap().ino(), inode);
        let run = case.folder.say(&format!("annotate --in-place x.mcap --set {OTHER}")).ok();
        assert!(run.stderr.contains("already the result"), "{}", run.stderr);
        case.folder.say("strip x.mcap -o original.mcap").ok();
        assert!(case.folder.read("original.mcap") == case.folder.read("demo.mcap"));
        assert!(!case.folder.names().iter().any(|name| name.contains("backup")), "{:?}", case.folder.names());
    }
}

#[test]
fn through_a_link_the_file_itself_changes_and_one_with_further_names_is_refused() {
    let case = Case::first();
    case.reset();
    std::os::unix::fs::symlink("x.mcap", case.folder.path().join("link.mcap")).unwrap();
    case.folder.say(&format!("annotate --in-place link.mcap -q --set {OTHER}")).ok();
    assert!(case.folder.read("x.mcap") == case.after);
    assert!(case.folder.path().join("link.mcap").is_symlink());

    case.reset();
    fs::hard_link(case.folder.path().join("x.mcap"), case.folder.path().join("y.mcap")).unwrap();
    case.folder.refuses("annotate --in-place y.mcap", 1, &["y.mcap: ", "hard links", "-o"]);
}

#[test]
fn damaged_and_unfinished_recordings_are_annotated_in_place_too() {
    let case = Case::first();
    let whole = case.folder.read("demo.mcap");
    let (mut flipped, cut) = (whole.clone(), whole[..whole.len() * 2 / 3].to_vec());
    flipped[whole.len() / 2] ^= 0x55;
    for (file, name) in [(flipped, "flipped"), (cut, "cut")] {
        case.folder.write("x.mcap", &file);
        case.folder.say("annotate x.mcap -o copy.mcap --accept-damage -q --force").ok();
        case.folder.say("annotate --in-place x.mcap --accept-damage -q").ok();
        assert!(case.folder.read("x.mcap") == case.folder.read("copy.mcap"), "{name}");
        case.folder.say("strip x.mcap -o original.mcap --force").ok();
        assert!(case.folder.read("original.mcap") == file, "{name}");
    }
}

#[test]
fn others_wait_while_it_is_changed_and_it_waits_while_others_read() {
    let case = Case::first();
    case.reset();
    let file = File::open(case.folder.path().join("x.mcap")).unwrap();
    file.lock().unwrap();
    for verb in ["topics", "annotate", "annotate --in-place", "strip -o out.mcap"] {
        case.folder.refuses(&format!("{verb} x.mcap"), 1, &["x.mcap: another stillpoint is at work"]);
    }
    file.unlock().unwrap();
    file.lock_shared().unwrap();
    case.folder.refuses("annotate --in-place x.mcap", 1, &["x.mcap: another stillpoint is at work"]);
    case.folder.say("topics x.mcap").ok();
}

#[test]
fn a_backup_of_something_else_is_not_used() {
    let case = Case::first();
    case.reset();
    let mut other = case.before.clone();
    other[100] ^= 1;
    for junk in [b"something".to_vec(), vec![7; 500]].into_iter().chain(killed_backup(&case)) {
        case.folder.write("x.mcap", &other);
        case.folder.write(BACKUP, &junk);
        for verb in ["annotate --in-place", "repair"] {
            case.folder.refuses(&format!("{verb} x.mcap"), 1, &["x.mcap: ", BACKUP, "is not the backup of this file"]);
        }
        for verb in ["topics", "annotate -o out.mcap --force"] {
            let run = case.folder.say(&format!("{verb} x.mcap --accept-damage")).ok();
            assert!(run.stderr.contains("is not the backup of this file; it is left alone"), "{}", run.stderr);
        }
        assert!(case.folder.read("x.mcap") == other && case.folder.read(BACKUP) == junk);
        fs::remove_file(case.folder.path().join(BACKUP)).unwrap();
    }
}

/// What a run that was killed while it wrote leaves beside the file, where that can be arranged.
fn killed_backup(case: &Case) -> Option<Vec<u8>> {
    case.reset();
    let file = case.folder.path().canonicalize().unwrap().join("x.mcap");
    let inject = format!("-P {} -e inject=ftruncate:signal=KILL", file.display());
    let run = case.shell(&format!("strace -f -o /dev/null {inject} {}", Case::command()));
    if run.code == 127 || run.stderr.contains("ptrace") {
        return needed(None, format_args!("strace is missing or may not trace: {}", run.stderr));
    }
    assert!(case.folder.read("x.mcap") != case.before, "not killed while it wrote");
    Some(case.folder.read(BACKUP))
}

#[test]
fn killed_at_any_instant_the_file_is_the_original_or_the_result() {
    let mut rng = randomness();
    let mut ends = [0, 0];
    for case in [Case::first(), Case::again()] {
        // As long as an undisturbed run takes here and now, and a little more.
        case.reset();
        let start = std::time::Instant::now();
        case.shell(&Case::command());
        let mut longest = start.elapsed().as_micros() as u64 * 5 / 4;
        for n in 0..100 {
            case.reset();
            let arguments = ["annotate", "--in-place", "x.mcap", "-q", "--set", OTHER];
            let mut child = Command::new(program())
                .args(arguments)
                .current_dir(case.folder.path())
                .stdin(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            std::thread::sleep(Duration::from_micros(rng.random_range(0..longest)));
            child.kill().unwrap();
            child.wait().unwrap();
            let done = case.settles(&format!("kill {n}"));
            ends[usize::from(done)] += 1;
            // However busy the machine is, a fifth of the kills come behind the end.
            longest = if done { longest * 96 / 100 } else { longest * 101 / 100 + 1 };
        }
    }
    assert!(ends.iter().all(|&times| times > 0), "every kill ended alike: {ends:?}");
}

/// Every kilobyte of what is written: an error, as a full disk gives.
#[test]
fn refused_at_any_write_the_file_is_the_original_or_the_result() {
    for case in [Case::first(), Case::again()] {
        let largest = case.before.len().max(case.after.len()) as u64 / 1024 + 1;
        let start = case.before.iter().zip(&case.after).position(|(a, b)| a != b).unwrap() as u64 / 1024;
        // The backup and what is staged are small files; then comes the file itself.
        let mut ends = [0, 0];
        for limit in (0..40).chain(start..=largest) {
            case.reset();
            let run = case.shell(&format!("ulimit -f {limit}; exec {}", Case::command()));
            let what = format!("limit of {limit} KiB: code {}", run.code);
            assert!((0..=5).contains(&run.code), "{what}");
            if limit * 1024 >= case.before.len() as u64 {
                // Taken back at once, not only by the next run. (A limit below what the file already has forbids even
                // that, unlike a full disk.)
                assert!(!case.folder.path().join(BACKUP).exists(), "{what}");
                let now = case.folder.read("x.mcap");
                assert!(now == if run.code == 0 { &case.after } else { &case.before }[..], "{what}");
            }
            ends[usize::from(case.settles(&what))] += 1;
        }
        assert!(ends.iter().all(|&times| times > 0), "every limit ended alike: {ends:?}");
    }
}

#[test]
fn killed_or_refused_at_any_system_call_the_file_is_the_original_or_the_result() {
    const CALLS: [&str; 7] = ["openat", "write", "copy_file_range", "ftruncate", "fsync", "linkat", "unlink"];
    // An error once, or from then on for good, so that taking the change back fails as well.
    const FAULTS: [(&str, &str); 3] = [("signal=KILL", ""), ("error=ENOSPC", ""), ("error=ENOSPC", "+")];
    for case in [Case::first(), Case::again()] {
        let folder = case.folder.path().canonicalize().unwrap();
        let at = |name: &str| format!("-P {} ", folder.join(name).display());
        let paths = [at(""), at("x.mcap"), at(BACKUP)].concat();
        let traced = |inject: &str| {
            case.reset();
            case.shell(&format!("strace -f -o /dev/null {paths} {inject} {}", Case::command()))
        };
        let untouched = traced("");
        let works = (untouched.code == 0).then_some(());
        let Some(()) = needed(works, format_args!("strace, or leave to trace: {}", untouched.stderr)) else { return };
        for call in CALLS {
            for (fault, lasting) in FAULTS {
                let came_through = |n: &usize| {
                    let run = traced(&format!("-e inject={call}:{fault}:when={n}{lasting}"));
                    let what = format!("{call} {n}, {fault}{lasting}: code {}: {}", run.code, run.stderr);
                    case.settles(&what) && run.code == 0
                };
                let faults = (1..50).find(came_through).unwrap();
                assert!(faults > 1 || call == "write", "{call} is never called");
            }
        }
    }
}

#[test]
fn a_full_disk_leaves_the_original() {
    let folder = Folder::new();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=2m", "tmpfs"]).arg(&disk).output();
    let works = mounted.as_ref().is_ok_and(|mounted| mounted.status.success()).then_some(());
    let Some(()) = needed(works, format_args!("leave to make a small disk: {mounted:?}")) else { return };
    let done = std::panic::catch_unwind(|| fill(&disk));
    assert!(Command::new("umount").arg("--lazy").arg(&disk).status().unwrap().success());
    done.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
}

/// Annotates on a disk that is full but for so many pages.
fn fill(disk: &Path) {
    let case = Case::first();
    let file = disk.join("x.mcap");
    let run = |free: usize| {
        fs::write(&file, &case.before).unwrap();
        let ballast = disk.join("ballast");
        let mut writer = File::create(&ballast).unwrap();
        while writer.write(&[1; 4096]).is_ok_and(|written| written > 0) {}
        let length = writer.metadata().unwrap().len();
        writer.set_len(length - 4096 * free as u64).unwrap();
        let arguments = ["annotate", "--in-place", "x.mcap", "-q", "--set", OTHER];
        let run = finish(Command::new(program()).args(arguments).current_dir(disk));
        let now = fs::read(&file).unwrap();
        assert!(now == if run.code == 0 { &case.after } else { &case.before }[..], "{free} free: {}", run.stderr);
        assert!(run.code == 0 || run.error().contains("no space left"), "{free} free: {}", run.stderr);
        // Another test may be starting a program, which for an instant holds whatever is open here: free the pages now.
        writer.set_len(0).unwrap();
        fs::remove_file(ballast).unwrap();
        let names: Vec<_> = fs::read_dir(disk).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(names, ["x.mcap"], "{free} free: something is left behind");
        run.code == 0
    };
    let enough = (0..100).position(run).unwrap();
    assert!(enough > 5, "the disk was never full: {enough} free pages sufficed");
}
