//! Recordings in a directory, and stamps that distinguish them from others of the same name.
//! [`results`](super::results) tells their state.

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use crate::Error;
use crate::run::input::growing_file::GrowingFile;
use crate::run::input::rosbag2;

/// Length and times of a recording, which distinguish it from another one of the same name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stamp {
    pub(super) length: u64,
    pub(super) modified_ns: u64,
    /// Time of the last change, including owner and mode, so that an unreadable recording is tried again.
    changed_ns: u64,
}

impl Stamp {
    /// Stamp of a file, or of all files of a rosbag2 folder.
    pub(super) fn of(recording: &Path) -> Option<Self> {
        let metadata = std::fs::metadata(recording).ok()?;
        let own = Self::new(&metadata);
        if metadata.is_file() {
            return Some(own);
        }
        let files = rosbag2::files(recording).into_iter().map(|name| (true, name));
        let all = files.chain([(false, rosbag2::METADATA.to_owned())]);
        let each = all.filter_map(|(counts, name)| {
            let stamp = Self::new(&std::fs::metadata(recording.join(name)).ok()?);
            Some(if counts { stamp } else { Self { length: 0, ..stamp } })
        });
        Some(each.fold(Self { length: 0, ..own }, |all, one| Self {
            length: all.length + one.length,
            modified_ns: all.modified_ns.max(one.modified_ns),
            changed_ns: all.changed_ns.max(one.changed_ns),
        }))
    }

    fn new(metadata: &Metadata) -> Self {
        let nanos =
            |seconds: i64, nanos: i64| seconds.saturating_mul(1_000_000_000).saturating_add(nanos).max(0) as u64;
        Self {
            length: metadata.len(),
            modified_ns: nanos(metadata.mtime(), metadata.mtime_nsec()),
            changed_ns: nanos(metadata.ctime(), metadata.ctime_nsec()),
        }
    }

    /// Whether nothing has been added for that long.
    pub(super) fn is_idle(&self, idle: Duration) -> bool {
        let modified = SystemTime::UNIX_EPOCH + Duration::from_nanos(self.modified_ns);
        modified.elapsed().is_ok_and(|age| age >= idle)
    }
}

/// Whether a recorder has finished a recording.
pub(super) fn is_finished(recording: &Path) -> bool {
    let closed = |file: &Path| GrowingFile::open(file).ok().flatten().is_some_and(|growing| growing.is_closed());
    if !recording.is_dir() {
        return closed(recording);
    }
    let last = rosbag2::files(recording).pop();
    rosbag2::is_finished(recording) && last.is_some_and(|last| closed(&recording.join(last)))
}

/// Recordings in a folder and its subfolders, without results of Stillpoint and hidden files. A rosbag2 folder is one
/// recording. Links are not followed: their targets have names of their own.
pub(super) fn recordings(folder: &Path) -> Result<BTreeMap<PathBuf, Stamp>, Error> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let Ok(entry) = entry else { continue };
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        let Ok(kind) = entry.file_type() else { continue };
        let is_recording = match kind.is_dir() {
            true => rosbag2::is_one(&path),
            false => kind.is_file() && name.ends_with(".mcap"),
        };
        if name.starts_with('.') || rosbag2::is_ours(&name) {
            continue;
        }
        if is_recording {
            found.extend(Stamp::of(&path).map(|stamp| (path, stamp)));
        } else if kind.is_dir() {
            // A folder that cannot be read now may be readable the next time.
            found.extend(recordings(&path).unwrap_or_default());
        }
    }
    Ok(found)
}
