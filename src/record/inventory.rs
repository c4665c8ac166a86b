//! Contents of a recording, as far as folding needs them. Collected by [`Scan`](super::Scan), used by
//! [`Fold`](super::Fold).

use std::collections::BTreeSet;
use std::collections::btree_map::{BTreeMap, Entry};
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::chunk_check::ChunkCheck;
use super::limits::Limits;
use super::marks::{INDEXES, METADATA, TAIL};
use super::records::{AttachmentIndex, Header, MetadataIndex};
use super::summary::Summary;
use super::{Channel, Schema};

/// Contents of a recording: its whole records, their places and counts.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Inventory {
    pub(super) summary: Summary,
    pub(super) header: Option<Header>,
    /// Offset of the end of the last whole record before DataEnd.
    pub(super) prefix: u64,
    /// CRC in the DataEnd record, if there is one.
    pub(super) data_crc: Option<u32>,
    pub(super) damage: u64,
    pub(super) finished: bool,
    pub(super) loose: bool,
    /// Whether the recorder wrote a chunk with messages and no message indexes.
    pub(super) unindexed: bool,
    /// Channels that message indexes or rejected messages mention: their ids are in use although the records that
    /// define them are lost.
    pub(super) mentioned: BTreeSet<u16>,
    pub(super) summary_only: SummaryOnly,
    /// Memory of the schemas and channels, in bytes.
    defined: u64,
    /// Memory of the places of attachments and metadata records, in bytes, and whether there was none for some.
    placed: u64,
    unplaced: bool,
    /// Total decompressed size of the compressed chunks, in bytes.
    pub(super) opened: u64,
    /// Unused byte ranges, in order, none touching another.
    pub(super) lost: Vec<Range<u64>>,
}

/// Ids that only the summary section defines.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct SummaryOnly {
    pub(super) schemas: Vec<u16>,
    pub(super) channels: Vec<u16>,
}

/// Place of an attachment or metadata record.
pub(super) enum NamedRecord {
    Attachment(AttachmentIndex),
    Metadata(MetadataIndex),
}

/// Result of learning a schema or channel record.
pub(super) enum Learned {
    New,
    Known,
    /// Another record with the same id differs.
    Contradicted,
}

impl Inventory {
    /// Profile in the recording's header: `ros2`, for instance. Empty if there is none.
    pub fn profile(&self) -> &str {
        self.header.as_ref().map_or("", |header| &header.profile)
    }

    /// Program that wrote the recording, according to its header.
    pub fn library(&self) -> &str {
        self.header.as_ref().map_or("", |header| &header.library)
    }

    /// All schemas, by id.
    pub fn schemas(&self) -> &BTreeMap<u16, Schema> {
        &self.summary.schemas
    }

    /// All channels, by id.
    pub fn channels(&self) -> &BTreeMap<u16, Channel> {
        &self.summary.channels
    }

    /// Number of messages on a channel.
    pub fn messages(&self, channel: u16) -> u64 {
        self.summary.counts.get(&channel).copied().unwrap_or_default()
    }

    /// First and last log time, in nanoseconds; `None` without messages.
    pub fn span(&self) -> Option<(u64, u64)> {
        self.summary.span
    }

    /// Length in bytes of the part that an annotated recording begins with: through the last whole record before
    /// DataEnd. With messages outside chunks, where readers go from record to record for lack of an index, it ends
    /// before the first damage.
    pub fn prefix(&self) -> u64 {
        self.lost.first().map(|lost| lost.start).filter(|&lost| self.loose && lost < self.prefix).unwrap_or(self.prefix)
    }

    /// Ranges of whole records after the prefix, where that ends early. Attachments and metadata that are named like
    /// ours are left out, since they would be taken for ours.
    pub(super) fn take_recovered(&mut self) -> Vec<Range<u64>> {
        let (mut from, until) = (self.prefix(), self.prefix);
        let (attachments, metadata) = (&mut self.summary.attachments, &mut self.summary.metadata);
        let attached =
            attachments.extract_if(.., |entry| entry.offset >= from && matches!(&*entry.name, TAIL | INDEXES));
        let mut lost: Vec<_> = attached.map(|entry| entry.offset..entry.offset + entry.length).collect();
        let noted = metadata.extract_if(.., |entry| entry.offset >= from && entry.name == METADATA);
        lost.extend(noted.map(|entry| entry.offset..entry.offset + entry.length));
        lost.extend(std::mem::take(&mut self.lost));
        lost.push(until..until);
        lost.sort_unstable_by_key(|lost| lost.start);
        let mut recovered = Vec::new();
        for lost in lost.into_iter().take_while(|lost| lost.start <= until) {
            if from < lost.start {
                recovered.push(from..lost.start);
            }
            from = lost.end.max(from);
        }
        recovered
    }

    /// Notes that these bytes are not used.
    pub(super) fn lose(&mut self, range: Range<u64>) {
        match self.lost.last_mut() {
            Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
            _ => self.lost.push(range),
        }
    }

    /// Number of damages found.
    pub fn damage(&self) -> u64 {
        self.damage
    }

    /// Whether the recorder finished the recording: its footer and closing magic are there.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// Whether there are messages outside chunks.
    pub fn has_loose_messages(&self) -> bool {
        self.loose
    }

    /// Whether the recording was cut off after its magic.
    pub(super) fn is_bare(&self) -> bool {
        self.prefix() == mcap::MAGIC.len() as u64
    }

    /// Whether the recorder wrote chunks without any message index.
    pub(super) fn has_no_message_indexes(&self) -> bool {
        self.unindexed && self.mentioned.is_empty()
    }

    /// Adds placeholders for schemas and channels that are used although their records are lost. Otherwise readers
    /// refuse a recording whose index leads to them.
    pub(super) fn complete(&mut self) {
        let Summary { schemas, channels, counts, .. } = &mut self.summary;
        for &id in counts.keys().filter(|id| !channels.contains_key(id)).collect::<Vec<_>>() {
            let topic = format!("unknown channel {id}");
            let (message_encoding, metadata) = (String::new(), BTreeMap::new());
            channels.insert(id, Channel { id, schema_id: 0, topic, message_encoding, metadata });
            self.summary_only.channels.push(id);
        }
        for id in channels.values().map(|channel| channel.schema_id).filter(|&id| id != 0) {
            if let Entry::Vacant(lost) = schemas.entry(id) {
                let name = format!("unknown schema {id}");
                lost.insert(Schema { id, name, encoding: String::new(), data: Vec::new() });
                self.summary_only.schemas.push(id);
            }
        }
    }

    /// CRC of the prefix, if the recorder computed one and no damage was found.
    pub(super) fn prefix_crc(&self) -> Option<u32> {
        self.data_crc.filter(|&crc| crc != 0 && self.damage == 0)
    }

    /// Counts the messages of a survey.
    pub(super) fn count(&mut self, survey: &ChunkCheck) {
        for (&channel, tally) in &survey.tallies {
            self.summary.count(channel, tally.count);
        }
        if let Some(span) = survey.span {
            self.summary.cover(span);
        }
    }

    /// Counts the messages that the index of an unread chunk names.
    pub(super) fn count_unread(&mut self, channel: u16, count: u64, span: Option<(u64, u64)>) {
        if let Some(span) = span {
            self.summary.count(channel, count);
            self.summary.cover(span);
        }
    }

    /// Whether there were chunks so far.
    pub(super) fn has_chunks(&self) -> bool {
        self.summary.chunks > 0
    }

    /// Reason why these records exceed the limits on definitions; `None` if they do not.
    pub(super) fn refuses(&self, survey: &ChunkCheck, limits: &Limits) -> Option<String> {
        let Summary { schemas, channels, .. } = &self.summary;
        let new =
            survey.schemas.iter().filter(|schema| !schemas.contains_key(&schema.id)).map(Schema::size).sum::<u64>()
                + survey
                    .channels
                    .iter()
                    .filter(|channel| !channels.contains_key(&channel.id))
                    .map(Channel::size)
                    .sum::<u64>();
        let ids: BTreeSet<u16> = survey.channels.iter().map(|channel| channel.id).collect();
        self.exceeds(new, ids.iter().filter(|id| !channels.contains_key(id)).count() as u64, limits)
    }

    /// Reason why a schema of the summary exceeds the limits; `None` if it does not, or is known.
    pub(super) fn refuses_schema(&self, schema: &Schema, limits: &Limits) -> Option<String> {
        let new = if self.summary.schemas.contains_key(&schema.id) { 0 } else { schema.size() };
        self.exceeds(new, 0, limits)
    }

    /// Reason why a channel of the summary exceeds the limits; `None` if it does not, or is known.
    pub(super) fn refuses_channel(&self, channel: &Channel, limits: &Limits) -> Option<String> {
        let is_known = self.summary.channels.contains_key(&channel.id);
        let (new, more) = if is_known { (0, 0) } else { (channel.size(), 1) };
        self.exceeds(new, more, limits)
    }

    /// Reason why new definitions of this size, so many channels among them, exceed the limits.
    fn exceeds(&self, size: u64, channels: u64, limits: &Limits) -> Option<String> {
        let Limits { definitions, channels: most, .. } = *limits;
        if size > 0 && size.saturating_add(self.defined) > definitions {
            let what = "schemas and channels of more than";
            return Some(format!("{what} {definitions} bytes: no more are used (limits.definitions_mib)"));
        }
        (channels > 0 && self.summary.channels.len() as u64 + channels > most)
            .then(|| format!("more than {most} channels: no more are used (limits.channels)"))
    }

    /// Whether the summary repeats a schema of the data.
    pub(super) fn has_schema(&self, schema: &Schema) -> bool {
        self.summary.schemas.get(&schema.id) == Some(schema)
    }

    /// Whether the summary repeats a channel of the data.
    pub(super) fn has_channel(&self, channel: &Channel) -> bool {
        self.summary.channels.get(&channel.id) == Some(channel)
    }

    /// Keeps the place of an attachment or metadata record. Returns what to say of the first one for which there is no room.
    pub(super) fn place(&mut self, record: NamedRecord, limits: &Limits) -> Option<String> {
        let (size, name) = match &record {
            NamedRecord::Attachment(index) => {
                (size_of_val(index) + index.name.len() + index.media_type.len(), &index.name)
            }
            NamedRecord::Metadata(index) => (size_of_val(index) + index.name.len(), &index.name),
        };
        // Those by which an annotated recording is recognised come last, and are few.
        let most = match name.as_str() {
            TAIL | INDEXES | METADATA => limits.attachments.saturating_mul(2),
            _ => limits.attachments,
        };
        if self.placed + size as u64 > most {
            return (!std::mem::replace(&mut self.unplaced, true)).then(|| {
                format!(
                    "places of attachments and metadata records of more than {} bytes: further ones are not indexed \
                     (limits.attachments_mib)",
                    limits.attachments
                )
            });
        }
        self.placed += size as u64;
        match record {
            NamedRecord::Attachment(index) => self.summary.attachments.push(index),
            NamedRecord::Metadata(index) => self.summary.metadata.push(index),
        }
        None
    }

    /// Total decompressed size of the compressed chunks, in bytes.
    pub fn opened(&self) -> u64 {
        self.opened
    }

    pub(super) fn learn_schema(&mut self, schema: Schema) -> Learned {
        let size = schema.size();
        let learned = learn(&mut self.summary.schemas, schema.id, schema);
        self.defined += if matches!(learned, Learned::New) { size } else { 0 };
        learned
    }

    pub(super) fn learn_channel(&mut self, channel: Channel) -> Learned {
        let size = channel.size();
        let learned = learn(&mut self.summary.channels, channel.id, channel);
        self.defined += if matches!(learned, Learned::New) { size } else { 0 };
        learned
    }
}

fn learn<T: PartialEq>(known: &mut BTreeMap<u16, T>, id: u16, record: T) -> Learned {
    match known.get(&id) {
        None => {
            known.insert(id, record);
            Learned::New
        }
        Some(before) if *before == record => Learned::Known,
        Some(_) => Learned::Contradicted,
    }
}
