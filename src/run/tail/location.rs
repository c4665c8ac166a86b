//! Location of a growing recording: one file, or a folder into which its recorder writes one file after the other.

use std::path::{Path, PathBuf};

use crate::Error;
use crate::run::input::growing_file::GrowingFile;
use crate::run::input::rosbag2;
use crate::run::input::splits::Input;

/// Location of a recording.
#[derive(Debug)]
pub(super) enum Location {
    File(PathBuf),
    Folder(PathBuf),
}

impl Location {
    /// Folder or file, as the path is now.
    pub(super) fn of(path: &Path) -> Self {
        let path = path.to_owned();
        if path.is_dir() { Self::Folder(path) } else { Self::File(path) }
    }

    pub(super) fn path(&self) -> &Path {
        match self {
            Self::File(path) | Self::Folder(path) => path,
        }
    }

    /// Whether there may be several files, distinguished by name.
    pub(super) fn has_names(&self) -> bool {
        matches!(self, Self::Folder(_))
    }

    /// Name of a file of the recording; `None` if there is only one file.
    pub(super) fn name_of(&self, file: &Path) -> Option<String> {
        let name = |file: &Path| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.has_names().then(|| name(file))
    }

    /// The file that follows those, if it has begun.
    pub(super) fn next(&self, behind: &[&str]) -> Result<Option<GrowingFile>, Error> {
        match (self, behind) {
            (Self::File(path), []) => GrowingFile::open(path),
            (Self::File(_), _) => Ok(None),
            (Self::Folder(folder), _) => {
                let files = rosbag2::files(folder);
                if files.is_empty() && rosbag2::is_finished(folder) {
                    // The error says why nothing is to be expected.
                    return Input::open(folder).map(|_| None);
                }
                // Files that a finished recording lists come first, in that order.
                let files = rosbag2::listed(folder).into_iter().flatten().chain(files);
                let next = files.into_iter().find(|name| !behind.contains(&name.as_str()));
                next.map_or(Ok(None), |name| GrowingFile::open(&folder.join(name)))
            }
        }
    }

    /// Reopens a file of the recording.
    pub(super) fn again(&self, name: &str) -> Result<Option<GrowingFile>, Error> {
        GrowingFile::open(&match self {
            Self::File(path) => path.clone(),
            Self::Folder(folder) => folder.join(name),
        })
    }

    /// Whether the recorder has finished, and these are all files.
    pub(super) fn ends_with(&self, files: &[&str]) -> bool {
        match self {
            Self::File(_) => true,
            Self::Folder(folder) => rosbag2::listed(folder).is_some_and(|listed| listed == files),
        }
    }
}
