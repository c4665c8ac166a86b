//! What a recorder says at the end of a recording: its channels and how many messages each has, without reading the
//! data. Trusted only where its CRC holds and the chunks are where it says; else the data must be read.

use std::collections::BTreeMap;
use std::io::SeekFrom;

use mcap::records::Statistics;
use mcap::sans_io::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};

use crate::Error;
use crate::record::{Channel, Schema};
use crate::run::input::recording::Recording;

/// The end of a recording.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Glance {
    pub(crate) schemas: BTreeMap<u16, Schema>,
    pub(crate) channels: BTreeMap<u16, Channel>,
    /// Messages by channel.
    pub(crate) counts: BTreeMap<u16, u64>,
    /// First and last log time, in nanoseconds.
    pub(crate) span: Option<(u64, u64)>,
}

/// A summary of more is in no recording.
const LIMIT: u64 = 256 << 20;

/// Opcode and length in front of a record.
const FRAME: u64 = 9;

/// The footer's fields and the magic behind them.
const FOOTER: usize = 20 + mcap::MAGIC.len();

impl Glance {
    /// Looks at the end of a recording; none if that is not there, not whole, or does not fit the rest.
    ///
    /// # Errors
    ///
    /// If the system refuses.
    pub(crate) fn at(recording: &Recording) -> Result<Option<Self>, Error> {
        if !holds(recording)? {
            return Ok(None);
        }
        let Some(summary) = summary(recording)? else { return Ok(None) };
        let Some(Statistics { message_count, channel_message_counts: counts, .. }) = &summary.stats else {
            return Ok(None);
        };
        let known = counts.keys().all(|id| summary.channels.contains_key(id));
        if !known || counts.values().sum::<u64>() != *message_count || summary.chunk_indexes.is_empty() {
            return Ok(None);
        }
        let mut span: Option<(u64, u64)> = None;
        for chunk in &summary.chunk_indexes {
            let mut frame = [0; FRAME as usize];
            let end = chunk.chunk_start_offset.checked_add(chunk.chunk_length);
            if end.is_none_or(|end| end > recording.length()) || chunk.chunk_length < FRAME {
                return Ok(None);
            }
            recording.read_exact_at(&mut frame, chunk.chunk_start_offset)?;
            let [opcode, length @ ..] = frame;
            if opcode != mcap::records::op::CHUNK || u64::from_le_bytes(length) != chunk.chunk_length - FRAME {
                return Ok(None);
            }
            if chunk.message_start_time != 0 || chunk.message_end_time != 0 {
                let (from, until) = span.unwrap_or((u64::MAX, 0));
                span = Some((from.min(chunk.message_start_time), until.max(chunk.message_end_time)));
            }
        }
        let schemas = summary.schemas.values().map(|schema| {
            let (name, encoding, data) = (schema.name.clone(), schema.encoding.clone(), schema.data.to_vec());
            (schema.id, Schema { id: schema.id, name, encoding, data })
        });
        let channels = summary.channels.values().map(|channel| {
            let channel = Channel {
                id: channel.id,
                schema_id: channel.schema.as_ref().map_or(0, |schema| schema.id),
                topic: channel.topic.clone(),
                message_encoding: channel.message_encoding.clone(),
                metadata: channel.metadata.clone(),
            };
            (channel.id, channel)
        });
        Ok(Some(Self { schemas: schemas.collect(), channels: channels.collect(), counts: counts.clone(), span }))
    }
}

/// Whether there is a summary, and its CRC holds.
fn holds(recording: &Recording) -> Result<bool, Error> {
    let length = recording.length();
    let mut end = [0; FOOTER];
    let Some(footer) = length.checked_sub(FOOTER as u64) else { return Ok(false) };
    recording.read_exact_at(&mut end, footer)?;
    let Some((&[a, b, c, d, e, f, g, h], rest)) = end.split_first_chunk() else { return Ok(false) };
    let start = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
    let Some((&crc, magic)) = rest.get(8..).and_then(|rest| rest.split_first_chunk()) else { return Ok(false) };
    let covered = start..length - mcap::MAGIC.len() as u64 - 4;
    if magic != mcap::MAGIC || start == 0 || covered.is_empty() || covered.end - covered.start > LIMIT {
        return Ok(false);
    }
    let mut computed = crc32fast::Hasher::new();
    recording.read(covered, &|_| Ok(()), |bytes| computed.update(bytes))?;
    Ok(u32::from_le_bytes(crc) == computed.finalize())
}

fn summary(recording: &Recording) -> Result<Option<mcap::Summary>, Error> {
    let options =
        SummaryReaderOptions::default().with_file_size(recording.length()).with_record_length_limit(LIMIT as usize);
    let mut reader = SummaryReader::new_with_options(options);
    let mut at = 0_u64;
    while let Some(event) = reader.next_event() {
        match event {
            Err(_) => return Ok(None),
            Ok(SummaryReadEvent::SeekRequest(to)) => {
                at = match to {
                    SeekFrom::Start(offset) => offset,
                    SeekFrom::End(offset) => recording.length().saturating_add_signed(offset),
                    SeekFrom::Current(offset) => at.saturating_add_signed(offset),
                };
                reader.notify_seeked(at);
            }
            Ok(SummaryReadEvent::ReadRequest(wanted)) => {
                let length = recording.length().saturating_sub(at).min(wanted as u64) as usize;
                recording.read_exact_at(reader.insert(length), at)?;
                reader.notify_read(length);
                at += length as u64;
            }
        }
    }
    Ok(reader.finish())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::run::Access;
    use crate::simulate::{Scenario, record};

    /// What the end of a file says, and what is in it.
    fn glance(bytes: &[u8]) -> (Option<Glance>, crate::record::Inventory) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        std::fs::write(&path, bytes).unwrap();
        let recording = Recording::open_original(&path, Access::Read).unwrap();
        (
            Glance::at(&recording).unwrap(),
            recording.scan(&|_| Ok(()), &mut |_: crate::record::Event<'_>| Ok(())).unwrap(),
        )
    }

    #[test]
    fn the_end_of_a_whole_recording_says_what_is_in_it() {
        let mut bytes = Vec::new();
        record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
        let (found, inventory) = glance(&bytes);
        let found = found.unwrap();
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
        assert_eq!(glance(&bytes[..bytes.len() - 1]).0, None, "cut off");
        let mut flipped = bytes.clone();
        let at = flipped.len() - 100;
        flipped[at] ^= 1;
        assert_eq!(glance(&flipped).0, None, "the summary is damaged");
        // Without its third kilobyte, nothing stands where the summary says.
        let shifted = [&bytes[..2048], &bytes[3072..]].concat();
        assert_eq!(glance(&shifted).0, None, "a piece is missing");
    }
}
