//! Search for the next whole record after the framing was lost.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::record::frame_window::Frame;
use crate::record::plausibility::{Measure, end};
use crate::record::wire::FRAME;

/// Largest distance at which a record's end is looked for, in bytes (16 MiB).
pub(super) const REACH: u64 = 1 << 24;

/// Longest head of a chunk or attachment, in bytes: times, sizes and two names.
pub(super) const HEAD: u64 = 1 << 16;

/// What is said where only zeros follow.
pub(super) const ZEROS: &str =
    "zeros to the end of the recording: its recorder reserved room and was cut off before it was filled";

/// Search for the next whole record.
#[derive(Debug)]
pub(super) struct Search {
    /// Offset at which the framing was lost.
    pub(super) offset: u64,
    pub(super) what: String,
    /// Offsets at which the record may have ended, in ascending order.
    pub(super) tries: Vec<u64>,
    /// Start of the search if it ended at none of these, and the progress of that search.
    pub(super) from: u64,
    pub(super) at: u64,
    /// Whether only zeros were found so far.
    pub(super) blank: bool,
    /// Range in which the next record must begin if the record that seemed to have lost the framing was sound.
    pub(super) confirming: Range<u64>,
}

impl Search {
    /// Search after a record whose end is unknown. `content` is what its content implies about its length.
    pub(super) fn behind(frame: Frame, content: Measure) -> Self {
        let mut tries = vec![frame.end()];
        if let Measure::Says(length) = content {
            tries.push(end(frame.offset, length));
        }
        tries.sort_unstable();
        Self {
            offset: frame.offset,
            what: "the framing is lost: behind what stands here, no record begins".to_owned(),
            tries,
            from: frame.offset + 1,
            at: 0,
            blank: frame.opcode == 0 && frame.length == 0,
            confirming: frame.end()..frame.end().saturating_add(1),
        }
    }

    /// Search after a message that no record follows: either its length is wrong and it contains records, or the next
    /// record is damaged.
    pub(super) fn doubting(frame: Frame) -> Self {
        Self {
            offset: frame.offset,
            what: "a message whose length is wrong".to_owned(),
            tries: Vec::new(),
            from: frame.offset + FRAME as u64,
            at: 0,
            blank: false,
            confirming: frame.end()..u64::MAX,
        }
    }

    pub(super) fn saying(self, what: impl Into<String>) -> Self {
        Self { what: what.into(), ..self }
    }
}

/// State of the framing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Synchronisation {
    /// Length of the messages outside chunks, by channel; `None` if it varies.
    pub(super) lengths: BTreeMap<u16, Option<u64>>,
    /// Bytes of records that are searched twice, since they had swallowed others. If they far exceed the recording, no
    /// more are searched: records may be nested in one another.
    pub(super) looked: u64,
    /// Offset of a record whose length is not to be doubted.
    pub(super) trusted: Option<u64>,
    /// Bytes of rejected candidates. If they far exceed the recording, long candidates are no longer checked: the same
    /// bytes may look like the end of a record from every place before them.
    #[serde(skip)]
    pub(super) doubted: u64,
    /// Start and result of the last search.
    #[serde(skip)]
    pub(super) found: Option<(u64, Option<u64>)>,
}

impl Synchronisation {
    /// Result of the last search if a search from this offset would repeat it.
    pub(super) fn found_from(&self, offset: u64) -> Option<Option<u64>> {
        let (from, found) = self.found?;
        (from..=found.unwrap_or(u64::MAX)).contains(&offset).then_some(found)
    }

    /// Keeps the result of a search. The record found is not doubted again.
    pub(super) fn note_found(&mut self, from: u64, found: Option<u64>) {
        self.found = Some((from, found));
        self.trusted = found;
    }

    /// Whether more bytes of candidates were rejected in front of this offset than is worth while.
    pub(super) fn has_doubted_enough(&self, offset: u64) -> bool {
        self.doubted > 4 * offset + 4 * REACH
    }

    /// Notes the length of a message outside chunks.
    pub(super) fn note_length(&mut self, channel: u16, length: u64) {
        let usual = self.lengths.entry(channel).or_insert(Some(length));
        *usual = usual.filter(|&usual| usual == length);
    }
}
