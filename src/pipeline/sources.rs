//! Sources of samples: the channels of a recording, and the intake that reads their messages.

use std::collections::BTreeSet;

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
        let intake =
            Intake::new(&config.imu).with_most(config.limits.imus).with_fix_topic(config.fit.fix_topic.clone());
        let intake = intake.with_heading(config.fit.heading.clone());
        Self { table: ChannelTable::default(), intake }
    }

    /// Adds schemas and channels. Returns a channel that is new to the recording.
    pub(crate) fn take(&mut self, event: &Event<'_>) -> Option<Entry<'_>> {
        let entry = self.table.take(event)?;
        self.intake.channel(entry.channel, entry.schema);
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
    pub(crate) fn channels(&self) -> impl Iterator<Item = (Entry<'_>, &ChannelRole)> + Clone {
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
        self.lacking().chain(self.intake.heading_fault()).collect()
    }

    fn lacking(&self) -> impl Iterator<Item = String> {
        let line = |missing: MissingTopic| {
            let nearest = missing.nearest.map(|name| format!("; did you mean {name}?")).unwrap_or_default();
            format!("{}: configured, but the recording has no such topic{nearest}", missing.topic)
        };
        self.intake.missing_topics().into_iter().map(line)
    }

    /// The same, each with the topics that there are instead.
    pub(crate) fn missing_among(&self) -> Vec<String> {
        /// Most topics that are listed.
        const LISTED: usize = 8;
        let names = self.channels().map(|(entry, _)| entry.channel.topic.as_str());
        let names: BTreeSet<_> = names.filter(|name| !topic::is_annotation(name)).collect();
        let listed: Vec<_> = names.iter().take(LISTED).copied().collect();
        let further = names.len().saturating_sub(listed.len());
        let further = if further > 0 { format!(" and {further} more") } else { String::new() };
        let there = format!("{}{further}", listed.join(", "));
        let line = |missing: String| match missing.ends_with('?') {
            _ if there.is_empty() => missing,
            true => format!("{missing} It has {there}"),
            false => format!("{missing}; it has {there}"),
        };
        self.lacking().map(line).chain(self.intake.heading_fault()).collect()
    }
}
