//! What a shell completes and what `man` shows come from the command line itself.

use std::process::Command;

use crate::common::{Folder, finish};

#[test]
fn bash_completes_verbs_options_and_choices() {
    let folder = Folder::new();
    let script = folder.say("completions bash").ok().stdout;
    folder.write("completions.bash", script.as_bytes());
    let complete = |words: &[&str]| {
        let (last, count) = (words.last().unwrap(), words.len() - 1);
        let line = format!(
            "source completions.bash; COMP_WORDS=({}); COMP_CWORD={count}; _stillpoint stillpoint '{last}' '{}'; echo \"${{COMPREPLY[@]}}\"",
            words.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" "),
            words[count - 1],
        );
        finish(Command::new("bash").args(["-c", &line]).current_dir(folder.path())).ok().stdout.trim().to_owned()
    };
    assert_eq!(complete(&["stillpoint", "exp"]), "export");
    assert_eq!(complete(&["stillpoint", "export", "--form"]), "--format");
    assert_eq!(complete(&["stillpoint", "export", "--format", "ard"]), "ardupilot");
    for shell in ["zsh", "fish", "elvish", "powershell"] {
        assert!(folder.say(&format!("completions {shell}")).ok().stdout.contains("annotate"), "{shell}");
    }
}

#[test]
fn pages_that_exist_are_replaced_on_request_alone() {
    let folder = Folder::new();
    folder.say("man .").ok();
    let page = folder.read("stillpoint-annotate.1");
    // The same once more is nothing to do.
    folder.say("man .").ok();
    folder.write("stillpoint-annotate.1", b"precious");
    std::fs::remove_file(folder.path().join("stillpoint.1")).unwrap();
    folder.refuses("man .", 1, &["stillpoint-annotate.1: exists", "--force"]);
    folder.say("man . --force").ok();
    assert_eq!(folder.read("stillpoint-annotate.1"), page);
    assert!(folder.names().contains(&"stillpoint.1".to_owned()));
}

#[test]
fn every_verb_has_a_page() {
    let folder = Folder::new();
    folder.say("man pages").ok();
    let read = |page: &str| String::from_utf8(folder.read(&format!("pages/{page}"))).unwrap();
    assert!(read("stillpoint.1").contains("Exit codes"));
    for verb in ["annotate", "topics", "report", "export", "import", "strip", "simulate", "config", "config-show"] {
        let page = read(&format!("stillpoint-{verb}.1"));
        assert!(page.contains(".TH") && page.contains(".SH SYNOPSIS"), "{verb}");
    }
}
