//! `CONTRIBUTING.md` names what is there: files, types, and every variable that a test or tool reads.

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::needs::root;

fn contributing() -> String {
    std::fs::read_to_string(root().join(".github/CONTRIBUTING.md")).unwrap()
}

/// The words set in code, a command word by word.
fn code(text: &str) -> impl Iterator<Item = &str> {
    let spans = text.split('`').skip(1).step_by(2);
    spans.flat_map(str::split_whitespace).map(|word| word.trim_matches([',', '[', ']']))
}

/// Texts of the files under a folder of the repository, with their names.
fn texts(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            texts(&path, found);
        } else if let Ok(text) = std::fs::read_to_string(&path) {
            found.push((entry.file_name().into_string().unwrap(), text));
        }
    }
}

fn tree() -> Vec<(String, String)> {
    let mut found = Vec::new();
    for folder in ["src", "tests", ".ci", "schemas"] {
        texts(&root().join(folder), &mut found);
    }
    assert!(found.len() > 300, "the files are found: {}", found.len());
    found
}

#[test]
fn every_file_that_is_named_is_there() {
    const FOLDERS: [&str; 6] = ["src/", "tests/", "schemas/", "testdata/", ".ci/", ".github/"];
    let (text, tree) = (contributing(), tree());
    let mut named = 0;
    for word in code(&text).filter(|word| !word.contains("LAW")) {
        let is_path = FOLDERS.iter().any(|folder| word.starts_with(folder));
        if is_path {
            assert!(root().join(word).exists(), "{word}");
        } else if word.ends_with(".rs") || word.ends_with(".pyi") {
            assert!(tree.iter().any(|(name, _)| name == word), "{word}");
        }
        named += usize::from(is_path);
    }
    assert!(named > 40, "the paths are found: {named}");
}

#[test]
fn every_type_and_constant_that_is_named_is_there() {
    let (text, tree) = (contributing(), tree());
    let mut named = 0;
    for word in code(&text).filter(|word| !["STILLPOINT_", "PROPTEST_", "LAW"].iter().any(|mark| word.contains(mark))) {
        let is_name = word.starts_with(|c: char| c.is_ascii_uppercase())
            && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == ':');
        // Placeholders of commands.
        if !is_name || ["MINUTES", "FILE", "TARGET", "LICHTBLICK", "AREA"].contains(&word) {
            continue;
        }
        for part in word.split("::") {
            assert!(tree.iter().any(|(_, text)| text.contains(part)), "{word}");
        }
        named += 1;
    }
    assert!(named > 8, "the names are found: {named}");
}

#[test]
fn every_variable_that_something_reads_is_listed_and_no_other() {
    fn variables(text: &str) -> impl Iterator<Item = String> {
        let names = text.split("STILLPOINT_").skip(1).map(|rest| {
            let name: String = rest.chars().take_while(|c| c.is_ascii_uppercase() || *c == '_').collect();
            name.trim_end_matches('_').to_owned()
        });
        names.filter(|name| !name.is_empty())
    }
    let text = contributing();
    let listed: BTreeSet<_> = text.lines().filter(|line| line.starts_with("| `")).flat_map(variables).collect();
    let read: BTreeSet<_> = tree().iter().flat_map(|(_, text)| variables(text).collect::<Vec<_>>()).collect();
    assert!(read.len() > 10, "the variables are found: {read:?}");
    assert_eq!(listed, read);
}
