//! A recording's bytes in, its messages out: a state machine that asks for bytes and never waits for them.
//! What the messages mean is left to [`imu`](crate::imu), reading files and waiting for more to the shell.

mod data_section;
mod summary_section;

use std::collections::VecDeque;
use std::fmt;
use std::ops::Range;

use mcap::MAGIC;

use self::data_section::{Attaching, Telling};
use self::summary_section::SummarySection;
use super::chunk::Inflate;
use super::horizon::{Extent, Frame, Horizon, Stop};
use super::records::ChunkIndex;
use super::wire::{FRAME, op};
use super::{Channel, Error, Inventory, Message, Schema};

/// Reads a recording, finished or still growing, one [`Event`] at a time.
///
/// A record counts only if it is whole and its CRC holds; the messages of a chunk come out only if all of the chunk is
/// in order. The events are a function of the recording's bytes alone, not of the pieces in which they arrive.
///
/// ```
/// # fn read(file: &[u8]) -> Result<u64, stillpoint::record::Error> {
/// use stillpoint::record::{Event, Scan};
///
/// let mut scan = Scan::finished(file.len() as u64);
/// let mut messages = 0;
/// loop {
///     match scan.next_event()? {
///         // The file at `offset`; reading more than asked for is faster.
///         Event::Read { offset, length } => {
///             let length = length.max(1 << 20).min(file.len() - offset as usize);
///             scan.insert(length).copy_from_slice(&file[offset as usize..][..length]);
///             scan.notify_read(length);
///         }
///         Event::Message(_) => messages += 1,
///         Event::End => return Ok(messages),
///         _ => {}
///     }
/// }
/// # }
/// ```
#[derive(Default)]
pub struct Scan {
    horizon: Horizon,
    inflate: Inflate,
    inventory: Inventory,
    stage: Stage,
    /// To be told before going on.
    queue: VecDeque<Step>,
    /// The chunk whose message indexes are being collected.
    chunk: Option<ChunkIndex>,
    /// What the summary section says, until its CRC is known.
    summary: SummarySection,
}

/// What a [`Scan`] has to tell.
#[derive(Debug)]
pub enum Event<'a> {
    /// At least `length` bytes are needed from byte `offset` of the recording on: [`Scan::insert`] them.
    Read {
        /// Where they stand.
        offset: u64,
        /// How many are needed at least.
        length: usize,
    },
    /// Everything whole has been told. Go on after [`Scan::extend`] or [`Scan::finish`].
    Wait,
    /// The header of the recording.
    Header {
        /// Conventions that it follows, `ros2` for instance.
        profile: &'a str,
        /// The program that wrote it.
        library: &'a str,
    },
    /// A schema, the first time.
    Schema(&'a Schema),
    /// A channel, the first time; before its messages, except for those that only the summary knows.
    Channel(&'a Channel),
    /// A message.
    Message(Message<'a>),
    /// The chunk of the messages just told has ended. A message outside a chunk counts as one.
    ChunkEnd,
    /// Something is not as it should be. What is whole is told all the same.
    Damage(Damage),
    /// Nothing follows.
    End,
}

/// Something that is wrong with a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Byte in the recording.
    pub offset: u64,
    /// What was found there, in words.
    pub what: String,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at byte {}: {}", self.offset, self.what)
    }
}

/// An event without its data, which stays where it is.
enum Step {
    Stop(Stop),
    Header,
    Schema(u16),
    Channel(u16),
    Message,
    ChunkEnd,
    Damage(Damage),
    End,
}

/// What comes next.
#[derive(Default)]
enum Stage {
    #[default]
    Magic,
    Record,
    Telling(Telling),
    Attaching(Attaching),
    EndMagic,
    Done,
}

impl Scan {
    /// A scan of a recording that may grow. Its length is 0 until [`Scan::extend`] says otherwise.
    pub fn new() -> Self {
        Self::default()
    }

    /// A scan of a recording that has this length and will not grow.
    pub fn finished(length: u64) -> Self {
        let mut scan = Self::new();
        scan.extend(length);
        scan.finish();
        scan
    }

    /// The recording is this long now. No byte beyond is asked for, and no record that reaches beyond is whole.
    pub fn extend(&mut self, length: u64) {
        self.horizon.set_extent(Extent { length, ..self.horizon.extent() });
    }

    /// The recording will not grow any more.
    pub fn finish(&mut self) {
        self.horizon.set_extent(Extent { finished: true, ..self.horizon.extent() });
    }

    /// Room for `length` bytes of the recording, from the offset on that [`Event::Read`] gave.
    pub fn insert(&mut self, length: usize) -> &mut [u8] {
        self.horizon.insert(length)
    }

    /// So many bytes have been written to what [`Scan::insert`] gave. None is no news: it does not mean the end.
    pub fn notify_read(&mut self, length: usize) {
        self.horizon.notify_read(length);
    }

    /// Hands over the chunk indexes found since the last time, so that they do not pile up; a [fold](super::Fold) wants
    /// them back in the place of [`Piece::Indexes`](super::Piece::Indexes).
    pub fn take_indexes(&mut self) -> Vec<u8> {
        self.inventory.summary.take_indexes()
    }

    /// What was found so far; complete after [`Event::End`].
    pub fn inventory(&self) -> &Inventory {
        &self.inventory
    }

    /// What was found.
    pub fn into_inventory(self) -> Inventory {
        self.inventory
    }

    /// The first byte of the recording that has not been told.
    pub fn offset(&self) -> u64 {
        self.horizon.offset()
    }

    /// What is next.
    ///
    /// # Errors
    /// If the recording is empty or does not begin like an MCAP file.
    pub fn next_event(&mut self) -> Result<Event<'_>, Error> {
        Ok(match self.step()? {
            Step::Stop(Stop::Read { offset, length }) => Event::Read { offset, length },
            Step::Stop(_) => Event::Wait,
            Step::Header => Event::Header { profile: self.inventory.profile(), library: self.inventory.library() },
            Step::Schema(id) => self.inventory.schemas().get(&id).map_or(Event::End, Event::Schema),
            Step::Channel(id) => self.inventory.channels().get(&id).map_or(Event::End, Event::Channel),
            Step::Message => self.message().map_or(Event::End, Event::Message),
            Step::ChunkEnd => Event::ChunkEnd,
            Step::Damage(damage) => Event::Damage(damage),
            Step::End => Event::End,
        })
    }

    fn step(&mut self) -> Result<Step, Error> {
        loop {
            if let Some(step) = self.queue.pop_front() {
                return Ok(step);
            }
            let done = match &mut self.stage {
                Stage::Magic => self.magic()?,
                Stage::Record => self.record(),
                Stage::Telling(telling) => {
                    let records = self.inflate.records(telling.place, within(&self.horizon, &telling.data));
                    if telling.advance(records) {
                        return Ok(Step::Message);
                    }
                    let frame = telling.frame;
                    self.queue.extend(telling.ends.then_some(Step::ChunkEnd));
                    self.pass(frame);
                    Ok(())
                }
                Stage::Attaching(attaching) => match attaching.hash(&mut self.horizon) {
                    Ok(()) => {
                        self.attached();
                        Ok(())
                    }
                    Err(stop) => Err(stop),
                },
                Stage::EndMagic => self.end_magic(),
                Stage::Done => return Ok(Step::End),
            };
            match done {
                Ok(()) => {}
                Err(stop @ (Stop::Read { .. } | Stop::Wait)) => return Ok(Step::Stop(stop)),
                Err(Stop::End) => self.lost("the recording ends without a footer: its recorder never finished it"),
                Err(Stop::Cut { claimed: u64::MAX }) => self.lost("the recording ends in a chunk that was never closed"),
                Err(Stop::Cut { claimed }) => self.lost(format!(
                    "a record of {claimed} bytes runs past the end of the recording: it was cut off, or the length is corrupt"
                )),
            }
        }
    }

    fn message(&self) -> Option<Message<'_>> {
        let Stage::Telling(telling) = &self.stage else { return None };
        let records = self.inflate.records(telling.place, within(&self.horizon, &telling.data));
        Message::parse(records.get(telling.at.start + FRAME..telling.at.end)?)
    }

    fn magic(&mut self) -> Result<Result<(), Stop>, Error> {
        match self.horizon.peek(MAGIC.len()) {
            Ok(found) if found == MAGIC => {
                self.horizon.skip(MAGIC.len() as u64);
                self.inventory.prefix = MAGIC.len() as u64;
                self.stage = Stage::Record;
                Ok(Ok(()))
            }
            Ok(found) => Err(Error::NotMcap { found: found.to_vec() }),
            Err(Stop::End) => Err(Error::Empty),
            Err(Stop::Cut { .. }) => Err(Error::NotMcap { found: self.horizon.buffered().to_vec() }),
            Err(stop) => Ok(Err(stop)),
        }
    }

    fn record(&mut self) -> Result<(), Stop> {
        let frame = self.horizon.frame()?;
        if frame.opcode != op::MESSAGE_INDEX {
            self.close_chunk();
        }
        if frame.opcode == 0 {
            self.lost("no record begins here: the framing is lost");
            Ok(())
        } else if self.summary.begun {
            self.summary_record(frame)
        } else {
            self.data_record(frame)
        }
    }

    /// Goes on behind a record; all that is whole in front of DataEnd is prefix.
    fn pass(&mut self, frame: Frame) {
        self.horizon.skip(frame.end() - self.horizon.offset());
        if !self.summary.begun {
            self.inventory.prefix = frame.end();
        }
        self.stage = Stage::Record;
    }

    fn damage(&mut self, offset: u64, what: impl Into<String>) {
        self.inventory.damage += 1;
        self.queue.push_back(Step::Damage(Damage { offset, what: what.into() }));
    }

    /// Nothing can be read from here on.
    fn lost(&mut self, what: impl Into<String>) {
        self.close_chunk();
        self.accept_summary();
        self.damage(self.horizon.offset(), what);
        self.queue.push_back(Step::End);
        self.stage = Stage::Done;
    }
}

/// The part of what `horizon` has buffered.
fn within<'a>(horizon: &'a Horizon, range: &Range<usize>) -> &'a [u8] {
    horizon.buffered().get(range.clone()).unwrap_or_default()
}
