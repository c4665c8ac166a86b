//! Chunks opened ahead of the scan by several threads, in file order. The [`Scan`](crate::record::Scan) gives the same
//! events whoever opens its chunks.
//!
//! Of an object with a whole summary, [`Spans`] says which bytes are requested together.

use std::collections::VecDeque;
use std::ops::Range;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SendError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use crate::Error;
use crate::record::{Chunk, Chunks, Inventory, Limits, Opened, Opener, Places, Supply};
use crate::run::input::recording::{Recording, Within};
use crate::run::input::spans::{Need, Spans};

/// Least bytes of small chunks that a thread gets at once (256 KiB).
const BATCH: u64 = 256 << 10;
/// Most bytes, compressed and decompressed, that are being opened or wait for the scan (8 MiB: more would only leave
/// the caches), unless one chunk alone has more.
const ROOM: u64 = 8 << 20;
/// The same of an object, whose bytes take longer to come (64 MiB).
const ROOM_FOR_REQUESTS: u64 = 64 << 20;
/// Most chunks that are queued.
const CHUNKS: usize = 512;
/// Longest head of a chunk that is opened ahead.
const HEAD: u64 = 1 << 16;

/// Chunks opened ahead, in the order in which the scan reaches them.
pub(crate) struct Prefetch<'a> {
    recording: &'a Recording,
    limits: Limits,
    work: Sender<Job>,
    chunks: Chunks,
    /// Spans that are requested together, if it is an object with a summary.
    spans: Option<Spans>,
    /// A chunk that it was too early to judge.
    postponed: Option<Chunk>,
    room: u64,
    /// Set at the end, so that threads do not request what was queued.
    over: Arc<AtomicBool>,
    queue: VecDeque<Coming>,
    /// Bytes that the queue takes, compressed and decompressed.
    held: u64,
    spare: Vec<Opened>,
}

/// A chunk that the scan has yet to reach.
struct Coming {
    chunk: Chunk,
    /// Channel that its opened bytes come from, in order; `None` if it is not opened ahead.
    done: Option<Rc<Receiver<Opened>>>,
    /// Memory that it takes, in bytes.
    cost: u64,
}

/// Chunks for a thread to open.
pub(crate) struct Job {
    chunks: Vec<(Chunk, Opened)>,
    /// Range to request first, if the recording is an object.
    span: Option<Range<u64>>,
    done: Sender<Opened>,
    /// Whether nothing is needed any more.
    over: Arc<AtomicBool>,
}

/// Opens chunks until no more can be requested.
pub(crate) fn open_chunks(jobs: &Mutex<Receiver<Job>>, recording: &Recording, limits: Limits) {
    let mut opener = Opener::new(limits);
    loop {
        let job = jobs.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Job { chunks, span, done, over }) = job else { return };
        if over.load(Ordering::Relaxed) {
            return;
        }
        if let (Some(object), Some(span)) = (recording.source().object(), span) {
            object.fetch(&span);
        }
        for (chunk, mut opened) in chunks {
            let room = opened.room(usize::try_from(chunk.length).unwrap_or_default());
            // The scan itself finds out which bytes cannot be read.
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
    /// An empty queue that sends its jobs to `work`.
    pub(crate) fn new(recording: &'a Recording, limits: Limits, work: Sender<Job>) -> Self {
        let room = if recording.source().is_object() { ROOM_FOR_REQUESTS } else { ROOM };
        let chunks = Chunks::new(0, recording.length());
        let (over, queue, spare) = (Arc::default(), VecDeque::new(), Vec::new());
        Self { recording, limits, work, chunks, spans: None, postponed: None, room, over, queue, held: 0, spare }
    }

    /// Goes by what the summary of an object says. Requests what lies in front of the first chunk.
    pub(crate) fn know(&mut self, places: Arc<Places>) {
        let start = 0..places.start_with_little();
        if let Some(object) = self.recording.source().object() {
            object.announce(&start);
            object.fetch(&start);
        }
        // The first chunk may have come with it: a span that began there would not be requested as one.
        (self.chunks, self.spans) = (Chunks::known(Arc::clone(&places)), Some(Spans::new(places, start.end)));
    }

    /// Supplies the chunk at `offset`, up to which the recording was scanned. `is_useless` tells whether chunks with
    /// messages on certain channels may be skipped; its answer counts for this chunk, and is a guess for those that
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
        // The scan may skip chunks that were found here, and find others behind damage.
        while self.queue.front().is_some_and(|coming| coming.chunk.offset < offset) {
            self.next();
        }
        if self.queue.is_empty() && self.postponed.as_ref().is_none_or(|chunk| chunk.offset != offset) {
            (self.postponed, _) = (None, self.chunks.seek(offset));
        }
        if self.held < self.room / 2 && self.queue.len() < CHUNKS / 2 {
            self.fill(scanned, &is_useless)?;
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

    /// Takes back memory to reuse.
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

    fn fill(&mut self, scanned: &Inventory, is_useless: &impl Fn(&[u16]) -> bool) -> Result<(), Error> {
        let refused = |e: crate::record::Error| Error::reading(self.recording.path())(e);
        let opened = scanned.opened();
        let (mut batch, mut size) = (Vec::new(), 0);
        let (mut sender, mut receiver) = shared();
        while self.held < self.room && self.queue.len() < CHUNKS {
            let next = match self.postponed.take() {
                Some(chunk) => Some(chunk),
                None => self.chunks.next(&mut Within(self.recording)).map_err(refused)?,
            };
            let Some(chunk) = next else { break };
            let useless = match &mut self.spans {
                Some(spans) => match spans.need(&chunk, scanned, is_useless) {
                    Need::Unknown if !self.queue.is_empty() => {
                        self.postponed = Some(chunk);
                        break;
                    }
                    need => need == Need::None,
                },
                None => chunk.channels.as_ref().is_some_and(|channels| !channels.is_empty() && is_useless(channels)),
            };
            let Limits { chunk: longest, .. } = self.limits;
            // A chunk that the scan will refuse is not opened.
            let too_long = chunk.length > longest.saturating_add(HEAD) || chunk.inflated > longest;
            if useless || too_long || self.limits.exceeds_ratio(opened + self.held + chunk.inflated, chunk.offset) {
                self.queue.push_back(Coming { chunk, done: None, cost: 0 });
                continue;
            }
            if self.spans.as_mut().is_some_and(|spans| !spans.add(chunk.offset)) {
                self.hand_over(&mut batch, sender);
                (sender, receiver) = shared();
                size = 0;
                // It begins the next span, in which everything fits.
                self.spans.iter_mut().for_each(|spans| _ = spans.add(chunk.offset));
            }
            let cost = chunk.length + chunk.inflated;
            (self.held, size) = (self.held + cost, size + cost);
            batch.push((chunk.clone(), self.spare.pop().unwrap_or_default()));
            self.queue.push_back(Coming { chunk, done: Some(Rc::clone(&receiver)), cost });
            if size >= BATCH && self.spans.is_none() {
                self.hand_over(&mut batch, sender);
                (sender, receiver) = shared();
                size = 0;
            }
        }
        self.hand_over(&mut batch, sender);
        Ok(())
    }

    fn hand_over(&mut self, batch: &mut Vec<(Chunk, Opened)>, done: Sender<Opened>) {
        if batch.is_empty() {
            return;
        }
        let span = self.spans.as_mut().and_then(Spans::take);
        if let (Some(object), Some(span)) = (self.recording.source().object(), &span) {
            object.announce(span);
        }
        // Without threads nothing comes back, and the scan opens every chunk itself.
        let job = Job { chunks: std::mem::take(batch), span, done, over: Arc::clone(&self.over) };
        if let Err(SendError(Job { span: Some(span), .. })) = self.work.send(job) {
            self.recording.source().object().iter().for_each(|object| object.fetch(&span));
        }
    }
}

impl Drop for Prefetch<'_> {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

fn shared() -> (Sender<Opened>, Rc<Receiver<Opened>>) {
    let (sender, receiver) = channel();
    (sender, Rc::new(receiver))
}
