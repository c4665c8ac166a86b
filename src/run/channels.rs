//! What the channels of a recording are, and what each would be used for.

use std::collections::BTreeMap;

use super::recording::{Recording, Watch};
use crate::Error;
use crate::config::Config;
use crate::imu::{ImuConfig, Intake, Suggestion, Verdict};
use crate::record::{Channel, Event};

/// The channels of a recording.
#[derive(Debug)]
pub struct Channels {
    /// By topic.
    pub channels: Vec<Use>,
    /// What the configuration names and the recording lacks, one line each.
    pub notes: Vec<String>,
    /// From the first to the last message, in seconds.
    pub seconds: f64,
}

/// One channel.
#[derive(Debug)]
pub struct Use {
    /// Its record.
    pub channel: Channel,
    /// Type of its messages; empty without schema.
    pub schema: String,
    /// What it is used for.
    pub verdict: Verdict,
    /// Messages on it.
    pub messages: u64,
}

impl Channels {
    /// Messages a second on a channel; `None` where there are too few to tell.
    pub fn rate(&self, of: &Use) -> Option<f64> {
        (of.messages > 1 && self.seconds > 0.0).then(|| (of.messages - 1) as f64 / self.seconds)
    }
}

/// What to add to the configuration of a recording in which nothing is used: an IMU rather than an accelerometer by
/// itself, one with a gyroscope rather than one without.
pub(super) fn suggested<'a>(verdicts: impl Iterator<Item = &'a Verdict>) -> Option<ImuConfig> {
    let suggestions = verdicts.filter_map(|verdict| match verdict {
        Verdict::Other { suggestion, .. } => suggestion.as_deref(),
        _ => None,
    });
    let worth = |suggestion: &&Suggestion| match suggestion {
        Suggestion::Imu(imu) if imu.gyro.is_some() => 0,
        Suggestion::Imu(_) => 1,
        Suggestion::Accelerometer(_) => 2,
    };
    Some(suggestions.min_by_key(worth)?.config(None))
}

/// Looks through a recording.
///
/// # Errors
///
/// If it cannot be read.
pub fn channels(recording: &Recording, config: &Config, watch: Watch<'_>) -> Result<Channels, Error> {
    let mut intake = Intake::new(&config.imu).with_fix_topic(config.fit.fix_topic.clone());
    let mut schemas = BTreeMap::new();
    let mut found = Vec::new();
    let inventory = recording.scan(watch, &mut |event: Event<'_>| {
        match event {
            Event::Schema(schema) => {
                schemas.insert(schema.id, schema.clone());
            }
            Event::Channel(channel) => {
                let schema = schemas.get(&channel.schema_id);
                intake.channel(channel, schema);
                let schema = schema.map(|schema| schema.name.clone()).unwrap_or_default();
                found.push(Use { channel: channel.clone(), schema, verdict: Verdict::Annotation, messages: 0 });
            }
            Event::Message(message) if intake.wants(message.channel) => {
                intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
            }
            _ => {}
        }
        Ok(())
    })?;
    for used in &mut found {
        used.messages = inventory.messages(used.channel.id);
        used.verdict = intake.verdict(used.channel.id).clone();
    }
    found.sort_by(|a, b| (&a.channel.topic, a.channel.id).cmp(&(&b.channel.topic, b.channel.id)));
    let seconds = inventory.span().map_or(0.0, |(from, until)| (until - from) as f64 * 1e-9);
    Ok(Channels { channels: found, notes: super::learn::missing(&intake), seconds })
}
