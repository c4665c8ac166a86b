//! A folder as a result: written under another name and renamed when complete, or compared with the existing one.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::Error;
use crate::run::input::regular;
use crate::run::input::rosbag2::{self, Bag};
use crate::run::output::file::Output;
use crate::run::output::names::without_ending;
use crate::run::output::partial::{Partial, folder_beside, rename_new, sync_folder};
use crate::run::output::reads::Reads;
use crate::run::output::written::Written;

/// A folder that becomes the result.
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    /// Temporary path that it is written to, and its lock against other runs; `None` if the folder exists already.
    new: Option<(PathBuf, File)>,
    /// Whether an existing folder of that name is replaced.
    replaces: bool,
    reads: Reads,
    finished: bool,
}

impl Folder {
    /// Opens the folder of that name. With `force`, an existing one is replaced; else it is compared.
    pub(crate) fn open(path: &Path, force: bool, reads: Reads) -> Result<Self, Error> {
        let exists = path.symlink_metadata().is_ok();
        if exists && !path.is_dir() {
            return Err(Error::input(path, "is a file, but the result is a folder; choose another name"));
        }
        if exists && force && !is_recording(path) {
            return Err(Error::input(path, "holds more than a recording; choose another name"));
        }
        if force {
            reads.refuse(path)?;
        }
        let new = match exists && !force {
            true => None,
            false => Some(folder_beside(path).map_err(Error::io("write", path))?),
        };
        Ok(Self { path: path.to_owned(), new, replaces: force, reads, finished: false })
    }

    fn place(&self) -> &Path {
        self.new.as_ref().map_or(&self.path, |(place, _)| place)
    }

    /// An output file in it.
    pub(crate) fn output(&self, name: &str) -> Result<Output, Error> {
        let path = self.place().join(name);
        match self.new.is_some() || path.exists() {
            true => Output::open(&path, self.new.is_some(), &self.reads),
            false => Err(Error::Exists(self.path.clone())),
        }
    }

    /// Writes a small file into it.
    pub(crate) fn put(&self, name: &str, text: &str, sync: bool) -> Result<(), Error> {
        let path = self.place().join(name);
        if self.new.is_some() {
            return write(Partial::create_new(&path)?, text, sync);
        }
        match std::fs::read(&path) {
            Ok(found) if found == text.as_bytes() => Ok(()),
            _ => Err(Error::Exists(self.path.clone())),
        }
    }

    /// Copies a file of a recording into it, unchanged.
    pub(crate) fn copy(&self, bag: &Bag, name: &str, sync: bool) -> Result<(), Error> {
        let (from, path) = (bag.folder().join(name), self.place().join(name));
        if self.new.is_some() {
            let copy = Partial::create_new(&path)?;
            let mut source = regular::open(&from).map_err(Error::io("read", &from))?;
            std::io::copy(&mut source, &mut copy.file()).map_err(Error::io("write", &path))?;
            return copy.finish(sync);
        }
        let length = |path: &Path| std::fs::metadata(path).map(|metadata| metadata.len());
        match (length(&from), length(&path)) {
            (Ok(from), Ok(found)) if from == found => Ok(()),
            _ => Err(Error::Exists(self.path.clone())),
        }
    }

    /// Completes the folder.
    pub(crate) fn finish(mut self, sync: bool) -> Result<Written, Error> {
        let Some((place, _)) = &self.new else { return Ok(Written::Before) };
        let refused = |e| Error::io("write", &self.path)(e);
        if sync {
            File::open(place).and_then(|folder| folder.sync_all()).map_err(refused)?;
        }
        match rename_new(place, &self.path) {
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists && self.replaces => self.replace(place)?,
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                return Err(Error::Exists(self.path.clone()));
            }
            named => {
                named.map_err(refused)?;
                self.finished = true;
            }
        }
        if sync {
            sync_folder(&self.path).map_err(refused)?;
        }
        Ok(Written::Now)
    }

    /// Takes the place of the existing folder, which must hold one recording and nothing else. The old content is
    /// removed when this is dropped, and by the next run if this one is killed.
    fn replace(&self, place: &Path) -> Result<(), Error> {
        let refused = |e| Error::io("write", &self.path)(e);
        let listed = rosbag2::listed(&self.path).unwrap_or_default();
        for entry in std::fs::read_dir(&self.path).map_err(refused)? {
            let entry = entry.map_err(refused)?;
            self.reads.refuse(&entry.path())?;
            let name = entry.file_name();
            let belongs = place.join(&name).exists() || listed.iter().any(|known| name == known.as_str());
            if !belongs && without_ending(&name, &[".partial"]).is_none() {
                let why = format!("holds {}, which would be lost: move it, or choose another name", name.display());
                return Err(Error::input(&self.path, why));
            }
        }
        match renameat_with(CWD, place, CWD, &self.path, RenameFlags::EXCHANGE) {
            // Not every file system supports this.
            Err(Errno::INVAL | Errno::NOSYS | Errno::OPNOTSUPP) => {
                let aside = with_suffix(&self.path, ".replaced");
                rename_new(&self.path, &aside).map_err(Error::io("write", &aside))?;
                std::fs::rename(place, &self.path).map_err(refused)?;
                std::fs::rename(&aside, place).map_err(refused)
            }
            done => Ok(done.map_err(|e| refused(e.into()))?),
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if let Some((place, _)) = self.new.take()
            && !self.finished
        {
            // The error has no receiver, and the next run removes what could not be removed.
            let _ = std::fs::remove_dir_all(place);
        }
    }
}

/// Writes a small file, completely or not at all.
pub(crate) fn write(partial: Partial, text: &str, sync: bool) -> Result<(), Error> {
    partial.file().write_all(text.as_bytes()).map_err(Error::io("write", partial.target()))?;
    partial.finish(sync)
}

/// Whether a folder holds only files that rosbag2 and Stillpoint write.
fn is_recording(folder: &Path) -> bool {
    let Ok(mut entries) = std::fs::read_dir(folder) else { return false };
    entries.all(|entry| {
        entry.is_ok_and(|entry| {
            let path = entry.path();
            path.is_file() && matches!(path.extension().and_then(|e| e.to_str()), Some("mcap" | "yaml" | "partial"))
        })
    })
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(suffix);
    path.with_file_name(name)
}
