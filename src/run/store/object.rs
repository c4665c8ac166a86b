//! An object that is read by ranges. The last 256 KiB come with the first request, and stay: of most recordings they hold
//! the whole summary.

use std::io;
use std::ops::Range;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use object_store::{Error as Refusal, GetOptions, GetRange, GetResult, ObjectMeta, ObjectStoreExt as _};

use super::cache::{Cache, Held};
use super::client::{ObjectPlace, retry, wait};
use super::listing::identity;
use super::refusal::refused;
use crate::Error;

/// Length of the end that is read first (256 KiB).
const END: u64 = 256 << 10;
/// Least length of a request that nobody announced (64 KiB).
const LEAST: u64 = 64 << 10;
/// Length of the blocks that a recording is read in from its beginning to its end (4 MiB).
const BLOCK: u64 = 4 << 20;

/// An object in a store. It is read as it was when it was opened, or not at all.
#[derive(Debug)]
pub(crate) struct Object {
    location: ObjectPlace,
    meta: ObjectMeta,
    end: Bytes,
    cache: Cache,
    /// Length of blocks that are read whole, 0 without.
    block: AtomicU64,
    /// Held while a part is requested that nobody announced, so that nobody else requests the same.
    requesting: Mutex<()>,
}

impl Object {
    /// Opens an object: one request, or two where a store does not know requests for the end of an object.
    ///
    /// # Errors
    ///
    /// If it is missing or the store refuses.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let location = ObjectPlace::of(path)?;
        let (meta, end) = wait(path, async {
            let opened = match get(&location, Some(GetRange::Suffix(END)), None).await {
                // Azure, and an object without any byte.
                Err(refusal) if is_no_suffix(&refusal) => {
                    let meta = location.store.head(&location.key).await;
                    let meta = meta.map_err(|refusal| refused(path, "read", refusal))?;
                    let range = meta.size.saturating_sub(END)..meta.size;
                    match range.is_empty() {
                        true => Ok((meta, Bytes::new())),
                        false => get(&location, Some(GetRange::Bounded(range)), None).await,
                    }
                }
                opened => opened,
            };
            opened.map_err(|refusal| refused(path, "read", refusal))
        })?;
        let (block, requesting) = (AtomicU64::new(0), Mutex::new(()));
        Ok(Self { location, meta, end, cache: Cache::default(), block, requesting })
    }

    /// Length in bytes.
    pub(crate) fn length(&self) -> u64 {
        self.meta.size
    }

    /// Length and version, which tell it from another object of the same name.
    pub(crate) fn identity(&self) -> String {
        identity(&self.meta)
    }

    /// Requests whole blocks from now on, since all of it will be read.
    pub(crate) fn read_in_blocks(&self) {
        self.block.store(BLOCK, Ordering::Relaxed);
    }

    /// Notes that [`fetch`](Self::fetch) is about to request a range; who needs its bytes waits for it.
    pub(crate) fn announce(&self, range: &Range<u64>) {
        self.cache.announce(&self.without_end(range));
    }

    /// Requests a range that was announced.
    pub(crate) fn fetch(&self, range: &Range<u64>) {
        let range = self.without_end(range);
        if !self.cache.awaits(&range) {
            return;
        }
        // The reader finds out which bytes cannot be had.
        self.cache.fulfil(&range, self.request(&range).ok());
    }

    /// Number of bytes from an offset on that cost no request.
    pub(crate) fn at_hand(&self, offset: u64) -> usize {
        let end = self.end_start();
        if offset >= end {
            return self.length().saturating_sub(offset) as usize;
        }
        match self.cache.find(offset) {
            Held::Here(bytes) => bytes.len(),
            Held::Nowhere(_) => 0,
        }
    }

    /// Drops what lies before an offset.
    pub(crate) fn forget_before(&self, offset: u64) {
        self.cache.forget_before(offset);
    }

    /// Fills `buffer` with the bytes from `offset` on.
    ///
    /// # Errors
    ///
    /// If the store refuses, or they are not there.
    pub(crate) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        let until = offset.checked_add(buffer.len() as u64).filter(|&until| until <= self.length());
        until.ok_or(io::ErrorKind::UnexpectedEof)?;
        let (mut rest, mut offset) = (buffer, offset);
        while !rest.is_empty() {
            let bytes = self.find(offset, rest.len() as u64).map_err(io::Error::other)?;
            let length = bytes.len().min(rest.len());
            let (now, later) = rest.split_at_mut(length);
            now.copy_from_slice(bytes.get(..length).unwrap_or_default());
            (rest, offset) = (later, offset + length as u64);
        }
        Ok(())
    }

    /// Bytes from an offset on; at least one, and `wanted` if they must be requested.
    fn find(&self, offset: u64, wanted: u64) -> Result<Bytes, Error> {
        if let Some(at) = offset.checked_sub(self.end_start()) {
            return Ok(self.end.slice(at as usize..));
        }
        if let Held::Here(bytes) = self.cache.find(offset) {
            return Ok(bytes);
        }
        let _alone = self.requesting.lock();
        let next = match self.cache.find(offset) {
            Held::Here(bytes) => return Ok(bytes),
            Held::Nowhere(next) => next,
        };
        let range = match self.block.load(Ordering::Relaxed) {
            0 => offset..offset + wanted.max(LEAST),
            block => offset..(offset / block + 1) * block,
        };
        let range = range.start..range.end.min(next.unwrap_or(u64::MAX)).min(self.end_start());
        let bytes = self.request(&range)?;
        if self.cache.announce(&range) {
            self.cache.fulfil(&range, Some(bytes.clone()));
        }
        Ok(bytes)
    }

    fn request(&self, range: &Range<u64>) -> Result<Bytes, Error> {
        if range.is_empty() {
            return Ok(Bytes::new());
        }
        let path = &self.location.path;
        wait(path, async {
            let range = GetRange::Bounded(range.clone());
            let got = get(&self.location, Some(range), self.meta.e_tag.clone()).await;
            got.map(|(_, bytes)| bytes).map_err(|refusal| refused(path, "read", refusal))
        })
    }

    fn end_start(&self) -> u64 {
        self.length() - self.end.len() as u64
    }

    fn without_end(&self, range: &Range<u64>) -> Range<u64> {
        range.start.min(self.end_start())..range.end.min(self.end_start())
    }
}

/// Gets a range of an object. A body that breaks off is requested again, also where the crate cannot go on with it.
async fn get(
    location: &ObjectPlace,
    range: Option<GetRange>,
    if_match: Option<String>,
) -> object_store::Result<(ObjectMeta, Bytes)> {
    let begun = std::time::Instant::now();
    let patience = retry().retry_timeout;
    let options = GetOptions { range, if_match, ..GetOptions::default() };
    for attempt in 0_u32.. {
        let result: GetResult = location.store.get_opts(&location.key, options.clone()).await?;
        let meta = result.meta.clone();
        match result.bytes().await {
            Ok(bytes) => return Ok((meta, bytes)),
            Err(refusal) if attempt >= 3 || begun.elapsed() > patience => return Err(refusal),
            Err(_) => tokio::time::sleep(std::time::Duration::from_millis(100 << attempt)).await,
        }
    }
    Err(Refusal::NotImplemented { operation: "get".to_owned(), implementer: "nobody".to_owned() })
}

/// Whether a store refuses a request for the end of an object: it knows none, or the object may be empty.
fn is_no_suffix(refusal: &Refusal) -> bool {
    let text = refusal.to_string();
    matches!(refusal, Refusal::NotSupported { .. }) || text.contains("416") || text.contains("non-partial response")
}
