//! A rosbag2 recording: a folder whose `metadata.yaml` names the files of one recording.
//! [`Recording`](crate::run::input::recording::Recording) reads the files.

mod metadata;

use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use super::regular;
use crate::Error;
use crate::record::{START, Topic, is_beginning};
use crate::shell_word;
pub(crate) use metadata::Contents;
use metadata::Metadata;

/// File that makes a folder a recording.
pub(crate) const METADATA: &str = "metadata.yaml";
/// Copy of the metadata from before the recording was annotated, so that it can be restored.
pub(crate) const ORIGINAL: &str = "metadata.original.yaml";

/// A folder that holds a recording.
#[derive(Clone, Debug)]
pub(crate) struct Bag {
    folder: PathBuf,
    /// Names of its files, in order.
    files: Vec<String>,
    /// Files behind the first in which nothing was recorded.
    blank: Vec<String>,
    /// Metadata without annotations; `None` if the recorder did not finish the recording.
    original: Option<Metadata>,
    /// Whether its files hold annotations.
    annotated: bool,
}

impl Bag {
    /// Opens a folder.
    ///
    /// # Errors
    ///
    /// If it holds no rosbag2 recording in MCAP files, or one of these is missing.
    pub(crate) fn open(folder: &Path) -> Result<Self, Error> {
        if !is_finished(folder) {
            let why = match files(folder).is_empty() {
                true => "is a folder without a recording; name a recording".to_owned(),
                false => format!("is a folder without {METADATA}; {}", files_instead(folder)),
            };
            return Err(Error::input(folder, why));
        }
        let now = read(folder, METADATA)?;
        // Metadata that names other files was left by something else.
        let before = if folder.join(ORIGINAL).exists() { Some(read(folder, ORIGINAL)?) } else { None };
        let before = before.filter(|before| before.files == now.files);
        let annotated = before.is_some();
        let files = now.files.clone();
        let blank = blank(folder, &files);
        let bag = Self { folder: folder.to_owned(), files, blank, original: Some(before.unwrap_or(now)), annotated };
        for name in &bag.files {
            if !folder.join(name).exists() {
                let what = format!("its {METADATA} names {name}, which is missing; put it there, or");
                let why = format!("{what} {}", files_instead(folder));
                return Err(Error::input(folder, why));
            }
        }
        for name in self::files(folder).iter().filter(|name| !bag.files.contains(name)) {
            tracing::warn!("{}: {name} is not in {METADATA}, and is left alone", folder.display());
        }
        Ok(bag)
    }

    /// Opens a folder whose recorder did not finish it.
    pub(crate) fn unfinished(folder: &Path) -> Self {
        let files = files(folder);
        let blank = blank(folder, &files);
        Self { folder: folder.to_owned(), files, blank, original: None, annotated: false }
    }

    /// Path of the folder.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Names of its files, in order, without the blank ones.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().filter(|name| !self.blank.contains(name)).map(String::as_str)
    }

    /// Names of files in which nothing was recorded. They still belong to the recording and stay as they are.
    pub(crate) fn blank(&self) -> impl Iterator<Item = &str> {
        self.blank.iter().map(String::as_str)
    }

    /// Whether its files hold annotations.
    pub(crate) fn is_annotated(&self) -> bool {
        self.annotated
    }

    /// The `metadata.yaml` of the recording without annotations, if there is one.
    pub(crate) fn original(&self) -> Option<&str> {
        self.original.as_ref().map(Metadata::text)
    }

    /// The `metadata.yaml` of the recording with annotations, whose splits have these contents.
    pub(crate) fn annotated(&self, splits: &[Contents], own: &[Topic]) -> Option<String> {
        let mut splits = splits.iter();
        let contents = |name| if self.blank.contains(name) { None } else { splits.next().cloned() };
        let all: Vec<_> = self.files.iter().map(contents).map(Option::unwrap_or_default).collect();
        self.original.as_ref().map(|original| original.annotated(&all, own))
    }
}

/// Advice for a folder that is no recording, which works whatever the command: its files, or one recording made of them.
fn files_instead(folder: &Path) -> String {
    let folder = folder.display().to_string();
    let files = format!("{}/*.mcap", shell_word(folder.strip_suffix('/').unwrap_or(&folder)));
    format!(
        "name a .mcap file in it; those that are one recording are annotated as one: stillpoint annotate --join {files} \
         --out-dir DIR"
    )
}

/// Blank ones among a recording's files. The first is never one: it decides whether this is a recording at all.
fn blank(folder: &Path, files: &[String]) -> Vec<String> {
    files.iter().skip(1).filter(|name| is_blank(&folder.join(name))).cloned().collect()
}

/// Whether a file exists in which nothing was recorded: a recorder that dies leaves it empty, a power failure full of
/// zeros.
pub(crate) fn is_blank(file: &Path) -> bool {
    if !file.is_file() {
        return false;
    }
    let mut start = [0; START];
    match regular::open(file).and_then(|mut file| file.read_exact(&mut start)) {
        Ok(()) => !is_beginning(&start),
        Err(error) => error.kind() == io::ErrorKind::UnexpectedEof,
    }
}

fn read(folder: &Path, name: &str) -> Result<Metadata, Error> {
    let path = folder.join(name);
    let text = regular::text(&path).map_err(Error::io("read", &path))?;
    let refused = |why| Error::input(folder, format!("no rosbag2 recording that can be read: {why}"));
    Metadata::parse(text).map_err(refused)
}

/// Whether a folder is one recording: its files are named after it, as rosbag2 does, or its `metadata.yaml` is
/// readable.
pub(crate) fn is_one(folder: &Path) -> bool {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let number = |rest: &str| rest.strip_prefix('_').is_some_and(|n| n.bytes().all(|digit| digit.is_ascii_digit()));
    let named = |file: &String| {
        let rest = file.strip_suffix(".mcap").and_then(|stem| stem.strip_prefix(&*name));
        rest.is_some_and(|rest| rest.is_empty() || number(rest))
    };
    let files = files(folder);
    !files.is_empty() && (files.iter().any(named) || listed(folder).is_some())
}

/// Whether a recorder has finished the recording in a folder.
pub(crate) fn is_finished(folder: &Path) -> bool {
    folder.join(METADATA).exists()
}

/// Whether the recording in a folder was annotated.
pub(crate) fn has_original(folder: &Path) -> bool {
    folder.join(METADATA).exists() && folder.join(ORIGINAL).exists()
}

/// Files that the `metadata.yaml` of a folder lists; `None` while it is missing or unusable.
pub(crate) fn listed(folder: &Path) -> Option<Vec<String>> {
    read(folder, METADATA).ok().map(|metadata| metadata.files)
}

/// Names of the recordings in a folder, in natural order: `bag_10` follows `bag_9`. Outputs of Stillpoint and hidden
/// files are left out.
pub(crate) fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> =
        names.filter(|name| name.ends_with(".mcap") && !is_ours(name) && !name.starts_with('.')).collect();
    names.sort_by(|a, b| natural(a).cmp(&natural(b)));
    names
}

/// Whether Stillpoint gives such names to its files and folders.
pub(crate) fn is_ours(name: &str) -> bool {
    let name = [".partial", ".replaced"].into_iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(name);
    [".annotated", ".annotated.mcap", ".stillpoint.mcap"].iter().any(|ending| name.ends_with(ending))
}

/// A name as words and numbers: each word, and the number behind it by its length and digits.
fn natural(name: &str) -> Vec<(&str, usize, &str)> {
    let mut rest = name;
    let mut parts = Vec::new();
    while !rest.is_empty() {
        let digit = |c: char| c.is_ascii_digit();
        let (word, behind) = rest.split_at(rest.find(digit).unwrap_or(rest.len()));
        let (number, behind) = behind.split_at(behind.find(|c| !digit(c)).unwrap_or(behind.len()));
        let number = number.trim_start_matches('0');
        parts.push((word, number.len(), number));
        rest = behind;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_in_the_order_in_which_a_recorder_numbers_them() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b_10.mcap", "b_9.mcap", "b_0.mcap", "b_009_1.mcap", "b_0.annotated.mcap", ".b_3.mcap", "a.yaml"] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        assert_eq!(files(folder.path()), ["b_0.mcap", "b_9.mcap", "b_009_1.mcap", "b_10.mcap"]);
    }
}
