//! The channels of a recording, whose splits may each number them anew. What the channels are used for is left to
//! [`Intake`](crate::imu::Intake).

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::record::{Channel, Schema};

/// Gives channels that are the same in several splits one id.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct Roster {
    known: Vec<Known>,
    taken: BTreeSet<u16>,
    /// By their ids in this split; the first split's are everybody's.
    here: Option<BTreeMap<u16, u16>>,
}

/// What tells a channel from others.
#[derive(Debug, Serialize, Deserialize)]
struct Known {
    id: u16,
    topic: String,
    encoding: String,
    schema: Option<(String, String, Vec<u8>)>,
    /// Whether it has been seen in this split.
    seen: bool,
}

impl Roster {
    /// Another split begins.
    pub(crate) fn begin_split(&mut self) {
        self.known.iter_mut().for_each(|known| known.seen = false);
        self.here = Some(BTreeMap::new());
    }

    /// Whether a channel of this split has been [enlisted](Self::enlist).
    pub(crate) fn knows(&self, here: u16) -> bool {
        self.here.as_ref().map_or_else(|| self.taken.contains(&here), |ids| ids.contains_key(&here))
    }

    /// The id in the recording of a channel of this split, which it has been [enlisted](Self::enlist) with.
    pub(crate) fn id(&self, here: u16) -> u16 {
        self.here.as_ref().and_then(|ids| ids.get(&here)).copied().unwrap_or(here)
    }

    /// The channel with its id in the recording, if it is new to the recording.
    pub(crate) fn enlist(&mut self, channel: &Channel, schema: Option<&Schema>) -> Option<Channel> {
        let schema = schema.map(|schema| (schema.name.clone(), schema.encoding.clone(), schema.data.clone()));
        let same = |known: &&mut Known| {
            !known.seen
                && known.topic == channel.topic
                && known.encoding == channel.message_encoding
                && known.schema == schema
        };
        if self.here.is_some()
            && let Some(known) = self.known.iter_mut().find(same)
        {
            known.seen = true;
            let id = known.id;
            self.here.get_or_insert_default().insert(channel.id, id);
            return None;
        }
        // Nobody has 65,536 channels; the last id would be shared.
        let free = std::iter::once(channel.id).chain(0..=u16::MAX).find(|id| !self.taken.contains(id));
        let id = free.unwrap_or(u16::MAX);
        self.taken.insert(id);
        let (topic, encoding) = (channel.topic.clone(), channel.message_encoding.clone());
        self.known.push(Known { id, topic, encoding, schema, seen: true });
        if let Some(here) = &mut self.here {
            here.insert(channel.id, id);
        }
        Some(Channel { id, ..channel.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(id: u16, topic: &str) -> Channel {
        let (topic, message_encoding) = (topic.to_owned(), "cdr".to_owned());
        Channel { id, schema_id: 0, topic, message_encoding, metadata: BTreeMap::new() }
    }

    #[test]
    fn splits_that_number_their_channels_anew_share_ids() {
        let mut roster = Roster::default();
        for (id, topic) in [(1, "/a"), (2, "/b"), (3, "/b")] {
            assert_eq!(roster.enlist(&channel(id, topic), None).map(|channel| channel.id), Some(id));
        }
        roster.begin_split();
        assert!(!roster.knows(3), "it may be another in this split");
        assert_eq!(roster.enlist(&channel(3, "/a"), None), None);
        assert!(roster.knows(3) && !roster.knows(1));
        assert_eq!(roster.enlist(&channel(1, "/b"), None), None);
        assert_eq!(roster.enlist(&channel(2, "/b"), None), None);
        // A third one of that name is another, and its own id is taken.
        assert_eq!(roster.enlist(&channel(4, "/b"), None).map(|channel| channel.id), Some(4));
        assert_eq!(roster.enlist(&channel(7, "/c"), None).map(|channel| channel.id), Some(7));
        assert_eq!([3, 1, 2, 4].map(|here| roster.id(here)), [1, 2, 3, 4]);
        roster.begin_split();
        assert_eq!(roster.enlist(&channel(1, "/d"), None).map(|channel| channel.id), Some(0));
        assert_eq!(roster.id(1), 0);
    }
}
