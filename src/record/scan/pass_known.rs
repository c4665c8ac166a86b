//! Passing of chunks and attachments that the summary describes, unread.

use std::sync::Arc;

use super::Scan;
use super::stage::{Stage, Step};
use super::supply::Supply;
use crate::record::Places;
use crate::record::chunk_check::ChunkCheck;
use crate::record::frame_window::Frame;
use crate::record::inventory::NamedRecord;
use crate::record::places::KnownChunk;
use crate::record::wire::{FRAME, op};

impl Scan {
    /// Uses what the summary says of the places of chunks. They are offered before a byte of them is read, and one that
    /// is answered by [`Supply::Unread`] is passed with its message indexes. Attachments are passed, too. The channel of a
    /// chunk that brings one new channel is known before the chunk is offered; of several, only the chunk tells their order.
    pub fn knowing(self, places: Arc<Places>) -> Self {
        Self { places: Some(places), ..self }
    }

    /// Offers or passes what is known to stand here. Returns whether there is nothing to read here now.
    pub(super) fn pass_known(&mut self) -> bool {
        let offset = self.window.offset();
        let Some(places) = self.places.clone().filter(|_| !self.summary.begun) else { return false };
        if let Some(index) = places.attachment(offset) {
            let frame = Frame { offset, opcode: op::ATTACHMENT, length: index.length - FRAME as u64 };
            if !self.stands_in_place(frame) {
                return false;
            }
            if !self.close_chunk(Some(frame)) {
                self.indexes.orphans = false;
                self.place_record(frame, NamedRecord::Attachment(index.clone()));
                self.pass(frame);
            }
            return true;
        }
        let Some(place) = places.chunk(offset) else { return false };
        let whole = Frame { length: place.end() - offset - FRAME as u64, ..place.frame() };
        if !self.offering || !self.stands_in_place(whole) {
            return false;
        }
        match &self.supply {
            Some((at, Supply::Unread)) if *at == offset => {}
            Some((at, _)) if *at == offset => return false,
            _ => {
                if !self.close_chunk(Some(whole)) && !self.define_one(&places, place) {
                    self.stage = Stage::Offering(place.frame());
                }
                return true;
            }
        }
        let header = place.header();
        let refused = self.limits.refuse_chunk(&header, self.inventory.opened, whole.end()).is_err();
        let Some(counts) = place.counts().filter(|_| !refused) else { return false };
        self.supply = None;
        self.data_crc.chunk();
        self.inventory.opened = self.inventory.opened.saturating_add(header.inflated());
        for (channel, count) in counts {
            self.inventory.mentioned.insert(channel);
            let span = (place.index.start_time, place.index.end_time);
            self.inventory.count_unread(channel, count, (count > 0).then_some(span));
        }
        self.inventory.summary.index(&place.index);
        self.indexes.orphans = false;
        self.queue.push_back(Step::ChunkEnd);
        self.pass(whole);
        true
    }

    /// Defines the only new channel of a chunk by the summary. Returns whether it did.
    fn define_one(&mut self, places: &Places, place: &KnownChunk) -> bool {
        let known = self.inventory.channels();
        let mut new = place.index.message_indexes.keys().filter(|channel| !known.contains_key(channel));
        let (Some(&channel), None) = (new.next(), new.next()) else { return false };
        let Some((schema, channel)) = places.definition(channel) else { return false };
        let (schemas, channels) = (schema.cloned().into_iter().collect(), vec![channel.clone()]);
        let survey = ChunkCheck { schemas, channels, ..ChunkCheck::default() };
        let has_room = self.inventory.refuses(&survey, &self.limits).is_none();
        if has_room {
            self.admit(place.frame(), survey);
        }
        has_room
    }
}
