//! Files that a stranger put beside a recording, under names that Stillpoint uses.

use std::fs;
use std::os::unix::fs::{MetadataExt as _, symlink};

use crate::common::Folder;
use crate::shell;

/// A backup as an earlier or this version writes it, that fits any file: nothing precedes the change.
fn backup(magic: &[u8; 16], inode: Option<u64>, start: u64, kept: &[u8]) -> Vec<u8> {
    let mut head = magic.to_vec();
    head.extend(inode.iter().flat_map(|inode| inode.to_le_bytes()));
    head.extend(start.to_le_bytes());
    head.extend(start.wrapping_add(kept.len() as u64).to_le_bytes());
    head.extend(0_u32.to_le_bytes());
    head.extend(crc32fast::hash(kept).to_le_bytes());
    head.extend(crc32fast::hash(&head).to_le_bytes());
    [head.as_slice(), kept].concat()
}

#[test]
fn a_planted_backup_never_changes_a_recording() {
    let folder = Folder::with_demo();
    let whole = folder.read("demo.mcap");
    let inode = fs::metadata(folder.path().join("demo.mcap")).unwrap().ino();
    let planted = [
        backup(b"stillpointback01", None, 0, b"hello"),
        backup(b"stillpointback02", Some(inode), 0, b"hello"),
        backup(b"stillpointback02", Some(inode + 1), 0, b""),
        backup(b"stillpointback02", Some(inode), 8, b"hello"),
        backup(b"stillpointback02", Some(inode), u64::MAX - 4, b"hello")[..40].to_vec(),
    ];
    for bytes in planted {
        folder.write("demo.mcap.stillpoint-backup", &bytes);
        for verb in
            ["topics", "report", "export --format json", "annotate -o out.mcap --force", "tail -o t.mcap --force"]
        {
            let run = folder.say(&format!("{verb} demo.mcap")).ok();
            assert!(run.stderr.contains("is not the backup of this file"), "{verb}: {}", run.stderr);
        }
        for verb in ["annotate --in-place", "repair"] {
            folder.refuses(&format!("{verb} demo.mcap"), 1, &["is not the backup of this file"]);
        }
        assert!(folder.read("demo.mcap") == whole);
        assert!(folder.read("demo.mcap.stillpoint-backup") == bytes, "it is somebody else's");
    }
}

#[test]
fn a_backup_that_is_a_link_or_a_special_file_is_not_waited_for() {
    for kind in ["ln -s /dev/zero", "mkfifo", "ln -s victim", "mkdir", "ln victim"] {
        let folder = Folder::with_demo();
        let whole = folder.read("demo.mcap");
        folder.write("victim", b"precious");
        shell(&folder, &format!("{kind} demo.mcap.stillpoint-backup"));
        folder.say("topics demo.mcap").ok();
        assert_eq!(folder.say("annotate --in-place demo.mcap").code, 1, "{kind}");
        assert!(folder.read("demo.mcap") == whole && folder.read("victim") == b"precious", "{kind}");
    }
}

/// Names that Stillpoint gives, or once gave, to files beside a recording.
const NAMES: [&str; 12] = [
    "demo.annotated.mcap.partial",
    "demo.stillpoint.checkpoint.partial",
    "demo.quarantine.json.partial",
    "demo.stillpoint.checkpoint",
    "demo.quarantine.json",
    "demo.stillpoint.mcap",
    "demo.annotated.mcap",
    "broken.quarantine.json.partial",
    "broken.quarantine.json",
    "broken.stillpoint.checkpoint",
    "demo.stillpoint.indexes",
    "broken.stillpoint.indexes",
];

/// What a link of either kind leads to is still what it was, after `work`.
fn with_links(work: impl Fn(&Folder)) {
    let hard = |folder: &Folder, name: &str| fs::hard_link(folder.path().join("victim"), folder.path().join(name));
    let soft = |folder: &Folder, name: &str| symlink("victim", folder.path().join(name));
    for (kind, link) in [("hard", &hard as &dyn Fn(&Folder, &str) -> std::io::Result<()>), ("symbolic", &soft)] {
        for name in NAMES {
            let folder = Folder::with_demo();
            folder.write("broken.mcap", &folder.read("demo.mcap")[..90]);
            folder.write("victim", b"precious");
            link(&folder, name).unwrap();
            work(&folder);
            assert_eq!(folder.read("victim"), b"precious", "{kind} link {name}");
            assert_eq!(folder.read(name), b"precious", "{kind} link {name} is somebody else's");
        }
    }
}

#[test]
fn no_command_writes_through_a_link_under_a_name_of_ours() {
    with_links(|folder| {
        folder.say("annotate demo.mcap -q");
        folder.say("annotate --sidecar demo.mcap -q");
        folder.say("tail demo.mcap --idle-timeout 200ms --keep-sidecar");
        folder.say("tail broken.mcap --idle-timeout 200ms");
    });
}

#[test]
fn watch_writes_through_no_link_under_a_name_of_ours() {
    with_links(|folder| {
        // Each of the two is annotated or left alone.
        let settled = |said: &str| {
            let of = |name: &str| {
                said.contains(&format!("{name}: annotated")) || said.contains(&format!("changes: ./{name}"))
            };
            of("demo.mcap") && of("broken.mcap")
        };
        let settled = |said: &str| settled(&said.replace("demo.annotated", "demo").replace("demo.stillpoint", "demo"));
        crate::watch(folder, "", settled);
    });
}

#[test]
fn what_is_replaced_with_force_or_made_again_replaces_a_link_itself() {
    let folder = Folder::with_demo();
    folder.write("victim", b"precious");
    fs::create_dir(folder.path().join("man")).unwrap();
    for name in ["out.mcap", "page.html", "man/stillpoint.1"] {
        symlink(folder.path().join("victim"), folder.path().join(name)).unwrap();
    }
    folder.say("annotate demo.mcap -q -o out.mcap --force").ok();
    folder.say("report demo.mcap -o page.html --force").ok();
    folder.say("man man --force").ok();
    assert_eq!(folder.read("victim"), b"precious");
    for name in ["out.mcap", "page.html", "man/stillpoint.1"] {
        assert!(!folder.path().join(name).is_symlink(), "{name}");
    }
}

#[test]
fn a_folder_that_stands_in_for_a_partial_one_is_left_alone() {
    let folder = Folder::with_demo();
    fs::create_dir_all(folder.path().join("bag")).unwrap();
    fs::rename(folder.path().join("demo.mcap"), folder.path().join("bag/bag_0.mcap")).unwrap();
    folder.write(
        "bag/metadata.yaml",
        b"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths: [bag_0.mcap]\n",
    );
    fs::create_dir(folder.path().join("theirs")).unwrap();
    folder.write("theirs/precious", b"precious");
    symlink("theirs", folder.path().join("bag.annotated.partial")).unwrap();
    folder.say("annotate bag -q").ok();
    assert_eq!(folder.read("theirs/precious"), b"precious");
    folder.refuses("annotate bag -o bag --force", 1, &["bag: ", "--in-place"]);
    assert_eq!(folder.names(), ["bag", "bag.annotated", "bag.annotated.partial", "theirs"]);
}
