//! Files that a command reads, by identity: none of them ever becomes its output, whatever name leads to it.
//!
//! Only a [`Partial`](super::Partial) replaces files, and it checks here first.

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use crate::Error;
use crate::run::store::is_url;

/// Files and folders that are read.
#[derive(Clone, Debug, Default)]
pub struct Reads {
    /// Device and inode, which all names of a file share.
    ids: BTreeSet<(u64, u64)>,
    /// Paths, for files that may not exist yet.
    names: BTreeSet<PathBuf>,
}

impl Reads {
    /// Collects files, and folders with all their entries.
    pub fn of<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Self {
        let mut reads = Self::default();
        paths.into_iter().for_each(|path| reads.add(path.as_ref()));
        reads
    }

    fn add(&mut self, path: &Path) {
        self.names.extend(name_of(path));
        let Some(metadata) = std::fs::metadata(path).ok().filter(|_| !is_url(path)) else { return };
        self.ids.insert(id(&metadata));
        if metadata.is_dir() {
            let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
            self.ids.extend(entries.filter_map(|entry| std::fs::metadata(entry.path()).ok()).map(|found| id(&found)));
        }
    }

    /// Whether a path leads to one of them.
    pub fn contains(&self, path: &Path) -> bool {
        std::fs::metadata(path).is_ok_and(|found| self.ids.contains(&id(&found)))
            || name_of(path).is_some_and(|name| self.names.contains(&name))
    }

    /// Refuses such a path for an output.
    ///
    /// # Errors
    ///
    /// If it leads to one of them.
    pub fn refuse(&self, output: &Path) -> Result<(), Error> {
        match self.contains(output) {
            true => Err(Error::Itself(output.to_owned())),
            false => Ok(()),
        }
    }
}

fn id(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}

/// Path of a file with links in its folder resolved, but not in its own name.
fn name_of(path: &Path) -> Option<PathBuf> {
    if is_url(path) {
        return Some(path.to_owned());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(folder.canonicalize().ok()?.join(path.file_name()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_name_leads_to_a_file_that_is_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a"), b"").unwrap();
        std::fs::create_dir(at("bag")).unwrap();
        std::fs::write(at("bag/0"), b"").unwrap();
        std::os::unix::fs::symlink(at("a"), at("link")).unwrap();
        std::os::unix::fs::symlink(at("bag"), at("way")).unwrap();
        std::fs::hard_link(at("bag/0"), at("hard")).unwrap();
        let reads = Reads::of([at("a"), at("bag"), at("later")]);
        for name in ["a", "link", "bag", "way", "bag/0", "way/0", "hard", "later", "bag/../later", "way/../a"] {
            assert!(reads.refuse(&at(name)).is_err(), "{name}");
        }
        for name in ["b", "bag/1", "way/a"] {
            assert!(reads.refuse(&at(name)).is_ok(), "{name}");
        }
    }
}
