//! Progress of a followed recording: everything that changes with its bytes. [`follow`](super::follow) reads them,
//! [`Checkpoint`](crate::run::tail::checkpoint::Checkpoint) saves the state.

use super::index_log::{IndexLog, ItemKind};
use super::location::Location;
use super::shell::Shell;
use crate::Error;
use crate::pipeline::events::{Notice, Notify, Progress};
use crate::pipeline::learner::Learner;
use crate::pipeline::no_imu::why_no_imu;
use crate::record::{START, Scan, Sidecar, is_beginning};
use crate::run::input::growing_file::GrowingFile;
use crate::run::output::sidecar_file::SidecarFile;
use crate::run::stop::Stop;
use crate::run::tail::checkpoint::{Loaded, Split, State};

/// A recording that is followed.
pub(super) struct Progression {
    pub(super) location: Location,
    /// Files that have been read to their ends.
    pub(super) done: Vec<Split>,
    /// The file that is being read.
    pub(super) growing: GrowingFile,
    pub(super) scan: Scan,
    pub(super) learner: Learner,
    /// `None` before its first block.
    pub(super) sidecar: Option<Sidecar>,
    /// Profile of the first file.
    pub(super) profile: String,
    /// Number of blocks in the sidecar.
    pub(super) blocks: u64,
}

impl Progression {
    /// Says why nothing is used so far, if there are topics and none is; returns whether it is settled.
    pub(super) fn notify_useless(&self, notify: Notify<'_>) -> bool {
        let sources = self.learner.sources();
        if !self.learner.has_imu() && sources.channels().next().is_none() {
            return false;
        }
        if !self.learner.has_imu() {
            let why = why_no_imu(sources, &self.learner.obstacles());
            notify(Notice::Trouble(&format!("so far, {why}; waiting for one that begins later")));
        }
        true
    }

    /// Resumes the work of a killed run, or begins anew.
    pub(super) fn begin(
        shell: &mut Shell<'_>,
        location: Location,
        first: GrowingFile,
        notify: Notify<'_>,
    ) -> Result<Self, Error> {
        match shell.checkpoint.load(&shell.owner)? {
            Loaded::State(state) => match find(&location, &state)? {
                Some(growing)
                    if state.length <= shell.sidecar_file.length() && shell.indexes.resume(state.indexes)? =>
                {
                    return Self::resume(shell, location, growing, *state, notify);
                }
                Some(_) => notify(Notice::Trouble("annotations that the checkpoint counts on are gone: starting anew")),
                None => {
                    notify(Notice::Trouble("the checkpoint is of another recording: starting anew"));
                    shell.set_aside(Some(*state), notify)?;
                }
            },
            Loaded::Useless(why, state) => {
                notify(Notice::Trouble(&format!("the checkpoint {why}: starting anew")));
                let found = state.as_ref().map_or(Ok(None), |state| find(&location, state))?;
                if found.is_none() {
                    shell.set_aside(state.map(|state| *state), notify)?;
                }
            }
            Loaded::Nothing => {}
        }
        // Annotations that exist of this recording are found again.
        shell.sidecar_file.begin_anew()?;
        shell.indexes.remove()?;
        let mut learner = Learner::new(shell.config);
        if let Some(name) = location.name_of(first.path()) {
            learner.begin_split(Some(name), true);
        }
        notify(Notice::Opened(0));
        Ok(Self {
            location,
            done: Vec::new(),
            growing: from_the_start(first)?,
            scan: Scan::new().within_limits(shell.config.limits.of_recordings()),
            learner,
            sidecar: None,
            profile: String::new(),
            blocks: 0,
        })
    }

    fn resume(
        shell: &mut Shell<'_>,
        location: Location,
        growing: GrowingFile,
        state: State,
        notify: Notify<'_>,
    ) -> Result<Self, Error> {
        let State { done, position, learner, sidecar, profile, blocks, length, .. } = state;
        shell.sidecar_file.cut(length)?;
        let scan = Scan::resume(position).within_limits(shell.config.limits.of_recordings());
        let learner = learner.resume(shell.config);
        let mut progression = Self { location, done, growing, scan, learner, sidecar, profile, blocks };
        progression.restore_findings(&shell.sidecar_file, shell.stop)?;
        progression.learner.tell_channels(notify);
        notify(Notice::Opened(progression.offset()));
        Ok(progression)
    }

    /// Restores the learner's state from the blocks of a killed run.
    fn restore_findings(&mut self, sidecar: &SidecarFile, stop: &Stop) -> Result<(), Error> {
        let topics = self.learner.topics().to_vec();
        let mut next = sidecar.blocks(&topics);
        while let Some(block) = next()? {
            stop.check()?;
            self.learner.restore_findings(&block.annotations, &topics);
        }
        self.learner.restore_open_findings();
        Ok(())
    }

    /// Begins the next file. The annotations of the one before have been written.
    pub(super) fn turn_to(&mut self, next: GrowingFile, indexes: u64, notify: Notify<'_>) -> Result<(), Error> {
        let name = self.location.name_of(next.path());
        notify(Notice::Split(name.as_deref().unwrap_or_default()));
        self.learner.begin_split(name, false);
        let scan = std::mem::take(&mut self.scan);
        let growing = std::mem::replace(&mut self.growing, from_the_start(next)?);
        self.done.push(Split {
            name: self.location.name_of(growing.path()).unwrap_or_default(),
            known: growing.known().clone(),
            length: growing.length(),
            inventory: scan.into_inventory(),
            topics: self.learner.topics().len(),
            blocks: self.blocks,
            indexes,
        });
        Ok(())
    }

    /// Moves chunk indexes into the log; they are not kept in memory.
    pub(super) fn log_indexes(&mut self, log: &mut IndexLog) {
        log.push(ItemKind::Chunks, &self.scan.take_indexes());
        log.push(ItemKind::Reindexed, &self.scan.take_reindexed());
        self.sidecar.iter_mut().for_each(|sidecar| log.push(ItemKind::Sidecar, &sidecar.take_indexes()));
    }

    /// Names of the files that have begun, in a folder.
    pub(super) fn files(&self) -> Vec<&str> {
        let here = self.growing.path().file_name().and_then(|name| name.to_str()).unwrap_or_default();
        self.done.iter().map(|split| split.name.as_str()).chain([here]).collect()
    }

    /// Number of bytes of the recording that have been read.
    pub(super) fn offset(&self) -> u64 {
        self.behind() + self.scan.offset()
    }

    /// Bytes of the files that have been read to their ends.
    fn behind(&self) -> u64 {
        self.done.iter().map(|split| split.length).sum()
    }

    pub(super) fn tell_progress(&self, sidecar: u64, notify: Notify<'_>) {
        self.learner.tell_imus(notify);
        let length = self.behind() + self.growing.length();
        notify(Notice::Read(Progress { read: self.offset(), length, sidecar }));
    }
}

/// The file that a killed run was reading, if all bytes that it read are still there.
fn find(location: &Location, state: &State) -> Result<Option<GrowingFile>, Error> {
    // A folder and a file beside it may have results of the same stem.
    if location.has_names() == state.name.is_empty() {
        return Ok(None);
    }
    for split in &state.done {
        let Some(mut file) = location.again(&split.name)? else { return Ok(None) };
        if file.length() != split.length || !file.recognise(&split.known)? {
            return Ok(None);
        }
    }
    let Some(mut growing) = location.again(&state.name)? else { return Ok(None) };
    Ok(growing.recognise(&state.known)?.then_some(growing))
}

/// Prepares a file to be recognised by its magic alone: the length of a chunk that is still open may come right behind
/// the header.
fn from_the_start(mut growing: GrowingFile) -> Result<GrowingFile, Error> {
    let mut start = [0; START];
    // Preallocated space is no beginning yet.
    if growing.length() >= START as u64 && growing.read(&mut start, 0)? && is_beginning(&start) {
        growing.passed(START as u64)?;
    }
    Ok(growing)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::input::growing_file::Look;

    #[test]
    fn a_chunk_that_is_open_when_the_recording_is_found_may_close() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec.mcap");
        let header = [mcap::MAGIC, &[1; 30]].concat();
        std::fs::write(&path, [header.as_slice(), &[6], &[0xFF; 8], &[0; 40]].concat()).unwrap();
        let mut growing = from_the_start(GrowingFile::open(&path).unwrap().unwrap()).unwrap();
        // Overwritten in place, and longer.
        let mut file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        std::io::Write::write_all(&mut file, &[header.as_slice(), &[6], &[0; 300]].concat()).unwrap();
        assert_eq!(growing.look().unwrap(), Look::Grown);
        std::fs::write(&path, [7; 400]).unwrap();
        assert_eq!(growing.look().unwrap(), Look::Lost, "not even the magic is there");
    }
}
