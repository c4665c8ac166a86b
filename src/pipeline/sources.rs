//! Sources of samples: the channels of a recording, and the intake that reads their messages.

use serde::{Deserialize, Serialize};

use super::channel_table::{ChannelTable, Entry};
use crate::config::Config;
use crate::imu::{ChannelRole, Intake, MissingTopic};
use crate::record::{Event, Message};
use crate::topic::{self, Kind};

/// Channels of a recording, and their use by a configuration.
#[derive(Serialize, Deserialize)]
pub(crate) struct Sources {
    pub(crate) table: ChannelTable,
    pub(crate) intake: Intake,
}

impl Sources {
    pub(crate) fn new(config: &Config) -> Self {
        let intake = Intake::new(&config.imu).with_fix_topic(config.fit.fix_topic.clone());
        let intake = intake.with_heading(config.fit.heading.clone());
        Self { table: ChannelTable::default(), intake }
    }

    /// Adds schemas and channels. Returns a channel that is new to the recording.
    pub(crate) fn take(&mut self, event: &Event<'_>) -> Option<&Entry> {
        let entry = self.table.take(event)?;
        self.intake.channel(&entry.channel, entry.schema.as_ref());
        Some(entry)
    }

    /// Prepares for another split, if one follows.
    pub(crate) fn begin_split(&mut self) {
        self.table.begin_split();
    }

    /// Message of this split with the id that its channel has in the recording; `None` if it is not used.
    pub(crate) fn wanted<'m>(&self, message: Message<'m>) -> Option<Message<'m>> {
        let channel = self.table.get(message.channel)?.channel.id;
        self.intake.wants(channel).then_some(Message { channel, ..message })
    }

    /// Whether these channels of this split are all known and not used.
    pub(crate) fn is_useless(&self, channels: &[u16]) -> bool {
        channels.iter().all(|&here| self.table.get(here).is_some_and(|entry| !self.intake.wants(entry.channel.id)))
    }

    /// All channels so far, and their roles.
    pub(crate) fn channels(&self) -> impl Iterator<Item = (&Entry, &ChannelRole)> + Clone {
        self.table.iter().map(|entry| (entry, self.intake.verdict(entry.channel.id)))
    }

    /// Topics of annotations in the recording itself, as another program leaves them that copies or filters an annotated
    /// one.
    pub(crate) fn annotations(&self) -> impl Iterator<Item = &str> {
        let ours = self.table.iter().filter(|entry| match topic::kind_of(&entry.channel.topic) {
            // It has the schema of its source.
            Some(Kind::Corrected) => true,
            Some(Kind::Log) => matches!(entry.schema_name(), "foxglove.Log" | "rcl_interfaces/msg/Log"),
            Some(_) => entry.schema_name().starts_with("stillpoint"),
            None => false,
        });
        ours.map(|entry| entry.channel.topic.as_str())
    }

    /// Topics that the configuration names and the recording lacks so far, or that are no heading reference, one line each.
    pub(crate) fn missing(&self) -> Vec<String> {
        let line = |missing: MissingTopic| {
            let nearest = missing.nearest.map(|name| format!("; did you mean {name}?")).unwrap_or_default();
            format!("{}: configured, but the recording has no such topic{nearest}", missing.topic)
        };
        self.intake.missing_topics().into_iter().map(line).chain(self.intake.heading_fault()).collect()
    }
}
