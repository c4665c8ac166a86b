//! Channel table: each channel of a recording under one id with its schema, although splits may number channels anew.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::record::{Channel, Event, Schema};

/// Channels met so far, from the schema and channel records of a scan.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct ChannelTable {
    /// Channels in the order in which they were met.
    rows: Vec<Row>,
    /// Schemas of the channels, each once in a split however many channels share it.
    used: Vec<Schema>,
    /// Indices of the used schemas, by the ids of this split.
    used_here: BTreeMap<u16, usize>,
    /// Schemas of this split.
    schemas: BTreeMap<u16, Schema>,
    /// Indices of the rows, by the ids of this split.
    here: BTreeMap<u16, usize>,
    /// Indices of the rows, by the ids in the recording and by topic.
    by_id: BTreeMap<u16, usize>,
    by_topic: BTreeMap<String, Vec<usize>>,
    /// All ids below are taken.
    lowest: u16,
    /// Whether there were earlier splits, whose channels may occur again.
    continued: bool,
}

/// A channel, with its id in the recording.
#[derive(Debug, Serialize, Deserialize)]
struct Row {
    channel: Channel,
    /// Index of its schema.
    schema: Option<usize>,
    /// Whether it has been met in this split.
    met: bool,
}

/// A channel, with its id in the recording, and its schema.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry<'t> {
    pub(crate) channel: &'t Channel,
    pub(crate) schema: Option<&'t Schema>,
}

impl<'t> Entry<'t> {
    /// Type name of its messages; empty without schema.
    pub(crate) fn schema_name(&self) -> &'t str {
        self.schema.map_or("", |schema| &schema.name)
    }

    /// Whether it equals a channel of another split, apart from the ids.
    fn is(&self, channel: &Channel, schema: Option<&Schema>) -> bool {
        fn definition(schema: &Schema) -> (&str, &str, &[u8]) {
            (&schema.name, &schema.encoding, &schema.data)
        }
        self.channel.topic == channel.topic
            && self.channel.message_encoding == channel.message_encoding
            && self.schema.map(definition) == schema.map(definition)
    }
}

impl ChannelTable {
    /// Adds the schema or channel of a scan event. Returns a channel that is new to the recording.
    pub(crate) fn take(&mut self, event: &Event<'_>) -> Option<Entry<'_>> {
        match event {
            Event::Schema(schema) => {
                self.schemas.insert(schema.id, (*schema).clone());
                None
            }
            Event::Channel(channel) => self.enlist(channel),
            _ => None,
        }
    }

    /// Prepares for another split, if one follows.
    pub(crate) fn begin_split(&mut self) {
        self.schemas.clear();
        self.used_here.clear();
        self.here.clear();
        self.rows.iter_mut().for_each(|row| row.met = false);
        self.continued = true;
    }

    /// Channel with this id in this split, if it has been met.
    pub(crate) fn get(&self, here: u16) -> Option<Entry<'_>> {
        self.at(*self.here.get(&here)?)
    }

    /// Channel with this id in the recording.
    pub(crate) fn by_id(&self, id: u16) -> Option<Entry<'_>> {
        self.at(*self.by_id.get(&id)?)
    }

    /// All channels of the recording so far.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Entry<'_>> + Clone {
        self.rows.iter().map(|row| self.entry(row))
    }

    fn at(&self, place: usize) -> Option<Entry<'_>> {
        self.rows.get(place).map(|row| self.entry(row))
    }

    fn entry<'t>(&'t self, row: &'t Row) -> Entry<'t> {
        Entry { channel: &row.channel, schema: row.schema.and_then(|place| self.used.get(place)) }
    }

    fn enlist(&mut self, channel: &Channel) -> Option<Entry<'_>> {
        if self.here.contains_key(&channel.id) {
            return None;
        }
        let schema = self.schemas.get(&channel.schema_id);
        let alike = self.by_topic.get(&channel.topic).filter(|_| self.continued);
        let is_same =
            |&&place: &&usize| self.rows.get(place).is_some_and(|row| !row.met && self.entry(row).is(channel, schema));
        if let Some(&place) = alike.into_iter().flatten().find(is_same) {
            self.rows.get_mut(place)?.met = true;
            self.here.insert(channel.id, place);
            return None;
        }
        let schema = schema.map(|schema| {
            *self.used_here.entry(schema.id).or_insert_with(|| {
                self.used.push(schema.clone());
                self.used.len() - 1
            })
        });
        let (id, place) = (self.free_id(channel.id), self.rows.len());
        self.here.insert(channel.id, place);
        self.by_id.entry(id).or_insert(place);
        self.by_topic.entry(channel.topic.clone()).or_default().push(place);
        self.rows.push(Row { channel: Channel { id, ..channel.clone() }, schema, met: true });
        self.at(place)
    }

    /// Returns this id, or the lowest free one if it is taken. With 65,536 channels the last id would be shared.
    fn free_id(&mut self, wanted: u16) -> u16 {
        if !self.by_id.contains_key(&wanted) {
            return wanted;
        }
        while self.lowest < u16::MAX && self.by_id.contains_key(&self.lowest) {
            self.lowest += 1;
        }
        self.lowest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meet(table: &mut ChannelTable, id: u16, topic: &str) -> Option<u16> {
        let (topic, message_encoding) = (topic.to_owned(), "cdr".to_owned());
        let channel = Channel { id, schema_id: 0, topic, message_encoding, metadata: BTreeMap::new() };
        table.take(&Event::Channel(&channel)).map(|entry| entry.channel.id)
    }

    fn id(table: &ChannelTable, here: u16) -> Option<u16> {
        table.get(here).map(|entry| entry.channel.id)
    }

    #[test]
    fn splits_that_number_their_channels_anew_share_ids() {
        let mut table = ChannelTable::default();
        for (id, topic) in [(1, "/a"), (2, "/b"), (3, "/b")] {
            assert_eq!(meet(&mut table, id, topic), Some(id));
        }
        table.begin_split();
        assert_eq!(id(&table, 3), None, "it may be another in this split");
        assert_eq!(meet(&mut table, 3, "/a"), None);
        assert_eq!((id(&table, 3), id(&table, 1)), (Some(1), None));
        assert_eq!(meet(&mut table, 1, "/b"), None);
        assert_eq!(meet(&mut table, 2, "/b"), None);
        // A third one of that name is another channel, and gets its own id.
        assert_eq!(meet(&mut table, 4, "/b"), Some(4));
        assert_eq!(meet(&mut table, 7, "/c"), Some(7));
        assert_eq!([3, 1, 2, 4].map(|here| id(&table, here)), [1, 2, 3, 4].map(Some));
        table.begin_split();
        assert_eq!(meet(&mut table, 1, "/d"), Some(0));
        assert_eq!(id(&table, 1), Some(0));
    }

    #[test]
    fn a_channel_of_the_same_name_and_another_schema_is_another() {
        let mut table = ChannelTable::default();
        let schema = |data: &[u8]| Schema { id: 5, name: "T".into(), encoding: "ros2msg".into(), data: data.to_vec() };
        let channel = |id| Channel {
            id,
            schema_id: 5,
            topic: "/a".to_owned(),
            message_encoding: "cdr".to_owned(),
            metadata: BTreeMap::new(),
        };
        table.take(&Event::Schema(&schema(b"int8 x")));
        assert!(table.take(&Event::Channel(&channel(1))).is_some());
        table.begin_split();
        table.take(&Event::Schema(&schema(b"int8 y")));
        assert_eq!(table.take(&Event::Channel(&channel(1))).map(|entry| entry.channel.id), Some(0));
        assert_eq!(table.iter().map(|entry| entry.schema_name()).collect::<Vec<_>>(), ["T", "T"]);
    }

    #[test]
    fn channels_that_share_a_schema_keep_it_once_in_a_split() {
        let mut table = ChannelTable::default();
        let schema = Schema { id: 5, name: "T".into(), encoding: "ros2msg".into(), data: vec![b'x'; 1000] };
        for split in 0..2 {
            table.take(&Event::Schema(&schema));
            for id in 0..100 {
                let (topic, message_encoding) = (format!("/{split}/{id}"), "cdr".to_owned());
                let channel = Channel { id, schema_id: 5, topic, message_encoding, metadata: BTreeMap::new() };
                table.take(&Event::Channel(&channel));
            }
            table.begin_split();
        }
        assert_eq!((table.rows.len(), table.used.len()), (200, 2));
        assert!(table.iter().all(|entry| entry.schema == Some(&schema)));
    }
}
