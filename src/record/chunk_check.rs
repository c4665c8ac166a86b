//! Check of a chunk's records before any of them is used: whether each is whole, and what they define. The
//! [`Inventory`](super::Inventory) keeps the result.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::limits::Limits;
use super::wire::{Fields, op};
use super::{Channel, Message, Schema};

/// Contents of a sequence of records.
#[derive(Debug, Default)]
pub(super) struct ChunkCheck {
    pub(super) schemas: Vec<Schema>,
    pub(super) channels: Vec<Channel>,
    /// Messages by channel.
    pub(super) tallies: BTreeMap<u16, Tally>,
    /// First and last log time, in nanoseconds.
    pub(super) span: Option<(u64, u64)>,
}

/// Tally of the messages of one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Tally {
    pub(super) count: u64,
    /// Digest of their log times and offsets, independent of their order.
    digest: u64,
}

impl Tally {
    /// Adds a message by its log time and its offset in the chunk's records.
    pub(super) fn add(&mut self, log_time: u64, offset: u64) {
        self.count += 1;
        // Finaliser of SplitMix64 (Steele et al. 2014), so that a difference in any bit changes the sum.
        let mut mixed = log_time ^ offset.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        self.digest = self.digest.wrapping_add(mixed ^ (mixed >> 31));
    }
}

impl ChunkCheck {
    /// Checks all of `records`. The error describes what is malformed or too large.
    pub(super) fn of(records: &[u8], limits: &Limits) -> Result<Self, String> {
        let mut survey = Self::default();
        let (mut schemas, mut channels) = (BTreeMap::new(), BTreeMap::new());
        let mut fields = Fields(records);
        while !fields.0.is_empty() {
            let offset = (records.len() - fields.0.len()) as u64;
            let (opcode, body) = fields.record().ok_or("a record that runs past the end of its chunk")?;
            match opcode {
                op::SCHEMA | op::CHANNEL if body.len() as u64 > limits.definition => {
                    return Err(limits.refuse_definition(opcode, body.len() as u64));
                }
                op::MESSAGE => {
                    survey.message(&Message::parse(body).ok_or("a message record of less than 22 bytes")?, offset);
                }
                op::SCHEMA => {
                    let schema = Schema::parse(body).ok_or("a malformed schema record")?;
                    note(&mut survey.schemas, &mut schemas, schema.id, schema);
                }
                op::CHANNEL => {
                    let channel = Channel::parse(body).ok_or("a malformed channel record")?;
                    note(&mut survey.channels, &mut channels, channel.id, channel);
                }
                _ => {}
            }
        }
        Ok(survey)
    }

    fn message(&mut self, message: &Message<'_>, offset: u64) {
        self.tallies.entry(message.channel).or_default().add(message.log_time, offset);
        let (start, end) = self.span.unwrap_or((u64::MAX, 0));
        self.span = Some((start.min(message.log_time), end.max(message.log_time)));
    }
}

/// Keeps the first record with an id, and the first that contradicts it. Further records add nothing.
fn note<T: PartialEq>(kept: &mut Vec<T>, known: &mut BTreeMap<u16, (usize, bool)>, id: u16, record: T) {
    match known.get_mut(&id) {
        None => {
            known.insert(id, (kept.len(), false));
            kept.push(record);
        }
        Some((first, contradicted)) => {
            if !*contradicted && kept.get(*first) != Some(&record) {
                *contradicted = true;
                kept.push(record);
            }
        }
    }
}
