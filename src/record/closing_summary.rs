//! Closing summary: the channels and message counts that a recorder writes at the end of a recording, available without
//! reading the data. Trusted only if its CRC is right and the chunks are where it says; otherwise the data must be
//! read.

use std::collections::BTreeMap;

use crc32fast::Hasher;
use mcap::MAGIC;

use super::footer::Footer;
use super::records::ChunkIndex;
use super::walk::{ReadAt, Walk, footer, read};
use super::wire::{FRAME, Fields, op};
use super::{Channel, Error, Limits, Schema};

/// Summary at the end of a recording.
#[derive(Debug, Default, PartialEq)]
pub struct ClosingSummary {
    /// Schemas by id.
    pub schemas: BTreeMap<u16, Schema>,
    /// Channels by id.
    pub channels: BTreeMap<u16, Channel>,
    /// Number of messages by channel id.
    pub counts: BTreeMap<u16, u64>,
    /// First and last log time, in nanoseconds.
    pub span: Option<(u64, u64)>,
}

/// Longest summary that is read, in bytes: no recorder writes a longer one.
const LIMIT: u64 = 256 << 20;
/// Read size, in bytes.
const BLOCK: u64 = 1 << 20;

impl ClosingSummary {
    /// Reads the end of a recording of this length; `None` if the summary is absent, not whole, or does not fit the
    /// data.
    ///
    /// # Errors
    /// If the recording cannot be read.
    pub fn of(file: &mut impl ReadAt, length: u64) -> Result<Option<Self>, Error> {
        Self::read(file, length, true)
    }

    /// The same, by the end alone: whether the chunks are where it says is not looked at.
    ///
    /// # Errors
    /// If the recording cannot be read.
    pub fn of_end(file: &mut impl ReadAt, length: u64) -> Result<Option<Self>, Error> {
        Self::read(file, length, false)
    }

    fn read(file: &mut impl ReadAt, length: u64, looks: bool) -> Result<Option<Self>, Error> {
        let Some(footer) = footer(file, length)? else { return Ok(None) };
        if footer.section.is_empty() || !holds(file, &footer, length)? {
            return Ok(None);
        }
        let mut found = Self::default();
        let (mut total, mut chunks) = (None, Vec::new());
        let (mut walk, limits, mut defined) = (Walk::new(footer.section.clone(), BLOCK), Limits::default(), 0);
        while let Some(frame) = walk.next(file)? {
            defined += if matches!(frame.opcode, op::SCHEMA | op::CHANNEL) { frame.length } else { 0 };
            if frame.length > limits.record || defined > limits.definitions {
                // Whoever reads the data says which limit bites.
                return Ok(None);
            }
            let body = walk.body(file, frame, limits.record)?;
            let understood = match frame.opcode {
                op::SCHEMA => Schema::parse(body).map(|schema| drop(found.schemas.insert(schema.id, schema))),
                op::CHANNEL => Channel::parse(body).map(|channel| drop(found.channels.insert(channel.id, channel))),
                op::STATISTICS => statistics(body).map(|(messages, counts)| {
                    (total, found.counts) = (Some(messages), counts);
                }),
                op::CHUNK_INDEX => ChunkIndex::parse(body).map(|chunk| {
                    chunks.push((chunk.offset, chunk.length));
                    if chunk.start_time != 0 || chunk.end_time != 0 {
                        let (from, until) = found.span.unwrap_or((u64::MAX, 0));
                        found.span = Some((from.min(chunk.start_time), until.max(chunk.end_time)));
                    }
                }),
                _ => Some(()),
            };
            if understood.is_none() {
                return Ok(None);
            }
        }
        let schemas = |channel: &Channel| channel.schema_id == 0 || found.schemas.contains_key(&channel.schema_id);
        let known =
            found.counts.keys().all(|id| found.channels.contains_key(id)) && found.channels.values().all(schemas);
        if !known
            || total.is_none()
            || total != found.counts.values().try_fold(0_u64, |sum, &count| sum.checked_add(count))
            || chunks.is_empty()
            || walk.offset() != footer.section.end
        {
            return Ok(None);
        }
        for chunk in chunks {
            if looks && !stands(file, chunk, length)? {
                return Ok(None);
            }
        }
        Ok(Some(found))
    }
}

/// Whether the CRC of a summary is right. A summary without CRC is not trusted.
fn holds(file: &mut impl ReadAt, footer: &Footer, length: u64) -> Result<bool, Error> {
    let until = length - MAGIC.len() as u64 - 4;
    if until - footer.section.start > LIMIT {
        return Ok(false);
    }
    let mut computed = Hasher::new();
    let mut at = footer.section.start;
    while at < until {
        let end = until.min(at + BLOCK);
        computed.update(&read(file, at..end)?);
        at = end;
    }
    Ok(footer.crc == computed.finalize())
}

/// Whether a chunk is where its index says.
fn stands(file: &mut impl ReadAt, (offset, long): (u64, u64), length: u64) -> Result<bool, Error> {
    let end = offset.checked_add(long);
    if end.is_none_or(|end| end > length) || long < FRAME as u64 {
        return Ok(false);
    }
    let frame = read(file, offset..offset + FRAME as u64)?;
    let mut fields = Fields(&frame);
    Ok((fields.u8(), fields.u64()) == (Some(op::CHUNK), Some(long - FRAME as u64)))
}

/// Number of messages in a statistics record: total, and by channel.
fn statistics(body: &[u8]) -> Option<(u64, BTreeMap<u16, u64>)> {
    let mut fields = Fields(body);
    let total = fields.u64()?;
    // Skipped: numbers of schemas, channels, attachments, metadata and chunks; first and last log time.
    fields.bytes(2 + 4 * 4 + 2 * 8)?;
    let mut pairs = Fields(fields.blob()?);
    let mut counts = BTreeMap::new();
    while !pairs.0.is_empty() {
        counts.insert(pairs.u16()?, pairs.u64()?);
    }
    Some((total, counts))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::record::{Event, Inventory, Scan};
    use crate::simulate::{Scenario, record};

    /// Closing summary of a file.
    fn closing(bytes: &[u8]) -> Option<ClosingSummary> {
        ClosingSummary::of(&mut &bytes[..], bytes.len() as u64).unwrap()
    }

    /// Inventory by a full scan.
    fn inventory(bytes: &[u8]) -> Inventory {
        let mut scan = Scan::finished(bytes.len() as u64);
        loop {
            match scan.next_event().unwrap() {
                Event::Read { offset, .. } => {
                    let rest = &bytes[offset as usize..];
                    scan.insert(rest.len()).copy_from_slice(rest);
                    scan.notify_read(rest.len());
                }
                Event::End => return scan.into_inventory(),
                _ => {}
            }
        }
    }

    #[test]
    fn the_end_of_a_whole_recording_says_what_is_in_it() {
        let mut bytes = Vec::new();
        record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
        let (found, inventory) = (closing(&bytes).unwrap(), inventory(&bytes));
        assert_eq!(found.channels, *inventory.channels());
        assert_eq!(found.schemas, *inventory.schemas());
        assert_eq!(found.span, inventory.span());
        assert!(!found.counts.is_empty());
        assert!(found.counts.iter().all(|(&id, &count)| count == inventory.messages(id)));
    }

    #[test]
    fn the_end_of_a_damaged_recording_is_not_believed() {
        let mut bytes = Vec::new();
        record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
        assert_eq!(closing(&bytes[..bytes.len() - 1]), None, "cut off");
        let mut flipped = bytes.clone();
        let at = flipped.len() - 100;
        flipped[at] ^= 1;
        assert_eq!(closing(&flipped), None, "the summary is damaged");
        // Without its third KiB, nothing is where the summary says.
        let shifted = [&bytes[..2048], &bytes[3072..]].concat();
        assert_eq!(closing(&shifted), None, "a piece is missing");
    }
}
