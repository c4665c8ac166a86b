//! No output is ever an input, whatever name leads there.

use std::fs;
use std::os::unix::fs::MetadataExt as _;

use crate::common::Folder;

/// A folder in which a recording has further names, and what else may be read.
fn folder() -> Folder {
    let folder = Folder::with_demo();
    let at = |name: &str| folder.path().join(name);
    fs::hard_link(at("demo.mcap"), at("hard.mcap")).unwrap();
    std::os::unix::fs::symlink(at("demo.mcap"), at("link.mcap")).unwrap();
    folder.say("export demo.mcap --format json -o calibration.json").ok();
    folder.write("settings.toml", b"[still]\nmin_fit_s = 1.5\n");
    folder
}

#[test]
fn no_command_writes_over_what_it_reads_with_or_without_force() {
    let folder = folder();
    folder.say("annotate demo.mcap -q -o annotated.mcap").ok();
    let kept = ["demo.mcap", "hard.mcap", "link.mcap", "annotated.mcap", "calibration.json", "settings.toml"];
    let before = kept.map(|name| folder.read(name));
    let mut commands = Vec::new();
    for name in ["demo.mcap", "hard.mcap", "link.mcap", "./demo.mcap"] {
        for verb in [
            "annotate --sidecar demo.mcap",
            "annotate demo.mcap",
            "tail demo.mcap --idle-timeout 300ms",
            "report demo.mcap",
            "export demo.mcap --format json",
            "config layout demo.mcap",
        ] {
            commands.push(format!("{verb} -o {name}"));
        }
    }
    for command in [
        "strip annotated.mcap -o annotated.mcap",
        "import calibration.json -o calibration.json",
        "report demo.mcap -o calibration.json --against calibration.json",
        "report demo.mcap -o settings.toml -c settings.toml",
        "annotate --sidecar demo.mcap -o settings.toml -c settings.toml",
    ] {
        commands.push(command.to_owned());
    }
    for command in commands {
        for force in ["", " --force"] {
            let run = folder.say(&format!("{command}{force}"));
            assert_eq!(run.code, 1, "{command}{force}: {}", run.stderr);
            let is_said = run.stderr.contains("is itself read by this command");
            assert!(is_said || force.is_empty(), "{command}{force}: {}", run.stderr);
            for (name, before) in kept.iter().zip(&before) {
                assert!(folder.read(name) == *before, "{command}{force} changed {name}");
            }
        }
    }
    let inode = |name: &str| fs::metadata(folder.path().join(name)).unwrap().ino();
    assert_eq!(inode("demo.mcap"), inode("hard.mcap"));
    assert!(folder.path().join("link.mcap").is_symlink());
}

#[test]
fn the_recordings_own_name_as_output_leads_to_in_place() {
    let folder = folder();
    for form in ["", "--force", "--sidecar", "--sidecar --force"] {
        folder.refuses(&format!("annotate demo.mcap -o demo.mcap {form}"), 1, &["demo.mcap: ", "annotate --in-place"]);
    }
    // What is the result already is left as it is.
    folder.say("annotate demo.mcap -o d.annotated.mcap -q").ok();
    assert!(folder.say("annotate d.annotated.mcap").ok().stderr.contains("nothing to do"));
}

#[test]
fn a_sidecar_that_grows_is_never_the_recording() {
    let folder = Folder::with_demo();
    fs::rename(folder.path().join("demo.mcap"), folder.path().join("x.stillpoint.mcap")).unwrap();
    let before = folder.read("x.stillpoint.mcap");
    fs::hard_link(folder.path().join("x.stillpoint.mcap"), folder.path().join("y.mcap")).unwrap();
    for force in ["", " --force"] {
        for input in ["x.stillpoint.mcap", "y.mcap"] {
            let run = folder.say(&format!("tail {input} -o x.mcap --idle-timeout 300ms{force}"));
            assert_eq!(run.code, 1, "{}", run.stderr);
            assert!(folder.read("x.stillpoint.mcap") == before, "{input}{force}");
        }
    }
}
