//! FIFOs, devices and endless files where a recording or what belongs to one is expected.

use std::fs;

use crate::common::Folder;
use crate::{shell, watch};

#[test]
fn watch_waits_for_no_special_file_under_any_name_that_it_reads() {
    for make in [
        "mkfifo x/metadata.yaml",
        "ln -s /dev/zero x/metadata.yaml",
        "ln -s /dev/zero a.quarantine.json",
        "mkfifo a.quarantine.json",
        "mkfifo a.stillpoint.checkpoint",
        "ln -s /dev/zero a.stillpoint.checkpoint",
        "mkfifo a.annotated.mcap.partial",
        "mkfifo a.mcap.stillpoint-backup",
        "ln -s /dev/zero a.mcap.stillpoint-backup",
        "mkfifo b.mcap",
        "ln -s /dev/zero b.mcap",
        "mkfifo .a.stillpoint-attempt",
        "truncate -s 1T x/metadata.yaml",
    ] {
        let folder = Folder::with_demo();
        fs::rename(folder.path().join("demo.mcap"), folder.path().join("a.mcap")).unwrap();
        fs::create_dir(folder.path().join("x")).unwrap();
        fs::copy(folder.path().join("a.mcap"), folder.path().join("x/q.mcap")).unwrap();
        assert_eq!(shell(&folder, make).code, 0, "{make}");
        let made = folder.path().join(make.rsplit(' ').next().unwrap());
        let before = fs::symlink_metadata(&made).unwrap().file_type();
        let settled = |said: &str| ["a.mcap", "q.mcap"].iter().all(|name| said.contains(&format!("{name}: annotated")));
        let said = watch(&folder, "", settled);
        assert!(folder.path().join("a.annotated.mcap").exists(), "{make}: {said}");
        assert_eq!(fs::symlink_metadata(&made).unwrap().file_type(), before, "{make}: it is somebody else's");
    }
}

#[test]
fn commands_refuse_special_files_at_once() {
    let folder = Folder::with_demo();
    shell(&folder, "mkfifo fifo.mcap; ln -s /dev/zero zero.mcap; mkdir bag; mkfifo bag/metadata.yaml");
    for input in ["fifo.mcap", "zero.mcap", "/dev/zero", "bag"] {
        for verb in
            ["topics", "annotate --force -o out.mcap", "annotate --in-place", "tail -o out.mcap", "report", "repair"]
        {
            let run = shell(&folder, &format!("ulimit -v 3000000; timeout 30 $STILLPOINT {verb} {input}"));
            assert_eq!(run.code, 1, "{verb} {input}: {}", run.stderr);
        }
    }
    for output in ["fifo.mcap", "zero.mcap", "/dev/null"] {
        let run = shell(&folder, &format!("timeout 30 $STILLPOINT annotate demo.mcap -o {output}"));
        assert_eq!(run.code, 1, "{output}: {}", run.stderr);
    }
    for given in ["-c fifo.mcap", "-c /dev/zero", "--against fifo.mcap", "--against /dev/zero"] {
        let run = shell(&folder, &format!("ulimit -v 3000000; timeout 30 $STILLPOINT report demo.mcap {given}"));
        assert!([1, 2].contains(&run.code), "{given}: {} {}", run.code, run.stderr);
    }
}
