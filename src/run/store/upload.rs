//! A result on its way into a store: a small one in one request, and only if there is none of its name; a large one in
//! parts, which become visible all at once.

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use object_store::{
    Attribute, Attributes, Error as Refusal, GetOptions, GetRange, PutMode, PutMultipartOptions, PutOptions,
    PutPayload, WriteMultipart,
};

use super::client::{ObjectPlace, retry, runtime, wait};
use super::mark::ResultMark;
use super::refusal::{LOOK, has_expired, is_unexplained, refused};
use crate::Error;
use crate::run::output::written::Written;

/// Longest result that is sent in one request (32 MiB).
const WHOLE: usize = 32 << 20;
/// Length of parts (8 MiB), and the number of them that a store allows at most, with some to spare.
const PART: u64 = 8 << 20;
const PARTS: u64 = 9_000;
/// Parts on their way at a time.
const AT_ONCE: usize = 4;
/// Name of the attribute that holds the mark.
const ATTRIBUTE: &str = "stillpoint";

/// A result that is being written.
#[derive(Debug)]
pub(crate) struct Upload {
    location: ObjectPlace,
    /// Whether an existing object is replaced.
    replaces: bool,
    part: u64,
    mark: ResultMark,
    /// Bytes that are not sent yet.
    pending: Vec<u8>,
    /// Locked by nobody: it is never shared, but what holds it is.
    parts: Mutex<Option<WriteMultipart>>,
}

impl Upload {
    /// Begins a result.
    ///
    /// # Errors
    ///
    /// If the URL is wrong.
    pub(crate) fn begin(path: &Path, replaces: bool) -> Result<Self, Error> {
        let location = ObjectPlace::of(path)?;
        Ok(Self {
            location,
            replaces,
            part: PART,
            mark: ResultMark::default(),
            pending: Vec::new(),
            parts: Mutex::new(None),
        })
    }

    /// Notes the mark, of which a large result gets what was noted before its first part was sent, and the approximate
    /// length in bytes.
    pub(crate) fn mark(&mut self, mark: &ResultMark, length: u64) {
        self.mark = mark.clone();
        self.part = self.part.max(length / PARTS);
    }

    /// Takes the next bytes.
    ///
    /// # Errors
    ///
    /// If the store refuses.
    pub(crate) fn put(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.pending.extend_from_slice(bytes);
        let is_begun = self.parts().is_some();
        if !is_begun && self.pending.len() <= WHOLE {
            return Ok(());
        }
        let path = self.location.path.clone();
        let _inside = runtime(&path)?.enter();
        if !is_begun {
            let parts = self.begin_parts()?;
            *self.parts() = Some(parts);
        }
        let parts = self.parts.get_mut().unwrap_or_else(PoisonError::into_inner);
        let Some(parts) = parts else { return Ok(()) };
        wait(&path, async {
            // Piece by piece, so that no more parts are on their way than that.
            for piece in self.pending.chunks(self.part as usize) {
                parts.wait_for_capacity(AT_ONCE).await.map_err(|refusal| refused(&path, "write", refusal))?;
                parts.write(piece);
            }
            Ok(())
        })?;
        self.pending.clear();
        Ok(())
    }

    fn parts(&mut self) -> &mut Option<WriteMultipart> {
        self.parts.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to send parts. The store shows nothing of them until all are there, but does not tell then whether another
    /// result has taken the name; so it is asked before.
    fn begin_parts(&self) -> Result<WriteMultipart, Error> {
        let ObjectPlace { path, key, store, .. } = &self.location;
        if !self.replaces && marked(path)?.is_some() {
            return Err(Error::Exists(path.clone()));
        }
        let upload = patiently(|| {
            wait(path, async {
                let options =
                    PutMultipartOptions { attributes: attributes(&self.mark), ..PutMultipartOptions::default() };
                store.put_multipart_opts(key, options).await.map_err(|refusal| refused(path, "write", refusal))
            })
        })?;
        Ok(WriteMultipart::new_with_chunk_size(upload, self.part as usize))
    }

    /// Completes the result.
    ///
    /// # Errors
    ///
    /// If the store refuses, or has another result of that name; nothing is left behind then.
    pub(crate) fn finish(mut self) -> Result<Written, Error> {
        let path = self.location.path.clone();
        if let Some(mut parts) = self.parts().take() {
            let _inside = runtime(&path)?.enter();
            parts.write(&std::mem::take(&mut self.pending));
            let done = wait(&path, async { Ok(parts.finish().await) })?;
            return match done.map_err(|refusal| refused(&path, "write", refusal)) {
                Ok(_) => Ok(Written::Now),
                // Perhaps only the answer was lost.
                Err(error) => match patiently(|| marked(&path)) {
                    Ok(Some(Some(there))) if there.is_of(&self.mark) => Ok(Written::Now),
                    _ => Err(error),
                },
            };
        }
        let payload = PutPayload::from(std::mem::take(&mut self.pending));
        let put = patiently(|| {
            let put = wait(&path, async { Ok(self.put_whole(payload.clone()).await) })?;
            put.map_err(|refusal| refused(&path, "write", refusal))
        });
        match put {
            Ok(()) => Ok(Written::Now),
            // Another one came first, or an attempt of ours whose answer was lost.
            Err(Error::Exists(_)) => match marked(&path)?.flatten() {
                Some(there) if there.is_of(&self.mark) => Ok(Written::Before),
                _ => Err(Error::Exists(path)),
            },
            Err(error) => Err(error),
        }
    }

    async fn put_whole(&self, payload: PutPayload) -> object_store::Result<()> {
        let ObjectPlace { key, store, is_plain, .. } = &self.location;
        // A web server takes no conditions: it is asked before.
        let mode = if self.replaces || *is_plain { PutMode::Overwrite } else { PutMode::Create };
        if *is_plain && !self.replaces && look(&self.location).await?.is_some() {
            return Err(Refusal::AlreadyExists { path: key.to_string(), source: "it is there".into() });
        }
        let options = PutOptions { mode, attributes: attributes(&self.mark), ..PutOptions::default() };
        store.put_opts(key, payload, options).await.map(drop)
    }
}

impl Drop for Upload {
    fn drop(&mut self) {
        let Some(parts) = self.parts().take() else { return };
        if let Ok(runtime) = runtime(&self.location.path) {
            // What cannot be aborted is never visible, and is removed by the rules of the bucket.
            let _ = runtime.block_on(parts.abort());
        }
    }
}

fn attributes(mark: &ResultMark) -> Attributes {
    let mut attributes = Attributes::new();
    attributes.insert(Attribute::Metadata(ATTRIBUTE.into()), mark.text().into());
    attributes
}

/// Repeats what the crate does not repeat by itself, since it cannot know that it may.
fn patiently<T>(mut attempt: impl FnMut() -> Result<T, Error>) -> Result<T, Error> {
    let (begun, patience) = (Instant::now(), retry().retry_timeout);
    let mut pause = Duration::from_millis(200);
    loop {
        match attempt() {
            Err(error) if has_expired(&error) => return Err(error),
            Err(Error::OutOfReach { .. }) if begun.elapsed() + pause < patience => std::thread::sleep(pause),
            done => return done,
        }
        pause *= 2;
    }
}

/// Mark of an object, if there is one of this name; the inner is `None` if it has no mark. One request.
pub(crate) fn marked(path: &Path) -> Result<Option<Option<ResultMark>>, Error> {
    let location = ObjectPlace::of(path)?;
    wait(path, async { look(&location).await.map_err(|refusal| refused(path, LOOK, refusal)) })
}

async fn look(location: &ObjectPlace) -> object_store::Result<Option<Option<ResultMark>>> {
    let ask = |options: GetOptions| location.store.get_opts(&location.key, options);
    let found = match ask(GetOptions { head: true, ..GetOptions::default() }).await {
        Err(refusal) if is_unexplained(&refusal) && !location.is_plain => {
            ask(GetOptions { range: Some(GetRange::Bounded(0..1)), ..GetOptions::default() }).await
        }
        found => found,
    };
    match found {
        Err(Refusal::NotFound { source, .. }) if source.to_string().contains("NoSuchBucket") => {
            Err(Refusal::NotFound { path: location.key.to_string(), source })
        }
        Err(Refusal::NotFound { .. }) => Ok(None),
        found => {
            let attributes = found?.attributes;
            let mark = attributes.get(&Attribute::Metadata(ATTRIBUTE.into()));
            Ok(Some(mark.and_then(|mark| ResultMark::parse(mark))))
        }
    }
}
