//! One recording as the user names it: a file, several files that are one, or a rosbag2 folder. [`Recording`] reads its
//! files.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::Error;
use crate::config::{Config, Layer};
use crate::record::{Damage, Event, FileKind, Limits};
use crate::run::input::recording::{Recording, Watch};
use crate::run::input::rosbag2::{self, Bag, is_blank};
use crate::run::input::scan_file::Listener;
use crate::run::limits::check_files;
use crate::run::output::in_place::Access;
use crate::run::output::reads::Reads;
use crate::topic;

/// A recording: its files, called splits, in time order.
#[derive(Debug)]
pub struct Input {
    path: PathBuf,
    pub(crate) splits: Vec<Recording>,
    pub(crate) bag: Option<Bag>,
    /// Names of its files in which nothing was recorded, and their damage.
    blank: Vec<(String, Damage)>,
}

impl Input {
    /// Opens a file or rosbag2 folder. The recording is all of it.
    ///
    /// # Errors
    ///
    /// If it is missing, empty, not a recording, or may not be read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::each(path, Recording::open)
    }

    /// Opens a file or rosbag2 folder. The recording is the original in it if Stillpoint annotated it, else all of it.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open), and if it holds annotations alone.
    pub fn open_original(path: &Path, access: Access) -> Result<Self, Error> {
        Self::each(path, |file| Recording::open_original(file, access))
    }

    /// Opens a file or rosbag2 folder that Stillpoint annotated. The recording is the original in it.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open), and if it holds no original, or was edited since.
    pub fn open_annotated(path: &Path) -> Result<Self, Error> {
        let input = Self::each(path, Recording::open_annotated)?;
        match &input.bag {
            Some(bag) if !bag.is_annotated() => {
                Err(Error::input(path, "was not annotated by Stillpoint: there is nothing to strip"))
            }
            _ => Ok(input),
        }
    }

    /// As [`open_original`](Self::open_original), but a folder that its recorder has not finished consists of the files
    /// that are there.
    pub(crate) fn as_it_is(path: &Path) -> Result<Self, Error> {
        if path.is_dir() && !rosbag2::is_finished(path) {
            return Self::all(Bag::unfinished(path), |file| Recording::open_original(file, Access::Read));
        }
        Self::open_original(path, Access::Read)
    }

    /// A recording that is already open.
    pub(crate) fn of(recording: Recording) -> Self {
        Self { path: recording.path().to_owned(), splits: vec![recording], bag: None, blank: Vec::new() }
    }

    /// Opens files that are one recording: the originals in them, ordered by their first messages.
    ///
    /// # Errors
    ///
    /// As [`open_original`](Self::open_original).
    pub fn join(paths: &[PathBuf], access: Access) -> Result<Self, Error> {
        let (mut splits, mut blank) = (Vec::new(), Vec::new());
        check_files(paths.first().map_or(Path::new(""), PathBuf::as_path), paths.len(), 1)?;
        for (index, path) in paths.iter().enumerate() {
            if path.is_dir() {
                return Err(Error::input(path, "is a folder, which is one recording already; --join takes files"));
            }
            if index > 0 && is_blank(path) {
                blank.push(damage(path)?);
                continue;
            }
            let split = Recording::open_original(path, access)?;
            splits.push((split.first_log_time()?, split));
        }
        // Splits without messages go first, in the order in which they were named.
        splits.sort_by_key(|&(first, _)| first.unwrap_or_default());
        let splits = splits.into_iter().map(|(_, split)| split).collect();
        Ok(Self { path: paths.first().cloned().unwrap_or_default(), splits, bag: None, blank })
    }

    fn each(path: &Path, mut open: impl FnMut(&Path) -> Result<Recording, Error>) -> Result<Self, Error> {
        match path.is_dir() {
            true => Self::all(Bag::open(path)?, open),
            false => Ok(Self { path: path.to_owned(), splits: vec![open(path)?], bag: None, blank: Vec::new() }),
        }
    }

    fn all(bag: Bag, mut open: impl FnMut(&Path) -> Result<Recording, Error>) -> Result<Self, Error> {
        let path = bag.folder().to_owned();
        check_files(&path, bag.names().count(), 1)?;
        let splits = bag.names().map(|name| open(&path.join(name))).collect::<Result<_, _>>()?;
        let blank = bag.blank().map(|name| damage(&path.join(name))).collect::<Result<_, _>>()?;
        Ok(Self { path, splits, bag: Some(bag), blank })
    }

    /// Path: the folder, or the first of several files.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length and, of an object, version, which tell it from other recordings of the same name.
    pub(crate) fn identity(&self) -> String {
        self.splits.iter().map(Recording::identity).collect::<Vec<_>>().join("+")
    }

    /// Whether bytes of it come from a store, where those that are not needed are dear.
    pub(crate) fn is_remote(&self) -> bool {
        self.splits.iter().any(|split| split.source().is_object())
    }

    /// Length of all files together, in bytes.
    pub fn length(&self) -> u64 {
        self.splits.iter().map(Recording::length).sum()
    }

    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        self.bag.is_some()
    }

    /// Paths of its files, without those in which nothing was recorded.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.splits.iter().map(Recording::path)
    }

    /// Files that must not become an output of it.
    pub fn reads(&self) -> Reads {
        let folder = self.bag.iter().map(Bag::folder);
        Reads::of(self.splits.iter().map(Recording::path).chain(folder).chain([self.path()]))
    }

    /// Notes on its files that another program edited after they were annotated, one line each.
    pub fn edits(&self) -> impl Iterator<Item = String> {
        self.splits.iter().filter_map(|split| Some(format!("{}: {}", split.path().display(), split.edit()?)))
    }

    /// Names of its files in which nothing was recorded, and their damage.
    pub(crate) fn blank(&self) -> &[(String, Damage)] {
        &self.blank
    }

    /// Whether another one holds the same bytes.
    pub(crate) fn is_same(&self, other: &Self, watch: Watch<'_>) -> Result<bool, Error> {
        if !self.splits.iter().map(Recording::length).eq(other.splits.iter().map(Recording::length)) {
            return Ok(false);
        }
        for (split, other) in self.splits.iter().zip(&other.splits) {
            let (mut at, mut same, mut read) = (0, true, Ok(()));
            split.read(0..split.length(), watch, |bytes| {
                let mut found = vec![0; bytes.len()];
                if same && read.is_ok() {
                    read = other.read_exact_at(&mut found, at);
                    same = found == bytes;
                    at += bytes.len() as u64;
                }
            })?;
            read?;
            if !same {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Names of its files if there are several, else none.
    pub(crate) fn split_names(&self) -> impl Iterator<Item = String> {
        let several = self.splits.len() > 1;
        let name = |split: &Recording| split.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.splits.iter().filter(move |_| several).map(name)
    }

    /// Settings that determined the annotations, if it holds any.
    pub(crate) fn settings(&self) -> Result<Option<BTreeMap<String, String>>, Error> {
        self.splits.first().map_or(Ok(None), Recording::settings)
    }

    /// The configuration, with the mapping that the recording was annotated with before unless there is another.
    pub(crate) fn configured<'a>(&self, config: &'a Config) -> Cow<'a, Config> {
        let earlier = self.splits.first().and_then(Recording::annotated_with).filter(|_| config.imu.is_empty());
        let earlier = earlier.and_then(|text| Config::load(&[Layer::file("the recording", text)]).ok());
        match earlier.filter(|earlier| !earlier.imu.is_empty()) {
            Some(Config { imu, .. }) => Cow::Owned(Config { imu, ..config.clone() }),
            None => Cow::Borrowed(config),
        }
    }

    /// Calls `each` with the index of a split and a damage, for all damages of originals that are damaged where their
    /// annotated copies are whole.
    pub(crate) fn hidden_damages(
        &self,
        limits: Limits,
        watch: Watch<'_>,
        mut each: impl FnMut(usize, Damage),
    ) -> Result<(), Error> {
        for (index, split) in self.splits.iter().enumerate() {
            let Some(original) = split.damaged_original()? else { continue };
            original.scan(limits, watch, &mut |event: Event<'_>| {
                if let Event::Damage(damage) = event {
                    each(index, damage);
                }
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The same recording with another split in place of this one.
    pub(crate) fn with_split(&self, index: usize, split: Recording) -> Result<Self, Error> {
        let mut splits = self.splits.iter().map(Recording::again).collect::<Result<Vec<_>, _>>()?;
        splits.splice(index..=index, [split]);
        Ok(Self { path: self.path.clone(), splits, bag: self.bag.clone(), blank: self.blank.clone() })
    }

    /// Scans the annotations of all splits. In a store, chunks without any are not read.
    ///
    /// # Errors
    ///
    /// As [`scan`](Self::scan).
    pub(crate) fn scan_annotations(
        &self,
        limits: Limits,
        watch: Watch<'_>,
        mut each: impl FnMut(Read<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        if !self.is_remote() {
            return self.scan(limits, watch, each);
        }
        for split in &self.splits {
            let mut listener = AnnotationsOnly { each: &mut each, others: BTreeSet::new() };
            split.scan(limits, watch, &mut listener)?;
            each(Read::SplitEnd)?;
        }
        Ok(())
    }

    /// Scans all splits within limits, one after the other.
    ///
    /// # Errors
    ///
    /// If a split is not MCAP, if the system refuses, or what `watch` or `each` returns.
    pub(crate) fn scan(
        &self,
        limits: Limits,
        watch: Watch<'_>,
        mut each: impl FnMut(Read<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let mut done = 0;
        for split in &self.splits {
            split.scan(limits, &|at| watch(done + at), &mut |event: Event<'_>| each(Read::Event(event)))?;
            each(Read::SplitEnd)?;
            done += split.length();
        }
        for (name, damage) in &self.blank {
            let damage = Damage { what: format!("{name}: {}", damage.what), ..damage.clone() };
            each(Read::Event(Event::Damage(damage)))?;
        }
        Ok(())
    }
}

/// Kind of result that Stillpoint made of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made {
    /// The recording with its annotations.
    Annotated,
    /// The annotations alone.
    Sidecar,
}

/// Kind of the file or folder, if Stillpoint made it; `None` also where that cannot be told.
pub fn made(path: &Path) -> Option<Made> {
    if path.is_dir() {
        return rosbag2::has_original(path).then_some(Made::Annotated);
    }
    match Recording::open(path).ok()?.kind().ok()? {
        FileKind::Annotated { .. } => Some(Made::Annotated),
        FileKind::Sidecar { .. } => Some(Made::Sidecar),
        FileKind::Recording | FileKind::Edited { .. } => None,
    }
}

/// Damage of a file in which nothing was recorded, behind others with content.
fn damage(file: &Path) -> Result<(String, Damage), Error> {
    let length = std::fs::metadata(file).map_err(Error::io("read", file))?.len();
    let what = match length {
        0 => "is empty: nothing was recorded into it",
        _ => "does not begin like an MCAP recording: nothing was recorded into it, or it is lost",
    };
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok((name, Damage { offset: 0, length, what: what.to_owned() }))
}

/// Step of reading a recording.
pub(crate) enum Read<'a> {
    Event(Event<'a>),
    /// End of a split.
    SplitEnd,
}

/// Listener that needs annotations alone.
struct AnnotationsOnly<'f, F> {
    each: &'f mut F,
    /// Channels of other topics.
    others: BTreeSet<u16>,
}

impl<F: FnMut(Read<'_>) -> Result<(), Error>> Listener for AnnotationsOnly<'_, F> {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        if let Event::Channel(channel) = &event
            && !topic::is_annotation(&channel.topic)
        {
            self.others.insert(channel.id);
        }
        (self.each)(Read::Event(event))
    }

    fn is_useless(&self, channels: &[u16]) -> bool {
        channels.iter().all(|channel| self.others.contains(channel))
    }
}
