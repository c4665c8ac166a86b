//! Reading a recording as it grows and writing its annotations, until nothing more is recorded. Then
//! [`finish`](super::finish) takes over.

use std::time::{Duration, Instant};

use super::shell::Shell;
use super::state::Progression;
use crate::Error;
use crate::pipeline::events::{Ending, Notice, Notify};
use crate::record::{Block, Event, Scan, Sidecar};
use crate::run::batch;
use crate::run::input::growing_file::{GrowingFile, Look};
use crate::run::tail::checkpoint::StateOf;

/// Largest block to read; smaller reads would cost more than their bytes (1 MiB).
const READ: usize = 1 << 20;
/// Wait for more bytes in a file that its recorder has left, for another name or the next file.
const LEFT: Duration = Duration::from_secs(2);
/// Wait for more when a recording looks finished, but has no readable end, or no further file yet.
const CLOSED: Duration = Duration::from_secs(1);
/// Time without a usable topic after which that is said, rather than at the end.
const USELESS: Duration = Duration::from_secs(3);

/// Result of reading.
enum Reached {
    /// All available bytes were read.
    Here,
    End,
    /// Bytes that were there are gone.
    Loss,
}

impl Shell<'_> {
    /// Follows the recording to its end.
    pub(super) fn record(&mut self, progression: &mut Progression, notify: Notify<'_>) -> Result<Ending, Error> {
        loop {
            let ending = self.record_file(progression, notify)?;
            match self.await_next(progression, ending, notify)? {
                Ok(next) => {
                    // No block extends into the next file.
                    progression.learner.end_split();
                    self.write(progression, notify)?;
                    progression.log_indexes(&mut self.indexes);
                    let indexes = self.patiently(notify, |shell| shell.indexes.flush())?.length;
                    progression.turn_to(next, indexes, notify)?;
                }
                Err(ending) => return Ok(ending),
            }
        }
    }

    /// Follows a file to its end.
    fn record_file(&mut self, progression: &mut Progression, notify: Notify<'_>) -> Result<Ending, Error> {
        let mut last = Instant::now();
        // Of several files the first one tells.
        let mut useless = progression.done.is_empty().then(|| last + USELESS);
        let mut unnamed = None;
        loop {
            progression.scan.extend(progression.growing.length());
            match self.read(progression, notify)? {
                Reached::Here => {}
                Reached::End => return Ok(Ending::Finished),
                Reached::Loss => return Ok(Ending::Truncated),
            }
            self.save_if_due(progression, notify);
            loop {
                progression.tell_progress(self.sidecar_file.length(), notify);
                if useless.is_some_and(|due| due <= Instant::now()) && progression.notify_useless(notify) {
                    useless = None;
                }
                self.pause(self.following.poll)?;
                match self.patiently(notify, |_| progression.growing.look())? {
                    Look::Grown => {
                        last = Instant::now();
                        break;
                    }
                    Look::Lost => return Ok(Ending::Truncated),
                    Look::Unnamed(ending) => unnamed = Some(ending),
                    Look::Same => {}
                }
                let idle = last.elapsed();
                let ending = match unnamed {
                    Some(ending) if idle >= LEFT => ending,
                    _ if idle >= self.following.idle => Ending::Idle,
                    _ if idle >= CLOSED && progression.growing.is_closed() => Ending::Finished,
                    _ if idle >= LEFT && progression.location.next(&progression.files())?.is_some() => Ending::Idle,
                    _ => {
                        self.save_if_due(progression, notify);
                        continue;
                    }
                };
                progression.scan.finish();
                return match self.read(progression, notify)? {
                    Reached::Loss => Ok(Ending::Truncated),
                    Reached::Here | Reached::End => Ok(ending),
                };
            }
        }
    }

    /// The next file of the recording, or why there is none.
    fn await_next(
        &mut self,
        progression: &Progression,
        ending: Ending,
        notify: Notify<'_>,
    ) -> Result<Result<GrowingFile, Ending>, Error> {
        if ending == Ending::Truncated {
            return Ok(Err(ending));
        }
        let files = progression.files();
        let began = Instant::now();
        loop {
            // First, so that a file that begins meanwhile is not overlooked.
            let listed = progression.location.ends_with(&files);
            if let Some(next) = progression.location.next(&files)? {
                return Ok(Ok(next));
            }
            let (quiet, alone) = (began.elapsed(), progression.location.name_of(progression.growing.path()).is_none());
            if alone || ending != Ending::Finished || listed && quiet >= CLOSED.min(self.following.idle) {
                return Ok(Err(ending));
            }
            if quiet >= self.following.idle {
                return Ok(Err(Ending::Idle));
            }
            if quiet >= LEFT && !progression.location.path().exists() {
                return Ok(Err(Ending::Deleted));
            }
            progression.tell_progress(self.sidecar_file.length(), notify);
            self.pause(self.following.poll)?;
        }
    }

    /// Reads the available bytes and writes the annotations.
    fn read(&mut self, progression: &mut Progression, notify: Notify<'_>) -> Result<Reached, Error> {
        let before = progression.scan.offset();
        let reached = loop {
            let event = match progression.scan.next_event() {
                // An unusable later file does not undo the ones before. It may still begin.
                Err(_) if !progression.done.is_empty() => {
                    progression.scan = Scan::new().within_limits(self.config.limits.of_recordings());
                    break Reached::Here;
                }
                event => event.map_err(|error| Error::unfit(progression.growing.path(), error.to_string()))?,
            };
            match event {
                Event::Read { offset, length } => {
                    self.stop.check()?;
                    progression.tell_progress(self.sidecar_file.length(), notify);
                    let there = progression.growing.length().saturating_sub(offset);
                    let ahead = there.min(length.max(READ) as u64) as usize;
                    if !self.patiently(notify, |_| progression.growing.read(progression.scan.insert(ahead), offset))? {
                        // Room that its recorder gave back just now holds nothing that was read.
                        let length = progression.growing.length();
                        let look = self.patiently(notify, |_| progression.growing.look())?;
                        if look == Look::Lost || progression.growing.length() == length {
                            break Reached::Loss;
                        }
                        progression.scan.extend(progression.growing.length());
                        continue;
                    }
                    progression.scan.notify_read(ahead);
                }
                Event::Wait => break Reached::Here,
                Event::End => break Reached::End,
                event => {
                    if let Event::Header { profile, .. } = &event
                        && progression.done.is_empty()
                    {
                        progression.profile = (*profile).to_owned();
                    }
                    let ends = matches!(event, Event::ChunkEnd);
                    progression.learner.take(event, notify);
                    // A stretch without chunks, all of it damaged perhaps, has blocks, too.
                    self.write(progression, notify)?;
                    if ends {
                        progression.log_indexes(&mut self.indexes);
                        if self.indexes.is_full() {
                            self.patiently(notify, |shell| shell.indexes.flush())?;
                        }
                        self.save_if_due(progression, notify);
                    }
                }
            }
        };
        self.write(progression, notify)?;
        let offset = progression.scan.offset();
        if offset > before && !self.patiently(notify, |_| progression.growing.passed(offset))? {
            return Ok(Reached::Loss);
        }
        Ok(reached)
    }

    /// Writes the closed blocks. Waits while the disk is full.
    fn write(&mut self, progression: &mut Progression, notify: Notify<'_>) -> Result<(), Error> {
        if !progression.learner.has_blocks() {
            return Ok(());
        }
        if progression.sidecar.is_none() && !self.checkpoint.exists() {
            // A sidecar without a checkpoint is somebody else's.
            self.patiently(notify, |shell| shell.checkpoint.mark(&shell.owner))?;
        }
        // Not before they can be kept: a checkpoint would lose blocks that were taken and are not in the sidecar.
        let blocks: Vec<_> = progression.learner.take_blocks().collect();
        self.append(progression, &blocks)?;
        self.patiently(notify, |shell| shell.sidecar_file.flush())
    }

    /// Encodes blocks, to be written next.
    pub(super) fn append(&mut self, progression: &mut Progression, blocks: &[Block]) -> Result<(), Error> {
        let sidecar = match &mut progression.sidecar {
            Some(sidecar) => sidecar,
            none => {
                let (begun, head) = Sidecar::open(&progression.profile, &batch::settings(self.config));
                self.sidecar_file.put(&head);
                none.insert(begun)
            }
        };
        for block in blocks {
            let bytes = sidecar.block(progression.learner.topics(), block);
            self.sidecar_file.put(&bytes.map_err(|e| Error::input(progression.growing.path(), e.to_string()))?);
        }
        progression.blocks += blocks.len() as u64;
        Ok(())
    }

    fn save_if_due(&mut self, progression: &mut Progression, notify: Notify<'_>) {
        if self.checkpoint.is_due()
            && let Err(error) = self.save(progression, notify)
        {
            notify(Notice::Trouble(&error.to_string()));
        }
    }

    /// Saves the state if it can be resumed: all that was learned is written.
    pub(super) fn save(&mut self, progression: &mut Progression, notify: Notify<'_>) -> Result<(), Error> {
        if progression.learner.has_blocks() || self.sidecar_file.has_pending() || !self.indexes.is_durable() {
            return Ok(());
        }
        progression.log_indexes(&mut self.indexes);
        let Some(position) = progression.scan.position() else { return Ok(()) };
        if !progression.growing.passed(progression.scan.offset())? {
            // It was rewritten, which the next look detects.
            return Ok(());
        }
        let indexes = self.indexes.flush()?;
        let state = StateOf {
            done: &progression.done,
            name: &progression.location.name_of(progression.growing.path()).unwrap_or_default(),
            known: progression.growing.known(),
            position: &position,
            learner: &progression.learner,
            sidecar: &progression.sidecar,
            profile: &progression.profile,
            blocks: progression.blocks,
            length: self.sidecar_file.length(),
            indexes,
        };
        self.checkpoint.save(&self.owner, &state, &self.sidecar_file, &self.indexes, notify)
    }
}
