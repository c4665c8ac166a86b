//! Parts of an object that were requested, until they are no longer needed. [`object`](super::object)
//! requests them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use bytes::Bytes;

/// Parts of an object, none overlapping another.
#[derive(Debug, Default)]
pub(super) struct Cache {
    parts: Mutex<BTreeMap<u64, CachedPart>>,
    changed: Condvar,
}

#[derive(Debug)]
struct CachedPart {
    end: u64,
    /// The bytes; `None` while they are on their way.
    bytes: Option<Bytes>,
}

/// Knowledge of the bytes at an offset.
pub(super) enum Held {
    /// The bytes from there on.
    Here(Bytes),
    /// Nobody requested them; whatever was requested begins at this offset.
    Nowhere(Option<u64>),
}

impl Cache {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, CachedPart>> {
        self.parts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that a range is about to be requested. Returns whether it is: not if part of it was already.
    pub(super) fn announce(&self, range: &Range<u64>) -> bool {
        let mut parts = self.lock();
        let before = parts.range(..range.end).next_back();
        let is_free = range.start < range.end && before.is_none_or(|(_, part)| part.end <= range.start);
        if is_free {
            parts.insert(range.start, CachedPart { end: range.end, bytes: None });
        }
        is_free
    }

    /// Whether a range was announced and its bytes are not here.
    pub(super) fn awaits(&self, range: &Range<u64>) -> bool {
        self.lock().get(&range.start).is_some_and(|part| part.end == range.end && part.bytes.is_none())
    }

    /// Takes the bytes of an announced range; `None` if they could not be had.
    pub(super) fn fulfil(&self, range: &Range<u64>, bytes: Option<Bytes>) {
        let mut parts = self.lock();
        match bytes.filter(|bytes| bytes.len() as u64 == range.end - range.start) {
            Some(bytes) => {
                // What was forgotten meanwhile is not needed any more.
                parts.entry(range.start).and_modify(|part| part.bytes = Some(bytes));
            }
            None => drop(parts.remove(&range.start)),
        }
        self.changed.notify_all();
    }

    /// The bytes from an offset on, once those on their way are here.
    pub(super) fn find(&self, offset: u64) -> Held {
        let mut parts = self.lock();
        loop {
            let at = parts.range(..=offset).next_back().filter(|(_, part)| offset < part.end);
            match at.map(|(start, part)| (*start, part.bytes.clone())) {
                Some((start, Some(bytes))) => return Held::Here(bytes.slice((offset - start) as usize..)),
                Some((_, None)) => {
                    parts = self.changed.wait(parts).unwrap_or_else(PoisonError::into_inner);
                }
                None => return Held::Nowhere(parts.range(offset..).next().map(|(start, _)| *start)),
            }
        }
    }

    /// Drops what ends before an offset.
    pub(super) fn forget_before(&self, offset: u64) {
        self.lock().retain(|_, part| part.end > offset || part.bytes.is_none());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_found_once_they_are_here_and_until_they_are_forgotten() {
        let cache = Cache::default();
        assert!(cache.announce(&(10..20)));
        assert!(!cache.announce(&(5..11)) && !cache.announce(&(19..30)) && !cache.announce(&(12..13)));
        assert!(cache.announce(&(20..22)));
        std::thread::scope(|scope| {
            let found = scope.spawn(|| matches!(cache.find(12), Held::Here(bytes) if bytes[..] == [2; 8]));
            cache.fulfil(&(10..20), Some(Bytes::from_static(&[2; 10])));
            assert!(found.join().unwrap());
        });
        cache.fulfil(&(20..22), None);
        assert!(matches!(cache.find(20), Held::Nowhere(None)));
        assert!(matches!(cache.find(3), Held::Nowhere(Some(10))));
        cache.forget_before(20);
        assert!(matches!(cache.find(12), Held::Nowhere(None)));
    }
}
