//! Names in a recording that would steer a terminal, forge a line or break out of a text.

use stillpoint::simulate::Scenario;

use crate::common::Folder;

/// Clears the screen, sets the title, forges an error, reorders letters, breaks out of a page and out of a label.
const NAME: &str =
    "/imu\u{1b}[2J\u{1b}]0;owned\u{7}\r\nerror: all is lost\u{9b}31m\u{202e}<script>alert(1)</script>\"x";

fn folder(topic: &str) -> Folder {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.accelerometer.topic = Some(topic.to_owned());
    Folder::with_scenario("demo.mcap", &scenario)
}

fn is_harmless(text: &str) -> bool {
    text.chars().all(|c| c == '\n' || !c.is_control() && c != '\u{202e}')
        && !text.lines().any(|line| line.trim_start().starts_with("error: all"))
}

#[test]
fn no_command_prints_what_steers_a_terminal_or_forges_a_line() {
    for topic in [NAME, "/x\u{7f}\u{85}", "/y\u{2028}error: all is lost"] {
        let folder = folder(topic);
        for command in [
            "topics demo.mcap",
            "topics demo.mcap --json",
            "annotate demo.mcap -o out.mcap",
            "annotate demo.mcap -o out.mcap --force --json -v",
            "report demo.mcap",
            "report out.mcap",
            "export out.mcap --format json",
            "export out.mcap --format kalibr",
            "tail demo.mcap -o t.mcap --idle-timeout 200ms",
            "topics demo.mcap --set imu=[{topic='/none'}]",
        ] {
            let run = folder.say(command);
            assert!(is_harmless(&run.stdout), "{command}: {:?}", run.stdout);
            assert!(is_harmless(&run.stderr), "{command}: {:?}", run.stderr);
        }
        assert_eq!(folder.say("topics demo.mcap --json").ok().json()["topics"][0]["topic"], topic);
        assert_eq!(folder.say("export out.mcap --format json").ok().json()["imus"][0]["topic"], topic);
    }
}

#[test]
fn a_page_and_the_lines_that_map_a_topic_hold_the_name_without_its_effect() {
    let folder = folder(NAME);
    folder.say("report demo.mcap -o page.html").ok();
    let page = String::from_utf8(folder.read("page.html")).unwrap();
    assert!(!page.contains("<script>alert") && !page.contains('\u{1b}') && page.contains("error: all is lost"));
}

#[test]
fn a_file_name_is_escaped_in_errors_and_in_labels() {
    let folder = Folder::with_demo();
    std::fs::rename(folder.path().join("demo.mcap"), folder.path().join("a\u{1b}[2J\nerror: b.mcap")).unwrap();
    let run = folder.run(["annotate", "a\u{1b}[2J\nerror: b.mcap", "-o", "missing/out\u{9b}.mcap"]);
    assert_eq!(run.code, 1);
    assert!(is_harmless(&run.stderr) && run.stderr.contains("out\\u{9b}.mcap"), "{:?}", run.stderr);
}
