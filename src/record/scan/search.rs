//! A search for the next whole record, after the framing was lost.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::record::horizon::Frame;
use crate::record::shape::{Measure, end};
use crate::record::wire::FRAME;

/// Most bytes that the head of a chunk or attachment may take: times, sizes and two names.
pub(super) const HEAD: u64 = 1 << 16;

/// A search for the next whole record.
#[derive(Debug)]
pub(super) struct Search {
    /// Where the framing was lost.
    pub(super) offset: u64,
    pub(super) what: String,
    /// Where the record may have ended, in ascending order.
    pub(super) tries: Vec<u64>,
    /// Where to search from if it did not, and how far that has come.
    pub(super) from: u64,
    pub(super) at: u64,
    /// If the next record begins here, the one where the framing seemed lost was sound.
    pub(super) confirming: Range<u64>,
}

impl Search {
    /// Of what follows a record whose end is not known; its content may have said something.
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
            confirming: frame.end()..frame.end().saturating_add(1),
        }
    }

    /// Of what follows a message behind which there is no record: either its length is wrong, and there are records
    /// within it, or it is the next record that is damaged.
    pub(super) fn doubting(frame: Frame) -> Self {
        Self {
            offset: frame.offset,
            what: "a message whose length is wrong".to_owned(),
            tries: Vec::new(),
            from: frame.offset + FRAME as u64,
            at: 0,
            confirming: frame.end()..u64::MAX,
        }
    }

    pub(super) fn saying(self, what: impl Into<String>) -> Self {
        Self { what: what.into(), ..self }
    }
}

/// What is known of the framing.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Synchronisation {
    /// Length of the messages outside chunks, by channel; `None` if it varies.
    pub(super) lengths: BTreeMap<u16, Option<u64>>,
    /// Bytes of records that were looked through and are looked through again, since they had swallowed others. Where
    /// they are many more than the recording has, no more are: they may have been laid one into another.
    pub(super) looked: u64,
    /// Where a record begins whose length is not to be doubted.
    pub(super) trusted: Option<u64>,
    /// Bytes of what looked like records and were none. Where they are many more than the recording has, long ones are
    /// not looked at any more: the same bytes may pass for the end of a record at every place in front of them.
    #[serde(skip)]
    pub(super) doubted: u64,
    /// What the last search came to: from where, and what it found.
    #[serde(skip)]
    pub(super) found: Option<(u64, Option<u64>)>,
}
