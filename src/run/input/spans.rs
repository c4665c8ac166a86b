//! Chunks of an object that are needed, as far as its summary and the channels met so far tell, and the bytes that are
//! requested together. The result of a scan does not depend on it.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use crate::record::{Chunk, Inventory, Places};

/// Longest gap that is requested along with the chunks on its both sides (64 KiB), and the share of a span that all its
/// gaps may be: one sixteenth.
const GAP: u64 = 64 << 10;
const SHARE: u64 = 16;
/// Longest gap that never counts (4 KiB).
const NOTHING: u64 = 4 << 10;
/// Length of a span from which on no more is added (8 MiB).
const LONG: u64 = 8 << 20;

/// Whether a chunk is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    /// It is not.
    None,
    /// It holds what is used, or defines channels in an order that nothing else tells.
    Some,
    /// It cannot be told before an earlier chunk was scanned.
    Unknown,
}

/// The next bytes to request, and what was met of the channels.
pub(super) struct Spans {
    places: Arc<Places>,
    /// Channels of chunks that are needed.
    met: BTreeSet<u16>,
    span: Range<u64>,
    /// Bytes of gaps in the span.
    gaps: u64,
    /// Offset up to which everything was requested otherwise.
    requested: u64,
}

impl Spans {
    /// No span is requested yet, but everything up to an offset.
    pub(super) fn new(places: Arc<Places>, requested: u64) -> Self {
        Self { places, met: BTreeSet::new(), span: 0..0, gaps: 0, requested }
    }

    /// Whether a chunk is needed. `is_useless` tells it of channels that were scanned.
    pub(super) fn need(&mut self, chunk: &Chunk, scanned: &Inventory, is_useless: impl Fn(&[u16]) -> bool) -> Need {
        let Some(channels) = chunk.channels.as_deref().filter(|channels| !channels.is_empty()) else {
            return Need::Some;
        };
        let (known, unknown): (Vec<_>, Vec<_>) =
            channels.iter().partition(|channel| scanned.channels().contains_key(channel));
        let is_used = !known.is_empty() && !is_useless(&known);
        let is_new = |channel: &u16| !self.met.contains(channel);
        let need = match unknown.as_slice() {
            _ if is_used => Need::Some,
            [] => Need::None,
            // The scan will know the channel by the summary once it comes to the chunk.
            [one] if self.places.defines(*one) => Need::Unknown,
            unknown if unknown.iter().any(is_new) => Need::Some,
            _ => Need::Unknown,
        };
        if need == Need::Some {
            self.met.extend(channels);
        }
        need
    }

    /// Adds the chunk at an offset, with its message indexes, to the span. Returns whether it fits.
    pub(super) fn add(&mut self, offset: u64) -> bool {
        let Some(range) = self.places.range(offset).filter(|range| range.end > self.requested) else { return true };
        if self.span.is_empty() {
            (self.span, self.gaps) = (range, 0);
            return true;
        }
        let gap = range.start.saturating_sub(self.span.end);
        let gaps = self.gaps + if gap > NOTHING { gap } else { 0 };
        let length = range.end.saturating_sub(self.span.start);
        if gap > GAP || gaps > length / SHARE || self.span.end - self.span.start >= LONG {
            return false;
        }
        (self.span.end, self.gaps) = (range.end, gaps);
        true
    }

    /// Takes the span.
    pub(super) fn take(&mut self) -> Option<Range<u64>> {
        let span = std::mem::replace(&mut self.span, 0..0);
        (!span.is_empty()).then_some(span)
    }
}
