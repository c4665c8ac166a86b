//! Scan of a recording: bytes in, messages out. A state machine that asks for bytes and never waits for them. The shell
//! reads files and waits for more.
//!
//! Files named after things (`message_indexes`, `search`, `early_summary`, …) hold the parts of its state, files named after
//! actions (`check_indexes`, `resync`, `ask_summary`, …) the steps from one stage to the next.

mod ask_summary;
mod attachments;
mod bounds;
mod check_crc;
mod check_indexes;
mod damage;
mod data_crc;
mod early_summary;
mod emission;
mod event;
mod judge_length;
mod message_indexes;
mod original;
mod pass_known;
mod position;
mod read_attachment;
mod read_data;
mod read_record;
mod read_summary;
mod recognise_original;
mod resume;
mod resync;
mod search;
mod stage;
mod summary_section;
mod supply;
mod swallowed;

use std::collections::VecDeque;
use std::sync::Arc;

use self::data_crc::DataCrc;
use self::early_summary::EarlySummary;
pub use self::event::{Damage, Event};
use self::message_indexes::IndexCheck;
use self::original::Ours;
pub use self::position::Position;
use self::search::Synchronisation;
use self::stage::{Stage, Step};
use self::summary_section::SummarySection;
pub use self::supply::Supply;
use super::chunk::{Inflate, Opened};
use super::frame_window::{Extent, FrameWindow, Stop};
use super::wire::FRAME;
use super::{Error, Inventory, Limits, Message, Places};

/// Reads a recording, finished or still growing, one [`Event`] at a time.
///
/// A record is used only if it is whole and its CRC is right. The messages of a chunk are emitted only if all of the
/// chunk is in order. If the framing is lost, reading resumes at the next whole record; in a growing recording, once it
/// is finished. The events are a function of the recording's bytes alone, not of the pieces in which they arrive.
///
/// Order of calls: [`next_event`](Self::next_event) until it returns [`End`](Event::End). Upon [`Read`](Event::Read),
/// put the bytes into [`insert`](Self::insert), report their number with [`notify_read`](Self::notify_read), and call
/// it again. Upon [`Wait`](Event::Wait), first report with [`extend`](Self::extend) that the recording has grown, or
/// with [`finish`](Self::finish) that it will not. Upon [`Chunk`](Event::Chunk), which only comes if chunks are
/// [offered](Self::offering_chunks), first answer with [`supply`](Self::supply), then take back the memory of the
/// previous chunk with [`spent`](Self::spent). After any event, [`take_indexes`](Self::take_indexes) and
/// [`take_reindexed`](Self::take_reindexed) keep memory flat.
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
    window: FrameWindow,
    inflate: Inflate,
    inventory: Inventory,
    stage: Stage,
    /// Steps to emit before reading on.
    queue: VecDeque<Step>,
    indexes: IndexCheck,
    sync: Synchronisation,
    /// Content of the summary, once it was read early.
    early_summary: Option<EarlySummary>,
    /// Content of the summary section, until its CRC is known.
    summary: SummarySection,
    /// Parts of the file that Stillpoint wrote, if it is an annotated recording, and whether its end was searched for
    /// them.
    ours: Option<Ours>,
    recognised: bool,
    /// Whether chunks are offered, the answer to the last offer with its offset, and a chunk that is no longer needed.
    offering: bool,
    supply: Option<(u64, Supply)>,
    spent: Option<Opened>,
    /// Places that the summary tells, if they are to be used.
    places: Option<Arc<Places>>,
    data_crc: DataCrc,
    limits: Limits,
}

impl Scan {
    /// Scan of a recording that may grow. Its length is 0 until [`Scan::extend`] is called.
    pub fn new() -> Self {
        Self::default()
    }

    /// Scan of a recording that has this length and will not grow.
    pub fn finished(length: u64) -> Self {
        let mut scan = Self::new();
        scan.extend(length);
        scan.finish();
        scan
    }

    /// Sets the current length. No byte beyond it is requested, and no record that reaches beyond it is whole.
    pub fn extend(&mut self, length: u64) {
        if !self.is_still(length) {
            self.window.set_extent(Extent { length, ..self.window.extent() });
        }
    }

    /// Declares that the recording will not grow any more.
    pub fn finish(&mut self) {
        self.finish_ours();
        self.window.set_extent(Extent { finished: true, ..self.window.extent() });
    }

    /// Sets the limits on what is read of the recording.
    pub fn within_limits(self, limits: Limits) -> Self {
        Self { limits, ..self }
    }

    /// Offers chunks by [`Event::Chunk`] before reading them, since they may be opened elsewhere.
    pub fn offering_chunks(self) -> Self {
        Self { offering: true, ..self }
    }

    /// Answers the offer of a chunk. The events are the same wherever the chunk was opened.
    pub fn supply(&mut self, supply: Supply) {
        if let Stage::Offering(frame) = self.stage {
            self.supply = Some((frame.offset, supply));
            self.stage = Stage::Record;
        }
    }

    /// Takes back the opened chunk that was emitted last, to reuse its memory.
    pub fn spent(&mut self) -> Option<Opened> {
        self.spent.take()
    }

    /// Room for `length` bytes of the recording, from the offset in [`Event::Read`] on.
    pub fn insert(&mut self, length: usize) -> &mut [u8] {
        self.window.insert(length)
    }

    /// Reports that `length` bytes were written to the room from [`Scan::insert`]. 0 does not mean the end.
    pub fn notify_read(&mut self, length: usize) {
        let room = self.room(self.window.offset() + self.window.buffered().len() as u64);
        self.window.notify_read(usize::try_from(room).map_or(length, |room| room.min(length)));
    }

    /// Takes the chunk indexes found since the last call, so that they do not pile up. For a [fold](super::Fold), they
    /// must be written in the place of [`Piece::Indexes`](super::Piece::Indexes).
    pub fn take_indexes(&mut self) -> Vec<u8> {
        self.inventory.summary.take_indexes()
    }

    /// Takes the chunks found since the last call whose message indexes are damaged or missing, with new indexes. A
    /// fold needs them in [`Fold::reindex`](super::Fold::reindex).
    pub fn take_reindexed(&mut self) -> Vec<u8> {
        self.inventory.summary.reindexing.take()
    }

    /// Contents found so far; complete after [`Event::End`].
    pub fn inventory(&self) -> &Inventory {
        &self.inventory
    }

    /// Contents found.
    pub fn into_inventory(self) -> Inventory {
        self.inventory
    }

    /// Offset of the first byte of the recording that was not emitted.
    pub fn offset(&self) -> u64 {
        self.window.offset()
    }

    /// Next event.
    ///
    /// # Errors
    /// If the recording is empty or does not begin like an MCAP file.
    pub fn next_event(&mut self) -> Result<Event<'_>, Error> {
        Ok(match self.step()? {
            Step::Stop(Stop::Read { offset, length }) => {
                let length = usize::try_from(self.room(offset)).map_or(length, |room| room.min(length));
                Event::Read { offset: self.place(offset), length }
            }
            Step::Stop(_) => Event::Wait,
            Step::Chunk(frame) => Event::Chunk { offset: frame.offset, length: frame.length },
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
                Stage::Recognising(_) => self.recognise(),
                Stage::Record => self.record(),
                Stage::Offering(frame) => return Ok(Step::Chunk(*frame)),
                Stage::Emission(telling) => {
                    if telling.advance(&self.inflate, &self.window) {
                        return Ok(Step::Message);
                    }
                    let (frame, opened) = (telling.frame, telling.opened.take());
                    self.queue.extend(telling.ends.then_some(Step::ChunkEnd));
                    match opened {
                        Some(opened) => self.pass_opened(frame, opened),
                        None => self.pass(frame),
                    }
                    Ok(())
                }
                Stage::Attaching(attaching) => match attaching.hash(&mut self.window, &mut self.data_crc) {
                    Ok(()) => {
                        self.attached();
                        Ok(())
                    }
                    Err(stop) => Err(stop),
                },
                Stage::Asking(_) => self.answer(),
                Stage::Reindexing(_) => self.reindex(),
                Stage::Searching(_) => self.search(),
                Stage::EndMagic => self.end_magic(),
                Stage::Done => return Ok(Step::End),
            };
            let done = match done {
                Err(Stop::End | Stop::Cut { .. }) => {
                    self.end("the recording ends without a footer: its recorder never finished it")
                }
                done => done,
            };
            match done {
                // The bytes that were judged may be rewritten meanwhile.
                Err(Stop::Wait) => return Ok(Step::Stop(self.window.wait())),
                Err(stop) => return Ok(Step::Stop(stop)),
                Ok(()) => {}
            }
        }
    }

    fn message(&self) -> Option<Message<'_>> {
        let Stage::Emission(telling) = &self.stage else { return None };
        let records = telling.records(&self.inflate, &self.window);
        Message::parse(records.get(telling.at.start + FRAME..telling.at.end)?)
    }
}
