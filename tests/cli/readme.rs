//! Every command of the README does what it says, in the order in which a reader meets them.

use std::path::Path;
use std::process::Command;

use crate::common::needs::root;
use crate::common::{Folder, finish, program};

/// Commands that build the program or run this very test, as a reader types them; `.ci/run` runs the second.
const BUILDING: [&str; 2] = ["cargo install --locked --path .", "cargo test"];

fn readme() -> String {
    std::fs::read_to_string(root().join("README.md")).unwrap()
}

/// The fenced blocks in order, each with its language.
fn blocks(text: &str) -> Vec<(&str, &str)> {
    let fenced = text.split("\n```").skip(1).step_by(2);
    fenced.map(|block| block.split_once('\n').unwrap()).collect()
}

#[test]
fn every_command_works_in_the_order_of_the_text() {
    let text = readme();
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("testdata")).unwrap();
    for file in std::fs::read_dir(root().join("testdata")).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), folder.path().join("testdata").join(file.file_name())).unwrap();
    }
    let path = format!("{}:{}", Path::new(&program()).parent().unwrap().display(), std::env::var("PATH").unwrap());

    let (mut ran, mut told, mut shown) = (Vec::new(), None::<String>, 0);
    for (language, block) in blocks(&text) {
        // A text right behind commands is what the last of them prints.
        if let ("text", Some(told)) = (language, told.take()) {
            assert_eq!(block, told, "{:?}: what the README shows", ran.last());
            shown += 1;
        }
        for command in block.lines().filter(|_| language == "sh") {
            ran.push(command);
            if BUILDING.contains(&command) {
                continue;
            }
            let shell = command.replacen("cargo run --", "stillpoint", 1);
            assert!(!shell.contains("cargo"), "{command}: a new command that builds");
            let run = finish(Command::new("sh").args(["-c", &shell]).current_dir(folder.path()).env("PATH", &path));
            assert_eq!(run.code, 0, "{command}: {}{}", run.stdout, run.stderr);
            told = Some(run.stderr.trim_end().to_owned());
        }
    }
    assert!(shown >= 2, "the README shows what its commands print");
    assert!(ran[0].starts_with("cargo run -- annotate testdata/"), "the first command is the main job");
    assert_eq!(ran[1], "cargo test", "the second runs the tests");
    BUILDING.iter().for_each(|command| assert!(ran.contains(command), "{command} is gone"));
}

#[test]
fn pictures_tell_what_the_program_prints() {
    let folder = Folder::new();
    let demo = root().join("testdata/demo.mcap");
    let run = folder.run(["annotate".as_ref(), demo.as_os_str(), "-o".as_ref(), "demo.annotated.mcap".as_ref()]).ok();
    for name in ["report", "viewer", "live"] {
        let path = format!(".images/{name}.png");
        let told = described(&std::fs::read(root().join(&path)).unwrap());
        assert_eq!(told.as_deref(), Some(run.stderr.as_str()), "{path} is of another result: run .ci/pictures");
    }
}

/// The UTF-8 text that a PNG picture carries as its `Description`: chunk `iTXt`, not compressed, of no language.
fn described(png: &[u8]) -> Option<String> {
    let mut rest = png.strip_prefix(b"\x89PNG\r\n\x1a\n").unwrap();
    // Length, kind, content, checksum.
    while let Some((length, content)) = rest.split_first_chunk::<4>() {
        let (chunk, next) = content.split_at(4 + u32::from_be_bytes(*length) as usize);
        if let Some(text) = chunk.strip_prefix(b"iTXtDescription\0\0\0\0\0") {
            return Some(String::from_utf8(text.to_vec()).unwrap());
        }
        rest = &next[4..];
    }
    None
}

#[test]
fn the_configuration_shown_is_valid() {
    for (_, block) in blocks(&readme()).into_iter().filter(|(language, _)| *language == "toml") {
        stillpoint::config::Config::load(&[stillpoint::config::Layer::file("README.md", block)]).unwrap();
    }
}
