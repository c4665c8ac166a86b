//! A rosbag2 recording: a folder whose `metadata.yaml` names the files that are one recording. What the files hold is
//! left to [`Recording`](super::recording::Recording).

mod metadata;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::record::Topic;
pub(super) use metadata::Contents;
use metadata::Metadata;

/// What makes a folder a recording.
pub(super) const METADATA: &str = "metadata.yaml";
/// What that was before the recording was annotated, so that it can be had back.
pub(super) const ORIGINAL: &str = "metadata.original.yaml";

/// A folder with a recording in it.
#[derive(Clone, Debug)]
pub(super) struct Bag {
    folder: PathBuf,
    original: Metadata,
    /// Whether there are annotations in it.
    annotated: bool,
}

impl Bag {
    /// Opens a folder.
    ///
    /// # Errors
    ///
    /// If it holds no rosbag2 recording in MCAP files, or one of these is missing.
    pub(super) fn open(folder: &Path) -> Result<Self, Error> {
        if !folder.join(METADATA).exists() {
            let why = match mcap_files(folder).is_empty() {
                true => "is a folder without a recording; name a recording",
                false => {
                    "is a folder without metadata.yaml; name the .mcap files in it, with --join if they are one recording"
                }
            };
            return Err(Error::input(folder, why));
        }
        let read = |name: &str| {
            let path = folder.join(name);
            let text = std::fs::read_to_string(&path).map_err(Error::io("read", &path))?;
            let refused = |why| Error::input(folder, format!("no rosbag2 recording that can be read: {why}"));
            Metadata::parse(text).map_err(refused)
        };
        let now = read(METADATA)?;
        // One that names other files was left by something else.
        let before = if folder.join(ORIGINAL).exists() { Some(read(ORIGINAL)?) } else { None };
        let before = before.filter(|before| before.files == now.files);
        let annotated = before.is_some();
        let bag = Self { folder: folder.to_owned(), original: before.unwrap_or(now), annotated };
        for name in bag.names() {
            if !folder.join(name).exists() {
                let why = format!(
                    "its {METADATA} names {name}, which is missing; put it there, or name the files that are there, with --join"
                );
                return Err(Error::input(folder, why));
            }
        }
        for name in mcap_files(folder).iter().filter(|name| !bag.original.files.contains(name)) {
            tracing::warn!("{}: {name} is not in {METADATA}, and is left alone", folder.display());
        }
        Ok(bag)
    }

    /// Where it is.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Names of its files, in their order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.original.files.iter().map(String::as_str)
    }

    /// Whether there are annotations in it.
    pub(super) fn is_annotated(&self) -> bool {
        self.annotated
    }

    /// The `metadata.yaml` of the recording without annotations.
    pub(super) fn original(&self) -> &str {
        self.original.text()
    }

    /// The `metadata.yaml` of the recording with annotations, whose splits these are.
    pub(super) fn annotated(&self, splits: &[Contents], own: &[Topic]) -> String {
        self.original.annotated(splits, own)
    }
}

/// Names of the MCAP files in a folder.
fn mcap_files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension() == Some(OsStr::new("mcap")))
        .filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()))
        .collect();
    names.sort();
    names
}
