//! What stands behind a chunk: the indexes of its messages, each held against the chunk. Where one is damaged or missing,
//! the chunk is looked at again. Indexing its messages anew is left to [`Reindexed`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Scan, Stage, within};
use crate::record::chunk::LIMIT;
use crate::record::horizon::{Frame, Stop};
use crate::record::records::{ChunkIndex, parse_message_index};
use crate::record::reindex::Reindexed;
use crate::record::shape::{Measure, measure};
use crate::record::survey::Tally;
use crate::record::wire::op;

/// A chunk whose message indexes may follow.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct OpenChunk {
    pub(super) index: ChunkIndex,
    /// Its messages, by channel; `None` of a chunk that is not read.
    pub(super) tallies: Option<BTreeMap<u16, Tally>>,
    /// First and last log time by the indexes of a chunk that is not read.
    pub(super) span: Option<(u64, u64)>,
    /// Whether something that may have been a message index stood behind it, in order or not.
    pub(super) followed: bool,
}

impl OpenChunk {
    /// The channel that a message index is about, if what it says of its messages is true. Of a chunk that is not read,
    /// it is believed.
    fn agrees(&self, body: &[u8]) -> Option<u16> {
        let (channel, entries) = parse_message_index(body)?;
        let Some(tallies) = &self.tallies else { return Some(channel) };
        let mut told = Tally::default();
        entries.for_each(|(log_time, offset)| told.add(log_time, offset));
        (tallies.get(&channel).copied().unwrap_or_default() == told).then_some(channel)
    }

    /// Whether a record has no other content than the index of some of its messages.
    fn is_indexed_by(&self, body: &[u8]) -> bool {
        measure(op::MESSAGE_INDEX, body) == Measure::Says(body.len() as u64)
            && self
                .agrees(body)
                .zip(self.tallies.as_ref())
                .is_some_and(|(channel, tallies)| tallies.contains_key(&channel))
    }
}

/// A chunk to be opened again.
pub(super) struct Reindexing {
    chunk: ChunkIndex,
    /// Where to go on afterwards.
    back: u64,
}

impl Reindexing {
    fn of(chunk: ChunkIndex, back: u64) -> Self {
        Self { chunk, back }
    }
}

impl Scan {
    pub(super) fn message_index_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let body = self.horizon.body(frame, LIMIT)?;
        let about = parse_message_index(body).map(|(channel, _)| channel);
        let agrees = self.chunk.as_ref().is_some_and(|chunk| chunk.agrees(body).is_some());
        let Some(channel) = about else {
            self.reject(frame, "a malformed message index");
            return Ok(());
        };
        self.inventory.mentioned.insert(channel);
        match &mut self.chunk {
            Some(OpenChunk { index, tallies, span, .. }) if agrees => {
                if tallies.is_none() && !index.message_indexes.contains_key(&channel) {
                    let (count, times) = extent(body);
                    *span = span.iter().chain(&times).copied().reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
                    self.inventory.count_unread(channel, count, times);
                }
                // Readers take all indexes of a chunk in one piece, so that those behind a wrong one are not named.
                let behind = index.offset.saturating_add(index.length).saturating_add(index.message_indexes_length);
                if frame.offset == behind {
                    index.message_indexes.insert(channel, frame.offset);
                    index.message_indexes_length += frame.end() - frame.offset;
                }
            }
            Some(_) => {
                self.reject(frame, format!("a message index of channel {channel} that does not agree with its chunk"))
            }
            None if self.orphans => {}
            None => {
                self.orphans = true;
                self.reject(frame, "a message index without its chunk");
            }
        }
        Ok(())
    }

    /// Whether what looks like something else is a message index, of which the opcode alone is damaged.
    pub(super) fn is_index_in_disguise(&self, frame: Frame) -> Result<bool, Stop> {
        let Some(chunk) = &self.chunk else { return Ok(false) };
        if frame.opcode == op::MESSAGE_INDEX || !(6..=LIMIT).contains(&frame.length) {
            return Ok(false);
        }
        match measure(op::MESSAGE_INDEX, self.horizon.body(frame, 6)?) == Measure::Says(frame.length) {
            true => Ok(chunk.is_indexed_by(self.horizon.body(frame, LIMIT)?)),
            false => Ok(false),
        }
    }

    /// All message indexes of the last chunk have been seen, and this record follows, if it is known. Whether the chunk
    /// must be looked at again before going on: behind damaged or missing indexes, or a recording's end.
    pub(super) fn close_chunk(&mut self, next: Option<Frame>) -> bool {
        let Some(OpenChunk { mut index, tallies, span, followed }) = self.chunk.take() else { return false };
        (index.start_time, index.end_time) = span.unwrap_or((index.start_time, index.end_time));
        let is_missing = |channel| !index.message_indexes.contains_key(channel);
        let is_incomplete = tallies.iter().flat_map(BTreeMap::keys).any(is_missing);
        let by_choice = !followed && next.is_some_and(|next| is_usual_behind_chunk(next.opcode));
        self.inventory.unindexed |= is_incomplete && by_choice;
        match is_incomplete && !by_choice {
            true => self.stage = Stage::Reindexing(Box::new(Reindexing::of(index, self.horizon.offset()))),
            false => self.inventory.summary.index(&index),
        }
        is_incomplete && !by_choice
    }

    pub(super) fn reindex(&mut self) -> Result<(), Stop> {
        let Stage::Reindexing(reindexing) = &self.stage else { return Ok(()) };
        self.horizon.seek(reindexing.chunk.offset);
        let frame = self.horizon.frame()?;
        let content = self.open_chunk(frame)?;
        let Stage::Reindexing(reindexing) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let Reindexing { chunk, back } = *reindexing;
        match content {
            Ok(content) => {
                let records = self.inflate.records(content.place, within(&self.horizon, &content.data));
                self.inventory.summary.index_later(Reindexed::of(chunk, records));
            }
            // It was in order a moment ago.
            Err(_) => self.inventory.summary.index(&chunk),
        }
        self.horizon.seek(back);
        self.stage = Stage::Record;
        Ok(())
    }
}

/// Whether a record of this opcode stands behind a chunk where a recorder writes no message indexes.
fn is_usual_behind_chunk(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END)
}

/// How many messages a message index names, and their first and last log time.
fn extent(body: &[u8]) -> (u64, Option<(u64, u64)>) {
    let entries = parse_message_index(body).map(|(_, entries)| entries);
    entries.into_iter().flatten().fold((0, None), |(count, span), (time, _)| {
        let (from, until) = span.unwrap_or((time, time));
        (count + 1, Some((from.min(time), until.max(time))))
    })
}
