//! A recording on disk or in a store, read through a scan. The caller interprets its messages.

use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use crate::Error;
use crate::record::{Event, Inventory, Limits, Places, Scan};
use crate::run::input::prefetch::{Prefetch, open_chunks};
use crate::run::input::recording::{Recording, Watch, Within};

/// Largest block to read; smaller reads would cost more than their bytes (1 MiB).
const READ: usize = 1 << 20;
/// First block to read behind a chunk (4 KiB).
const LEAST: usize = 4 << 10;
/// Most threads; more hardly read faster.
const THREADS: usize = 8;

impl Recording {
    /// Scans the recording within limits and passes the events on. Several threads open the chunks.
    ///
    /// # Errors
    ///
    /// If it is not MCAP, if the system refuses, or what `watch` or the listener returns.
    pub fn scan(&self, limits: Limits, watch: Watch<'_>, listener: &mut impl Listener) -> Result<Inventory, Error> {
        let (work, jobs) = channel();
        let jobs = Mutex::new(jobs);
        thread::scope(|scope| {
            let cores = thread::available_parallelism().map_or(1, usize::from);
            // Those of an object wait for its bytes most of the time.
            let wanted = if self.source().is_object() { THREADS } else { cores.min(THREADS) };
            let open =
                |_: &usize| thread::Builder::new().spawn_scoped(scope, || open_chunks(&jobs, self, limits)).is_ok();
            if (0..wanted).filter(open).count() == 0 {
                // No thread receives jobs: the scan opens its chunks itself.
                *jobs.lock().unwrap_or_else(PoisonError::into_inner) = channel().1;
            }
            self.scan_with(Prefetch::new(self, limits, work), limits, watch, listener)
        })
    }

    fn scan_with(
        &self,
        mut ahead: Prefetch<'_>,
        limits: Limits,
        watch: Watch<'_>,
        listener: &mut impl Listener,
    ) -> Result<Inventory, Error> {
        let length = self.length();
        let mut scan = Scan::finished(length).within_limits(limits).offering_chunks();
        if listener.verifies() {
            scan = scan.verifying();
        }
        let object = self.source().object();
        if let Some(object) = object {
            match self.places(listener.verifies())? {
                Some(places) => {
                    ahead.know(Arc::clone(&places));
                    scan = scan.knowing(places);
                }
                None => object.read_in_blocks(),
            }
        }
        // Between chunks there is little to read, elsewhere much.
        let mut block = LEAST;
        loop {
            match scan.next_event().map_err(Error::reading(self.path()))? {
                Event::Read { offset, length: wanted } => {
                    watch(offset)?;
                    // What would be another request is left until it is needed.
                    let more = object.map_or(block, |object| block.min(object.at_hand(offset)));
                    let size = (length - offset).min(wanted.max(more) as u64) as usize;
                    self.read_exact_at(scan.insert(size), offset)?;
                    scan.notify_read(size);
                    block = (2 * block).min(READ);
                }
                Event::Chunk { offset, length } => {
                    watch(offset)?;
                    object.iter().for_each(|object| object.forget_before(offset));
                    listener.indexes(&scan.take_indexes(), &scan.take_reindexed())?;
                    scan.spent().into_iter().for_each(|opened| ahead.recycle(opened));
                    let is_useless = |channels: &[u16]| listener.is_useless(channels);
                    let supply = ahead.supply(offset, length, scan.inventory(), is_useless)?;
                    scan.supply(supply);
                    block = LEAST;
                }
                Event::Wait | Event::End => {
                    listener.indexes(&scan.take_indexes(), &scan.take_reindexed())?;
                    return Ok(scan.into_inventory());
                }
                event => listener.event(event)?,
            }
        }
    }
}

impl Recording {
    /// Places of its chunks by the summary, if that is to be used.
    fn places(&self, verifies: bool) -> Result<Option<Arc<Places>>, Error> {
        if verifies {
            return Ok(None);
        }
        let places = Places::of(&mut Within(self), self.length()).map_err(Error::reading(self.path()))?;
        Ok(places.map(Arc::new))
    }
}

/// Receiver of what a scan finds.
pub trait Listener {
    /// Takes an event; never [`Read`](Event::Read), [`Chunk`](Event::Chunk), [`Wait`](Event::Wait) or
    /// [`End`](Event::End).
    ///
    /// # Errors
    ///
    /// Any error, to stop the work.
    fn event(&mut self, event: Event<'_>) -> Result<(), Error>;

    /// Takes chunk indexes, and chunks with damaged message indexes. A fold needs both later.
    ///
    /// # Errors
    ///
    /// Any error, to stop the work.
    fn indexes(&mut self, _chunks: &[u8], _reindexed: &[u8]) -> Result<(), Error> {
        Ok(())
    }

    /// Whether the whole recording is to be checked; then no chunk may be useless.
    fn verifies(&self) -> bool {
        false
    }

    /// Whether chunks with messages on these channels alone may be skipped. Must be deterministic.
    fn is_useless(&self, _channels: &[u16]) -> bool {
        false
    }
}

impl<F: FnMut(Event<'_>) -> Result<(), Error>> Listener for F {
    fn event(&mut self, event: Event<'_>) -> Result<(), Error> {
        self(event)
    }
}
