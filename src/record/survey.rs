//! One look over the records of a chunk, before any of them counts: is each whole, and what do they define?
//! Keeping the answer is left to [`Inventory`](super::Inventory).

use super::wire::{Fields, op};
use super::{Channel, Message, Schema};

/// What a run of records holds.
#[derive(Debug, Default)]
pub(super) struct Survey {
    pub(super) schemas: Vec<Schema>,
    pub(super) channels: Vec<Channel>,
    /// Channels and numbers of messages.
    pub(super) counts: Vec<(u16, u64)>,
    /// First and last log time.
    pub(super) span: Option<(u64, u64)>,
}

impl Survey {
    /// Looks over all of `records`; what is wrong with them is told in words.
    pub(super) fn of(records: &[u8]) -> Result<Self, &'static str> {
        let mut survey = Self::default();
        let mut fields = Fields(records);
        while !fields.0.is_empty() {
            let (opcode, body) = fields.record().ok_or("a record that runs past the end of its chunk")?;
            match opcode {
                op::MESSAGE => survey.message(&Message::parse(body).ok_or("a message record of less than 22 bytes")?),
                op::SCHEMA => survey.schemas.push(Schema::parse(body).ok_or("a malformed schema record")?),
                op::CHANNEL => survey.channels.push(Channel::parse(body).ok_or("a malformed channel record")?),
                _ => {}
            }
        }
        Ok(survey)
    }

    fn message(&mut self, message: &Message<'_>) {
        // Neighbours mostly share a channel, and chunks have few.
        match self.counts.iter_mut().rev().find(|(channel, _)| *channel == message.channel) {
            Some((_, count)) => *count += 1,
            None => self.counts.push((message.channel, 1)),
        }
        let (start, end) = self.span.unwrap_or((u64::MAX, 0));
        self.span = Some((start.min(message.log_time), end.max(message.log_time)));
    }
}
