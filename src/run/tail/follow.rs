//! Reading a recording as it grows and writing its annotations, until nothing more is recorded. Then
//! [`finish`](super::finish) takes over.

use std::time::{Duration, Instant};

use super::shell::Shell;
use super::state::Progression;
use crate::Error;
use crate::pipeline::events::{Ending, News, Tell};
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
    pub(super) fn record(&mut self, course: &mut Progression, tell: Tell<'_>) -> Result<Ending, Error> {
        loop {
            let ending = self.record_file(course, tell)?;
            match self.await_next(course, ending, tell)? {
                Ok(next) => {
                    // No block extends into the next file.
                    course.learner.end_split();
                    self.write(course, tell)?;
                    course.log_indexes(&mut self.indexes);
                    let indexes = self.patiently(tell, |shell| shell.indexes.flush())?.length;
                    course.turn_to(next, indexes, tell)?;
                }
                Err(ending) => return Ok(ending),
            }
        }
    }

    /// Follows a file to its end.
    fn record_file(&mut self, course: &mut Progression, tell: Tell<'_>) -> Result<Ending, Error> {
        let mut last = Instant::now();
        let mut useless = Some(last + USELESS);
        let mut unnamed = None;
        loop {
            course.scan.extend(course.growing.length());
            match self.read(course, tell)? {
                Reached::Here => {}
                Reached::End => return Ok(Ending::Finished),
                Reached::Loss => return Ok(Ending::Truncated),
            }
            self.save_if_due(course, tell);
            loop {
                course.tell_progress(self.appending.length(), tell);
                if useless.take_if(|due| *due <= Instant::now()).is_some() {
                    course.tell_useless(tell);
                }
                self.pause(self.following.poll)?;
                match self.patiently(tell, |_| course.growing.look())? {
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
                    _ if idle >= CLOSED && course.growing.is_closed() => Ending::Finished,
                    _ if idle >= LEFT && course.trail.next(&course.files())?.is_some() => Ending::Idle,
                    _ => {
                        self.save_if_due(course, tell);
                        continue;
                    }
                };
                course.scan.finish();
                return match self.read(course, tell)? {
                    Reached::Loss => Ok(Ending::Truncated),
                    Reached::Here | Reached::End => Ok(ending),
                };
            }
        }
    }

    /// The next file of the recording, or why there is none.
    fn await_next(
        &mut self,
        course: &Progression,
        ending: Ending,
        tell: Tell<'_>,
    ) -> Result<Result<GrowingFile, Ending>, Error> {
        if ending == Ending::Truncated {
            return Ok(Err(ending));
        }
        let files = course.files();
        let began = Instant::now();
        loop {
            // First, so that a file that begins meanwhile is not overlooked.
            let listed = course.trail.ends_with(&files);
            if let Some(next) = course.trail.next(&files)? {
                return Ok(Ok(next));
            }
            let (quiet, alone) = (began.elapsed(), course.trail.name_of(course.growing.path()).is_none());
            if alone || ending != Ending::Finished || listed && quiet >= CLOSED.min(self.following.idle) {
                return Ok(Err(ending));
            }
            if quiet >= self.following.idle {
                return Ok(Err(Ending::Idle));
            }
            if quiet >= LEFT && !course.trail.path().exists() {
                return Ok(Err(Ending::Deleted));
            }
            course.tell_progress(self.appending.length(), tell);
            self.pause(self.following.poll)?;
        }
    }

    /// Reads the available bytes and writes the annotations.
    fn read(&mut self, course: &mut Progression, tell: Tell<'_>) -> Result<Reached, Error> {
        let before = course.scan.offset();
        let reached = loop {
            let event = match course.scan.next_event() {
                // An unusable later file does not undo the ones before. It may still begin.
                Err(_) if !course.done.is_empty() => {
                    course.scan = Scan::new().within_limits(self.config.limits.of_recordings());
                    break Reached::Here;
                }
                event => event.map_err(|error| Error::unfit(course.growing.path(), error.to_string()))?,
            };
            match event {
                Event::Read { offset, length } => {
                    self.stop.check()?;
                    course.tell_progress(self.appending.length(), tell);
                    let there = course.growing.length().saturating_sub(offset);
                    let ahead = there.min(length.max(READ) as u64) as usize;
                    if !self.patiently(tell, |_| course.growing.read(course.scan.insert(ahead), offset))? {
                        break Reached::Loss;
                    }
                    course.scan.notify_read(ahead);
                }
                Event::Wait => break Reached::Here,
                Event::End => break Reached::End,
                event => {
                    if let Event::Header { profile, .. } = &event
                        && course.done.is_empty()
                    {
                        course.profile = (*profile).to_owned();
                    }
                    let ends = matches!(event, Event::ChunkEnd);
                    course.learner.take(event, tell);
                    if ends {
                        self.write(course, tell)?;
                        course.log_indexes(&mut self.indexes);
                        if self.indexes.is_full() {
                            self.patiently(tell, |shell| shell.indexes.flush())?;
                        }
                        self.save_if_due(course, tell);
                    }
                }
            }
        };
        self.write(course, tell)?;
        let offset = course.scan.offset();
        if offset > before && !self.patiently(tell, |_| course.growing.passed(offset))? {
            return Ok(Reached::Loss);
        }
        Ok(reached)
    }

    /// Writes the closed blocks. Waits while the disk is full.
    fn write(&mut self, course: &mut Progression, tell: Tell<'_>) -> Result<(), Error> {
        if !course.learner.has_blocks() {
            return Ok(());
        }
        if course.sidecar.is_none() && !self.checkpoint.exists() {
            // A sidecar without a checkpoint is somebody else's.
            self.patiently(tell, |shell| shell.checkpoint.mark(&shell.owner))?;
        }
        // Not before they can be kept: a checkpoint would lose blocks that were taken and are not in the sidecar.
        let blocks: Vec<_> = course.learner.take_blocks().collect();
        self.append(course, &blocks)?;
        self.patiently(tell, |shell| shell.appending.flush())
    }

    /// Encodes blocks, to be written next.
    pub(super) fn append(&mut self, course: &mut Progression, blocks: &[Block]) -> Result<(), Error> {
        let sidecar = match &mut course.sidecar {
            Some(sidecar) => sidecar,
            none => {
                let (begun, head) = Sidecar::open(&course.profile, &batch::settings(self.config));
                self.appending.put(&head);
                none.insert(begun)
            }
        };
        for block in blocks {
            let bytes = sidecar.block(course.learner.topics(), block);
            self.appending.put(&bytes.map_err(|e| Error::input(course.growing.path(), e.to_string()))?);
        }
        course.blocks += blocks.len() as u64;
        Ok(())
    }

    fn save_if_due(&mut self, course: &mut Progression, tell: Tell<'_>) {
        if self.checkpoint.is_due()
            && let Err(error) = self.save(course)
        {
            tell(News::Trouble(&error.to_string()));
        }
    }

    /// Saves the state if it can be resumed: all that was learned is written.
    pub(super) fn save(&mut self, course: &mut Progression) -> Result<(), Error> {
        if course.learner.has_blocks() || self.appending.has_pending() || !self.indexes.is_durable() {
            return Ok(());
        }
        course.log_indexes(&mut self.indexes);
        let Some(position) = course.scan.position() else { return Ok(()) };
        if !course.growing.passed(course.scan.offset())? {
            // It was rewritten, which the next look detects.
            return Ok(());
        }
        let indexes = self.indexes.flush()?;
        let state = StateOf {
            done: &course.done,
            name: &course.trail.name_of(course.growing.path()).unwrap_or_default(),
            known: course.growing.known(),
            position: &position,
            learner: &course.learner,
            sidecar: &course.sidecar,
            profile: &course.profile,
            blocks: course.blocks,
            length: self.appending.length(),
            indexes,
        };
        self.checkpoint.save(&self.owner, &state, &self.appending, &self.indexes)
    }
}
