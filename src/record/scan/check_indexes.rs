//! Check of the message indexes that follow a chunk. Where one is damaged or missing, the chunk is opened again.

use std::collections::BTreeMap;

use super::Scan;
use super::message_indexes::{ChunkReindexing, OpenChunk};
use super::stage::Stage;
use crate::record::frame_window::{Frame, Stop};
use crate::record::plausibility::{Measure, measure};
use crate::record::records::parse_message_index;
use crate::record::reindex::Reindexed;
use crate::record::wire::op;

impl Scan {
    pub(super) fn message_index_record(&mut self, frame: Frame) -> Result<(), Stop> {
        let body = self.window.body(frame, self.limits.record)?;
        let about = parse_message_index(body).map(|(channel, _)| channel);
        let agrees = self.indexes.chunk.as_ref().is_some_and(|chunk| chunk.agrees(body).is_some());
        let Some(channel) = about else {
            self.reject(frame, "a malformed message index");
            return Ok(());
        };
        self.inventory.mentioned.insert(channel);
        match &mut self.indexes.chunk {
            Some(OpenChunk { index, tallies, span, .. }) if agrees => {
                if tallies.is_none() && !index.message_indexes.contains_key(&channel) {
                    let (count, times) = extent(body);
                    *span = span.iter().chain(&times).copied().reduce(|(a, b), (c, d)| (a.min(c), b.max(d)));
                    self.inventory.count_unread(channel, count, times);
                }
                // Readers read all indexes of a chunk in one piece, so those after a wrong one are not listed.
                let behind = index.offset.saturating_add(index.length).saturating_add(index.message_indexes_length);
                if frame.offset == behind {
                    index.message_indexes.insert(channel, frame.offset);
                    index.message_indexes_length += frame.end() - frame.offset;
                }
            }
            Some(_) => {
                self.reject(frame, format!("a message index of channel {channel} that does not agree with its chunk"))
            }
            None if self.indexes.orphans => {}
            None => {
                self.indexes.orphans = true;
                self.reject(frame, "a message index without its chunk");
            }
        }
        Ok(())
    }

    /// Whether this record is a message index of which only the opcode is damaged.
    pub(super) fn is_index_in_disguise(&self, frame: Frame) -> Result<bool, Stop> {
        let Some(chunk) = &self.indexes.chunk else { return Ok(false) };
        if frame.opcode == op::MESSAGE_INDEX || !(6..=self.limits.record).contains(&frame.length) {
            return Ok(false);
        }
        match measure(op::MESSAGE_INDEX, self.window.body(frame, 6)?) == Measure::Says(frame.length) {
            true => Ok(chunk.is_indexed_by(self.window.body(frame, self.limits.record)?)),
            false => Ok(false),
        }
    }

    /// Closes the last chunk, all of whose message indexes have been seen. `next` is the record that follows, if known.
    /// Returns whether the chunk must be opened again first, because indexes are damaged or missing, or the recording
    /// ends there.
    pub(super) fn close_chunk(&mut self, next: Option<Frame>) -> bool {
        let Some(OpenChunk { mut index, tallies, span, followed }) = self.indexes.chunk.take() else { return false };
        (index.start_time, index.end_time) = span.unwrap_or((index.start_time, index.end_time));
        let is_missing = |channel| !index.message_indexes.contains_key(channel);
        let is_incomplete = tallies.iter().flat_map(BTreeMap::keys).any(is_missing);
        let by_choice = !followed && next.is_some_and(|next| is_usual_behind_chunk(next.opcode));
        self.inventory.unindexed |= is_incomplete && by_choice;
        match is_incomplete && !by_choice {
            true => self.stage = Stage::Reindexing(Box::new(ChunkReindexing::of(index, self.window.offset()))),
            false => self.inventory.summary.index(&index),
        }
        is_incomplete && !by_choice
    }

    pub(super) fn reindex(&mut self) -> Result<(), Stop> {
        let Stage::Reindexing(reindexing) = &self.stage else { return Ok(()) };
        self.window.seek(reindexing.chunk.offset);
        let frame = self.window.frame()?;
        let content = self.open_chunk(frame)?;
        let Stage::Reindexing(reindexing) = std::mem::take(&mut self.stage) else { return Ok(()) };
        let ChunkReindexing { chunk, back } = *reindexing;
        match content {
            Ok(content) => {
                let records = self.inflate.records(content.place, self.window.within(&content.data));
                self.inventory.summary.index_later(Reindexed::of(chunk, records));
            }
            // It was in order a moment ago.
            Err(_) => self.inventory.summary.index(&chunk),
        }
        self.window.seek(back);
        self.stage = Stage::Record;
        Ok(())
    }
}

/// Whether a record of this opcode can follow a chunk where a recorder writes no message indexes.
fn is_usual_behind_chunk(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::CHUNK | op::ATTACHMENT | op::METADATA | op::DATA_END)
}

/// Number of messages in a message index, and their first and last log time.
fn extent(body: &[u8]) -> (u64, Option<(u64, u64)>) {
    let entries = parse_message_index(body).map(|(_, entries)| entries);
    entries.into_iter().flatten().fold((0, None), |(count, span), (time, _)| {
        let (from, until) = span.unwrap_or((time, time));
        (count + 1, Some((from.min(time), until.max(time))))
    })
}
