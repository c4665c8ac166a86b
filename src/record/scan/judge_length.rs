//! Judgement on a record's length, which may be corrupt: it is compared with what the record's content implies and with
//! what follows. A wrong length could swallow whole records.

use mcap::MAGIC;

use super::Scan;
use super::bounds::Bounds;
use super::search::{REACH, Search};
use super::swallowed::{LOOK, swallowed};
use crate::record::chunk::knows;
use crate::record::frame_window::{Frame, Stop};
use crate::record::plausibility::{Measure, SPARE, begins, end, fits, head, measure};
use crate::record::records::{AttachmentIndex, ChunkHeader, parse_metadata};
use crate::record::wire::{FRAME, Fields, op};
use crate::record::{Channel, Message, Schema};

impl Scan {
    /// Judges the length of the record that begins here, all of which lies within the recording.
    pub(super) fn bounds(&self, frame: Frame) -> Result<Bounds, Stop> {
        if self.sync.trusted == Some(frame.offset) || self.summary.begun {
            return Ok(Bounds::Sound);
        }
        if frame.opcode == op::MESSAGE && fits(frame.opcode, frame.length) {
            return self.message_bounds(frame);
        }
        let content = self.measured(frame, frame.length)?;
        match content {
            Measure::Says(length) if length == frame.length => return Ok(Bounds::Sound),
            // Too long to look beyond it from here.
            Measure::Silent if fits(frame.opcode, frame.length) && frame.length > LOOK => {
                return Ok(Bounds::Lost(Search::behind(frame, content)));
            }
            _ => {}
        }
        let ends = |length| end(frame.offset, length);
        // A record may be longer than its content, but hardly if more records follow where the content ends.
        if let Measure::Says(length) = content
            && length < frame.length
            && self.chain_at(ends(length))?
        {
            return Ok(Bounds::Ends(ends(length)));
        }
        let follows = match content {
            Measure::Silent => self.begins_at(frame.end())?,
            _ => self.goes_on_at(frame.end())?,
        };
        if follows {
            return match fits(frame.opcode, frame.length) {
                true if content == Measure::Silent => self.unless_swallowing(frame, 0),
                true => Ok(Bounds::Sound),
                false => Ok(Bounds::Ends(frame.end())),
            };
        }
        if let Measure::Says(length) = content
            && length < frame.length
            && self.is_cut_off_at(ends(length))?
        {
            return Ok(Bounds::Ends(ends(length)));
        }
        let beyond = match content {
            Measure::Needs(_) => self.measured(frame, REACH)?,
            content => content,
        };
        match beyond {
            Measure::Says(length) if self.goes_on_at(ends(length))? => Ok(Bounds::Ends(ends(length))),
            beyond => Ok(Bounds::Lost(Search::behind(frame, beyond))),
        }
    }

    /// Judges a message. Its content does not imply its length, but earlier messages of its channel do if all had the
    /// same.
    fn message_bounds(&self, frame: Frame) -> Result<Bounds, Stop> {
        let channel = Fields(self.window.body(frame, 2)?).u16().unwrap_or_default();
        let is_usual = self.sync.lengths.get(&channel) == Some(&Some(frame.length));
        if !is_usual && frame.length <= LOOK && !self.chain_at(frame.end())? {
            return Ok(Bounds::Lost(Search::doubting(frame)));
        }
        if is_usual && frame.length > LOOK {
            return Ok(Bounds::Sound);
        }
        // Search after the fields that every message has.
        self.unless_swallowing(frame, 22)
    }

    /// Judges a record whose content does not imply its length: sound, unless it contains whole records that reach its
    /// end.
    fn unless_swallowing(&self, frame: Frame, from: usize) -> Result<Bounds, Stop> {
        if self.is_ours(frame) {
            return Ok(Bounds::Sound);
        }
        if frame.length > LOOK {
            return Ok(Bounds::Lost(Search::doubting(frame)));
        }
        if self.sync.looked > 8 * frame.offset + 16 * LOOK {
            return Ok(Bounds::Sound);
        }
        let body = self.window.body(frame, LOOK)?;
        if is_chunk_in_disguise(body) {
            return Ok(Bounds::Sound);
        }
        let goes_on = |at| self.chain_at(frame.offset + at);
        let is_credible = |opcode, body: &[u8]| self.may_be_swallowed(opcode, body);
        Ok(match swallowed(body, from, is_credible, goes_on)? {
            Some(at) => Bounds::Ends(frame.offset + (FRAME + at) as u64),
            None => Bounds::Sound,
        })
    }

    /// Whether an apparent record inside another one is likely to be real.
    fn may_be_swallowed(&self, opcode: u8, body: &[u8]) -> bool {
        let mut fields = Fields(body);
        match opcode {
            op::MESSAGE => Message::parse(body).is_some_and(|message| {
                self.inventory.channels().contains_key(&message.channel) || self.is_of_the_time(message.log_time)
            }),
            op::SCHEMA => Schema::parse(body).is_some(),
            op::CHANNEL => Channel::parse(body).is_some(),
            op::CHUNK => ChunkHeader::parse(&mut fields).is_some_and(|header| knows(header.compression)),
            op::ATTACHMENT => AttachmentIndex::parse_attachment(&mut fields, 0, 0).is_some(),
            op::METADATA => parse_metadata(body).is_some(),
            _ => false,
        }
    }

    /// Length that a record's content implies, by at most `most` bytes of it.
    pub(super) fn measured(&self, frame: Frame, most: u64) -> Result<Measure, Stop> {
        let left = self.window.extent().length.saturating_sub(frame.offset + FRAME as u64);
        let most = most.min(REACH);
        // In a growing recording, missing bytes may still arrive.
        let most = if self.window.extent().finished { most.min(left) } else { most };
        let mut seen = most.min(64);
        loop {
            let body = self.window.peek(FRAME + seen as usize)?.get(FRAME..).unwrap_or_default();
            match measure(frame.opcode, body) {
                Measure::Needs(needed) if needed <= most => seen = needed,
                measured => return Ok(measured),
            }
        }
    }

    /// Whether a record begins at `offset`, or the recording ends there. False if it is too far away to look at.
    pub(super) fn begins_at(&self, offset: u64) -> Result<bool, Stop> {
        Ok(self.look(offset)?.is_some_and(begins))
    }

    /// Whether a record begins at `offset`, followed by another one or by the end of the recording. A misaligned head
    /// may look like one record, but not like two. One exception: the last letter of a chunk's compression name and the
    /// compressed size after it look like a record that leads to the chunk's end. So the first opcode must not be an
    /// unassigned one.
    pub(super) fn chain_at(&self, offset: u64) -> Result<bool, Stop> {
        let first = self.look(offset)?;
        let Some((opcode, length)) = first.and_then(head) else { return Ok(first.is_some_and(<[u8]>::is_empty)) };
        if !fits(opcode, length) || length > LOOK || matches!(opcode, 0x10..0x80) {
            return Ok(false);
        }
        let second = self.look(end(offset, length))?;
        if opcode == op::FOOTER {
            return Ok(second == Some(MAGIC));
        }
        Ok(second.is_some_and(begins))
    }

    /// Like [`chain_at`](Self::chain_at), but the next record may be cut off by the end of the recording.
    pub(super) fn goes_on_at(&self, offset: u64) -> Result<bool, Stop> {
        Ok(self.chain_at(offset)? || self.is_cut_off_at(offset)?)
    }

    /// Whether a record begins at `offset` that runs past the end of the recording. Its content must imply the same, as
    /// far as it is there.
    fn is_cut_off_at(&self, offset: u64) -> Result<bool, Stop> {
        let extent = self.window.extent();
        if !extent.finished {
            return Ok(false);
        }
        let Some(seen) = self.look_at(offset, 64)? else { return Ok(false) };
        let Some((opcode, length)) = head(seen) else { return Ok(!seen.is_empty() && begins(seen)) };
        let body = seen.get(FRAME..).unwrap_or_default();
        let agrees = match measure(opcode, body) {
            Measure::Says(measured) => measured <= length && length - measured <= SPARE,
            Measure::Needs(_) => true,
            Measure::Silent => false,
        };
        Ok(agrees && fits(opcode, length) && end(offset, length) > extent.length)
    }

    /// First bytes of a possible record at `offset`; fewer at the end of the recording, `None` if it is out of reach.
    pub(super) fn look(&self, offset: u64) -> Result<Option<&[u8]>, Stop> {
        self.look_at(offset, FRAME)
    }

    fn look_at(&self, offset: u64, most: usize) -> Result<Option<&[u8]>, Stop> {
        let extent = self.window.extent();
        let ahead = offset.saturating_sub(self.window.offset());
        if ahead > 2 * LOOK || (extent.finished && offset > extent.length) {
            return Ok(None);
        }
        let left = if extent.finished { extent.length - offset } else { u64::MAX };
        let until = ahead + left.min(most as u64);
        Ok(self.window.peek(until as usize)?.get(ahead as usize..))
    }
}

/// Whether a record has the content of a chunk: then only its opcode is wrong, and it swallowed nothing.
fn is_chunk_in_disguise(body: &[u8]) -> bool {
    measure(op::CHUNK, body) == Measure::Says(body.len() as u64)
        && ChunkHeader::parse(&mut Fields(body)).is_some_and(|header| knows(header.compression))
}
