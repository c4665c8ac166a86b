//! Where a tail stands, on disk: replaced as a whole at each save, so that a kill at any instant leaves the one before.
//!
//! The sidecar and the index log are put on the device before the checkpoint that counts on them. Saving runs on a thread of its own, since
//! a device takes its time; when to save is left to the [tail](crate::run::tail).

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::index_log::{IndexLog, Mark};
use crate::Error;
use crate::pipeline::learner::Learner;
use crate::record::{Inventory, Position, Sidecar};
use crate::run::input::regular;
use crate::run::output::partial::{Partial, sweep};
use crate::run::output::reads::Reads;
use crate::run::output::sidecar_file::SidecarFile;

/// What a checkpoint begins with; another layout gets another number.
const MAGIC: &[u8; 16] = b"stillpointtail05";
/// What every layout begins with.
const OURS: &[u8] = b"stillpointtail";
/// Of magic and checksum.
const HEAD: usize = 16 + 4;
/// Larger is none (1 GiB): the largest hold the inventory of a whole recording.
const LARGEST: u64 = 1 << 30;
/// Saves are at least this far apart, …
const INTERVAL: Duration = Duration::from_secs(1);
/// … and so many times as long as putting the state together takes.
const SHARE: u32 = 20;

/// What a checkpoint belongs to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Owner {
    pub(super) version: String,
    pub(super) configuration: String,
}

/// A file of a recording, read to its end.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Split {
    pub(super) name: String,
    /// What it is known again by.
    pub(super) known: (u64, Vec<u8>),
    /// In bytes.
    pub(super) length: u64,
    pub(super) inventory: Inventory,
    /// So many topics and blocks of annotations there were at its end.
    pub(super) topics: usize,
    pub(super) blocks: u64,
    /// How long the index log was.
    pub(super) indexes: u64,
}

/// All that a tail has to remember.
#[derive(Serialize, Deserialize)]
pub(super) struct State {
    pub(super) done: Vec<Split>,
    /// The file that is read, in a folder.
    pub(super) name: String,
    /// What that is known again by.
    pub(super) known: (u64, Vec<u8>),
    pub(super) position: Position,
    pub(super) learner: Learner,
    /// `None` before the sidecar has begun.
    pub(super) sidecar: Option<Sidecar>,
    pub(super) profile: String,
    /// In the sidecar.
    pub(super) blocks: u64,
    /// Of the sidecar, in bytes.
    pub(super) length: u64,
    /// Where the index log stands.
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

/// What is found under the name of a checkpoint.
pub(super) enum Loaded {
    Nothing,
    State(Box<State>),
    /// Something that cannot be gone on with, why, and what can be read of it.
    Useless(&'static str, Option<Box<State>>),
}

/// Saves and loads.
#[derive(Debug)]
pub(super) struct Checkpoint {
    path: PathBuf,
    /// Whether something stands there that is no checkpoint. It stays, and nothing is saved.
    foreign: bool,
    next: Instant,
    saving: Option<JoinHandle<Result<(), Error>>>,
}

impl Checkpoint {
    pub(super) fn new(path: PathBuf) -> Self {
        let foreign = is_foreign(&path);
        Self { path, foreign, next: Instant::now() + INTERVAL, saving: None }
    }

    /// Why nothing is saved, if something else stands in its place.
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

    /// Marks the sidecar as ours before there is a state to go on from.
    pub(super) fn mark(&mut self, owner: &Owner) -> Result<(), Error> {
        self.settle()?;
        if self.foreign {
            return Ok(());
        }
        let bytes = encode(owner, None).map_err(|error| Error::io("write", &self.path)(io::Error::other(error)))?;
        replace(&self.path, &bytes)
    }

    /// Whether it is time to save again.
    pub(super) fn is_due(&self) -> bool {
        !self.foreign && self.next <= Instant::now() && self.saving.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Begins to save. What became of the save before is told now.
    pub(super) fn save(
        &mut self,
        owner: &Owner,
        state: &StateOf<'_>,
        sidecar: &SidecarFile,
        indexes: &IndexLog,
    ) -> Result<(), Error> {
        let before = self.settle();
        if self.foreign {
            return before;
        }
        let began = Instant::now();
        let bytes =
            encode(owner, Some(state)).map_err(|error| Error::io("write", &self.path)(io::Error::other(error)))?;
        self.next = Instant::now() + INTERVAL.max(SHARE * began.elapsed());
        let written = sidecar.file().try_clone().map_err(Error::io("write", sidecar.path()))?;
        let (path, beside) = (self.path.clone(), sidecar.path().to_owned());
        let indexes = indexes.file()?;
        let save = move || {
            written.sync_data().map_err(Error::io("write", &beside))?;
            indexes.map_or(Ok(()), |indexes| indexes.sync_data()).map_err(Error::io("write", &beside))?;
            replace(&path, &bytes)
        };
        // Without a thread, the next save comes in time.
        self.saving = std::thread::Builder::new().spawn(save).ok();
        before
    }

    /// Waits until what was begun is done.
    pub(super) fn settle(&mut self) -> Result<(), Error> {
        let Some(thread) = self.saving.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }

    pub(super) fn remove(&mut self) -> Result<(), Error> {
        // It is removed, however it is.
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

/// Whether something stands under the name of a checkpoint that is none, of whatever version.
pub(crate) fn is_foreign(path: &Path) -> bool {
    let begins = |file: std::fs::File| {
        let mut start = [0; OURS.len()];
        let read = std::os::unix::fs::FileExt::read_exact_at(&file, &mut start, 0);
        read.is_ok() && start == OURS
    };
    path.symlink_metadata().is_ok() && !regular::open_own(path).is_ok_and(begins)
}

fn encode(owner: &Owner, state: Option<&StateOf<'_>>) -> Result<Vec<u8>, rmp_serde::encode::Error> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend([0; 4]);
    // Names of fields are kept, since the configuration leaves out what is not set.
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

/// Puts bytes under a name, on the device, or leaves what was there.
fn replace(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let partial = Partial::create(path, &Reads::default())?;
    partial.file().write_all(bytes).map_err(Error::io("write", path))?;
    partial.finish(true)
}
