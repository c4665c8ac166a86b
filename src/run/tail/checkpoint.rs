//! Checkpoint of a tail on disk: replaced atomically at each save, so that a kill at any instant leaves the previous
//! one.
//!
//! The sidecar and the index log are synced before the checkpoint that relies on them. Saving runs on its own thread,
//! since a device takes its time; the [tail](crate::run::tail) decides when to save.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::index_log::{IndexLog, Mark};
use crate::Error;
use crate::pipeline::events::{Notice, Notify};
use crate::pipeline::learner::Learner;
use crate::record::{Inventory, Position, Sidecar};
use crate::run::input::regular;
use crate::run::output::partial::{Partial, sweep};
use crate::run::output::reads::Reads;
use crate::run::output::sidecar_file::SidecarFile;

/// First bytes of a checkpoint; another layout gets another number.
const MAGIC: &[u8; 16] = b"stillpointtail13";
/// First bytes of every layout.
const OURS: &[u8] = b"stillpointtail";
/// Length of magic and checksum, in bytes.
const HEAD: usize = 16 + 4;
/// Most bytes of a checkpoint (1 GiB): the largest hold the inventory of a whole recording.
const LARGEST: u64 = 1 << 30;
/// Least time between two saves.
const INTERVAL: Duration = Duration::from_secs(1);
/// Least time between two saves, as a multiple of the time that encoding the state takes.
const SHARE: u32 = 20;

/// Program version and configuration that a checkpoint belongs to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Owner {
    pub(super) version: String,
    pub(super) configuration: String,
}

/// A file of a recording, read to its end.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Split {
    pub(super) name: String,
    /// Offset and bytes by which it is recognised.
    pub(super) known: (u64, Vec<u8>),
    /// Length in bytes.
    pub(super) length: u64,
    pub(super) inventory: Inventory,
    /// Numbers of topics and annotation blocks at its end.
    pub(super) topics: usize,
    pub(super) blocks: u64,
    /// Length of the index log at its end, in bytes.
    pub(super) indexes: u64,
}

/// Complete state of a tail.
#[derive(Serialize, Deserialize)]
pub(super) struct State {
    pub(super) done: Vec<Split>,
    /// Name of the file that is being read, in a folder.
    pub(super) name: String,
    /// Offset and bytes by which that file is recognised.
    pub(super) known: (u64, Vec<u8>),
    pub(super) position: Position,
    pub(super) learner: Learner,
    /// `None` before the sidecar has begun.
    pub(super) sidecar: Option<Sidecar>,
    pub(super) profile: String,
    /// Number of blocks in the sidecar.
    pub(super) blocks: u64,
    /// Length of the sidecar in bytes.
    pub(super) length: u64,
    /// Mark of the index log.
    pub(super) indexes: Mark,
}

/// The same, borrowed.
#[derive(Serialize)]
pub(super) struct StateOf<'a> {
    pub(super) done: &'a [Split],
    pub(super) name: &'a str,
    pub(super) known: &'a (u64, Vec<u8>),
    pub(super) position: &'a Position,
    pub(super) learner: &'a Learner,
    pub(super) sidecar: &'a Option<Sidecar>,
    pub(super) profile: &'a str,
    pub(super) blocks: u64,
    pub(super) length: u64,
    pub(super) indexes: Mark,
}

/// Content of a checkpoint's path.
pub(super) enum Loaded {
    Nothing,
    State(Box<State>),
    /// Something that cannot be resumed, why, and the state as far as it can be read.
    Useless(&'static str, Option<Box<State>>),
}

/// Saving and loading.
#[derive(Debug)]
pub(super) struct Checkpoint {
    path: PathBuf,
    /// Whether the path holds something that is no checkpoint. It stays, and nothing is saved.
    foreign: bool,
    next: Instant,
    saving: Option<JoinHandle<Result<(), Error>>>,
}

impl Checkpoint {
    /// Looks at the file of this path, and leaves it as it is.
    ///
    /// # Errors
    ///
    /// If the system does not show it.
    pub(super) fn new(path: PathBuf) -> Result<Self, Error> {
        let foreign = is_foreign(&path)?;
        Ok(Self { path, foreign, next: Instant::now() + INTERVAL, saving: None })
    }

    /// Reason why nothing is saved, if something else has the name.
    pub(super) fn obstacle(&self) -> Option<String> {
        let path = self.path.display();
        self.foreign.then(|| format!("{path} is no checkpoint and is left alone: a tail that is killed begins anew"))
    }

    pub(super) fn exists(&self) -> bool {
        !self.foreign && self.path.exists()
    }

    pub(super) fn load(&self, owner: &Owner) -> Result<Loaded, Error> {
        if !self.exists() {
            return Ok(Loaded::Nothing);
        }
        sweep(&self.path);
        let bytes = match regular::open_own(&self.path).and_then(|file| regular::read(file, LARGEST)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Loaded::Nothing),
            read => read.map_err(Error::io("read", &self.path))?,
        };
        Ok(decode(&bytes, owner))
    }

    /// Marks the sidecar as ours before there is a state to resume.
    pub(super) fn mark(&mut self, owner: &Owner) -> Result<(), Error> {
        self.settle()?;
        if self.foreign {
            return Ok(());
        }
        let bytes = encode(owner, None).map_err(|error| Error::io("write", &self.path)(io::Error::other(error)))?;
        // Not synced: on a busy disk that takes seconds. A power cut may leave an empty file, which is taken for a mark.
        replace(&self.path, &bytes, false)
    }

    /// Whether the next save is due.
    pub(super) fn is_due(&self) -> bool {
        !self.foreign && self.next <= Instant::now() && self.saving.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Begins to save. Returns the error of the save before.
    pub(super) fn save(
        &mut self,
        owner: &Owner,
        state: &StateOf<'_>,
        sidecar: &SidecarFile,
        indexes: &IndexLog,
        notify: Notify<'_>,
    ) -> Result<(), Error> {
        let before = self.settle();
        if self.foreign {
            return before;
        }
        let began = Instant::now();
        let bytes =
            encode(owner, Some(state)).map_err(|error| Error::io("write", &self.path)(io::Error::other(error)))?;
        let encoding = began.elapsed();
        self.next = Instant::now() + INTERVAL.max(SHARE * encoding);
        notify(Notice::Saved { length: bytes.len() as u64, encoding });
        let written = sidecar.file().try_clone().map_err(Error::io("write", sidecar.path()))?;
        let (path, beside) = (self.path.clone(), sidecar.path().to_owned());
        let indexes = indexes.file()?;
        let save = move || {
            written.sync_data().map_err(Error::io("write", &beside))?;
            indexes.map_or(Ok(()), |indexes| indexes.sync_data()).map_err(Error::io("write", &beside))?;
            replace(&path, &bytes, true)
        };
        // Without a thread, the next save comes in time.
        self.saving = std::thread::Builder::new().spawn(save).ok();
        before
    }

    /// Waits for the save in progress.
    pub(super) fn settle(&mut self) -> Result<(), Error> {
        let Some(thread) = self.saving.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    pub(super) fn remove(&mut self) -> Result<(), Error> {
        // It is removed even if the last save failed.
        let _ = self.settle();
        if self.foreign {
            return Ok(());
        }
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(Error::io("remove", &self.path)(error)),
            _ => Ok(()),
        }
    }
}

/// Whether a checkpoint's name belongs to something that is no checkpoint of any version.
///
/// # Errors
///
/// If the system does not show it.
pub(crate) fn is_foreign(path: &Path) -> Result<bool, Error> {
    Ok(regular::begins_with(path, OURS).map_err(Error::io("read", path))? == Some(false))
}

fn encode(owner: &Owner, state: Option<&StateOf<'_>>) -> Result<Vec<u8>, rmp_serde::encode::Error> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend([0; 4]);
    // Field names are kept, since the configuration omits fields that are not set.
    rmp_serde::encode::write_named(&mut bytes, owner)?;
    if let Some(state) = state {
        rmp_serde::encode::write_named(&mut bytes, state)?;
    }
    let crc = crc32fast::hash(bytes.get(HEAD..).unwrap_or_default());
    if let Some(place) = bytes.get_mut(MAGIC.len()..HEAD) {
        place.copy_from_slice(&crc.to_le_bytes());
    }
    Ok(bytes)
}

fn decode(bytes: &[u8], owner: &Owner) -> Loaded {
    let Some((head, mut body)) = bytes.split_at_checked(HEAD) else { return Loaded::Useless("is damaged", None) };
    let Some(crc) = head.strip_prefix(MAGIC) else { return Loaded::Useless("is of another version", None) };
    if crc != crc32fast::hash(body).to_le_bytes() {
        return Loaded::Useless("is damaged", None);
    }
    let found = rmp_serde::from_read::<_, Owner>(&mut body);
    // Nothing follows a mark.
    let state = (!body.is_empty()).then(|| rmp_serde::from_read(&mut body));
    match (found, state) {
        (Ok(found), state) if found.version == owner.version && found.configuration != owner.configuration => {
            Loaded::Useless("is of another configuration", state.and_then(Result::ok))
        }
        (Ok(found), None) if found == *owner => Loaded::Nothing,
        (Ok(found), Some(Ok(state))) if found == *owner => Loaded::State(state),
        (_, state) => Loaded::Useless("is of another version", state.and_then(Result::ok)),
    }
}

/// Writes bytes under a name, synced if asked for, or leaves the old file.
fn replace(path: &Path, bytes: &[u8], sync: bool) -> Result<(), Error> {
    let partial = Partial::create(path, &Reads::default())?;
    partial.file().write_all(bytes).map_err(Error::io("write", path))?;
    partial.finish(sync)
}
