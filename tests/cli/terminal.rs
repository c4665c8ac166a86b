//! What people see on a terminal, at the widths that terminals have.

use std::process::Command;

use console::{measure_text_width, strip_ansi_codes};
use stillpoint::simulate::Scenario;

use crate::common::needs::needed;
use crate::common::{Folder, Run, finish, program};

/// Runs a command line on a terminal of so many columns. `None` without `script`, which makes one.
fn on_terminal(folder: &Folder, columns: usize, line: &str) -> Option<Run> {
    let works = Command::new("script").arg("--version").output().is_ok_and(|output| output.status.success());
    needed(works.then_some(()), "script (util-linux), which makes a terminal")?;
    let command = line.replace("stillpoint ", &format!("{} ", program()));
    let command = format!("stty cols {columns} rows 40; {command}");
    let mut script = Command::new("script");
    script.args(["-q", "-e", "-c", &command, "/dev/null"]).env("TERM", "xterm-256color").current_dir(folder.path());
    let run = finish(&mut script);
    Some(Run { stdout: strip_ansi_codes(&run.stdout.replace('\r', "")).into_owned(), ..run })
}

/// A session in which much is wrong, so that much is said.
fn wrong() -> Folder {
    let text = std::fs::read_to_string(crate::common::needs::root().join(".ci/wrong.toml")).unwrap();
    Folder::with_scenario("wrong.mcap", &Scenario::from_table(text.parse().unwrap()).unwrap())
}

#[test]
fn no_line_is_longer_than_the_terminal_and_nothing_is_cut() {
    let (demo, wrong) = (Folder::with_demo(), wrong());
    demo.say("annotate demo.mcap -q").ok();
    for columns in [60, 80, 100, 160] {
        for (folder, line, words) in [
            (
                &demo,
                "stillpoint annotate demo.mcap --force",
                &["+X", "-Z", "scale", "bias m/s²", "observed", "not excluded", "next"][..],
            ),
            (&demo, "stillpoint report demo.annotated.mcap", &["-Z", "█", "corrected"]),
            (&demo, "stillpoint annotate demo.mcap --force -v", &["-Z", "triangular is not determined"]),
            (
                &wrong,
                "stillpoint annotate wrong.mcap --force",
                &["-Z missing", "TILTED", "TOO_SHORT", "z axis is flipped"],
            ),
        ] {
            let Some(run) = on_terminal(folder, columns, line) else { return };
            assert_eq!(run.code, 0, "{line}: {}", run.stdout);
            // The progress bar is drawn over.
            let lines = run.stdout.lines().filter(|line| !line.contains(" left"));
            let long: Vec<_> = lines.clone().filter(|line| measure_text_width(line) > columns).collect();
            assert!(long.is_empty(), "{line} at {columns}: {long:#?}");
            let text = lines.collect::<Vec<_>>().join(" ");
            let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
            for word in words {
                assert!(text.contains(word), "{line} at {columns}: no {word} in {}", run.stdout);
            }
            assert!(!text.contains('…'), "{line} at {columns}: {}", run.stdout);
        }
    }
}

#[test]
fn a_tail_that_is_interrupted_leaves_what_it_knew_and_says_no_error() {
    let folder = Folder::with_demo();
    let whole = folder.read("demo.mcap");
    folder.write("rec.mcap", &whole[..whole.len() * 9 / 10]);
    let line = "timeout --foreground -s INT 3 stillpoint tail rec.mcap --poll 10ms; echo code $?";
    let Some(run) = on_terminal(&folder, 80, line) else { return };
    assert!(run.stdout.contains("stopped on request; the same command goes on from here"), "{}", run.stdout);
    assert!(!run.stdout.contains("error:"), "{}", run.stdout);
    let last = run.stdout.rsplit("/imu/data_raw").next().unwrap();
    for word in ["rests", "faces", "-Z", "next", "read", "code 124"] {
        assert!(last.contains(word), "no {word} in {}", run.stdout);
    }
}
