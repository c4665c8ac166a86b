//! Chunks opened ahead of the scan, by several threads, in the order of the file. What is made of them is left to the
//! [`Scan`](crate::record::Scan), which says the same whoever opens its chunks.

use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

use crate::Error;
use crate::record::{Chunk, Chunks, Inventory, Limits, Opened, Opener, Supply};
use crate::run::input::recording::{Recording, Within};

/// Small chunks are handed to a thread by so many bytes (256 KiB).
const BATCH: u64 = 256 << 10;
/// Most bytes, compressed and not, that are being opened or wait for the scan (8 MiB: more would only leave the caches), unless one chunk has more.
const ROOM: u64 = 8 << 20;
/// Most chunks that are known of ahead.
const CHUNKS: usize = 512;
/// Longest head of a chunk that is opened ahead.
const HEAD: u64 = 1 << 16;

/// What is opened ahead.
pub(crate) struct Prefetch<'a> {
    recording: &'a Recording,
    limits: Limits,
    work: Sender<Job>,
    chunks: Chunks,
    queue: VecDeque<Coming>,
    /// Bytes that the queue stands for.
    held: u64,
    spare: Vec<Opened>,
}

/// A chunk that the scan will come to.
struct Coming {
    chunk: Chunk,
    /// Where it comes from, in its turn, unless it is not to be read.
    done: Option<Rc<Receiver<Opened>>>,
    /// Memory that it takes.
    cost: u64,
}

/// Chunks for a thread to open.
pub(crate) struct Job {
    chunks: Vec<(Chunk, Opened)>,
    done: Sender<Opened>,
}

/// Opens chunks until there is nobody who might want more.
pub(crate) fn open_chunks(jobs: &Mutex<Receiver<Job>>, recording: &Recording, limits: Limits) {
    let mut opener = Opener::new(limits);
    loop {
        let job = jobs.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Job { chunks, done }) = job else { return };
        for (chunk, mut opened) in chunks {
            let room = opened.room(usize::try_from(chunk.length).unwrap_or_default());
            // The scan will find out itself what cannot be read.
            if recording.read_exact_at(room, chunk.body().start).is_err() {
                opened.room(0);
            }
            opener.open(&mut opened);
            if done.send(opened).is_err() {
                break;
            }
        }
    }
}

impl<'a> Prefetch<'a> {
    /// Nothing yet; what is to be opened goes to `work`.
    pub(crate) fn new(recording: &'a Recording, limits: Limits, work: Sender<Job>) -> Self {
        let chunks = Chunks::new(0, recording.length());
        Self { recording, limits, work, chunks, queue: VecDeque::new(), held: 0, spare: Vec::new() }
    }

    /// What becomes of the chunk at `offset`, where the recording was scanned so far. Whether chunks with messages on
    /// certain channels need not be read is for `is_useless` to say, now for this one, and as a guess for those that
    /// follow.
    pub(crate) fn supply(
        &mut self,
        offset: u64,
        length: u64,
        scanned: &Inventory,
        is_useless: impl Fn(&[u16]) -> bool,
    ) -> Result<Supply, Error> {
        let may_pass = self.chunks.define_nothing_beyond(scanned, &mut Within(self.recording));
        let may_pass = may_pass.map_err(Error::reading(self.recording.path()))?;
        let is_useless = |channels: &[u16]| may_pass && is_useless(channels);
        // The scan may pass over chunks that were found, and find others behind what is damaged.
        while self.queue.front().is_some_and(|coming| coming.chunk.offset < offset) {
            self.next();
        }
        if self.queue.is_empty() {
            self.chunks.seek(offset);
        }
        if self.held < ROOM / 2 && self.queue.len() < CHUNKS / 2 {
            self.fill(scanned.opened(), &is_useless)?;
        }
        let is_front = |coming: &Coming| (coming.chunk.offset, coming.chunk.length) == (offset, length);
        if !self.queue.front().is_some_and(is_front) {
            return Ok(Supply::Absent);
        }
        let Some((chunk, opened)) = self.next() else { return Ok(Supply::Absent) };
        let channels = chunk.channels.unwrap_or_default();
        Ok(match opened {
            spared if !channels.is_empty() && is_useless(&channels) => {
                spared.into_iter().for_each(|opened| self.recycle(opened));
                Supply::Unread
            }
            Some(opened) => Supply::Opened(opened),
            None => Supply::Absent,
        })
    }

    /// Takes memory back.
    pub(crate) fn recycle(&mut self, opened: Opened) {
        if opened.size() as u64 <= ROOM / 2 {
            self.spare.push(opened);
        }
    }

    fn next(&mut self) -> Option<(Chunk, Option<Opened>)> {
        let Coming { chunk, done, cost } = self.queue.pop_front()?;
        self.held -= cost;
        let opened = done.and_then(|done| done.recv().ok());
        Some((chunk, opened))
    }

    fn fill(&mut self, opened: u64, is_useless: &impl Fn(&[u16]) -> bool) -> Result<(), Error> {
        let refused = |e: crate::record::Error| Error::reading(self.recording.path())(e);
        let (mut batch, mut size) = (Vec::new(), 0);
        let (mut sender, mut receiver) = shared();
        while self.held < ROOM && self.queue.len() < CHUNKS {
            let Some(chunk) = self.chunks.next(&mut Within(self.recording)).map_err(refused)? else { break };
            let useless = chunk.channels.as_ref().is_some_and(|channels| !channels.is_empty() && is_useless(channels));
            let Limits { chunk: longest, .. } = self.limits;
            // What the scan will refuse is not opened at all.
            let too_long = chunk.length > longest.saturating_add(HEAD) || chunk.inflated > longest;
            if useless || too_long || self.limits.exceeds_ratio(opened + self.held + chunk.inflated, chunk.offset) {
                self.queue.push_back(Coming { chunk, done: None, cost: 0 });
                continue;
            }
            let cost = chunk.length + chunk.inflated;
            (self.held, size) = (self.held + cost, size + cost);
            batch.push((chunk.clone(), self.spare.pop().unwrap_or_default()));
            self.queue.push_back(Coming { chunk, done: Some(Rc::clone(&receiver)), cost });
            if size >= BATCH {
                self.hand_over(&mut batch, sender);
                (sender, receiver) = shared();
                size = 0;
            }
        }
        self.hand_over(&mut batch, sender);
        Ok(())
    }

    fn hand_over(&self, batch: &mut Vec<(Chunk, Opened)>, done: Sender<Opened>) {
        if !batch.is_empty() {
            // Without threads nothing comes back, and the scan reads all by itself.
            let _ = self.work.send(Job { chunks: std::mem::take(batch), done });
        }
    }
}

fn shared() -> (Sender<Opened>, Rc<Receiver<Opened>>) {
    let (sender, receiver) = channel();
    (sender, Rc::new(receiver))
}
