//! Error for a recording in which nothing is used: the existing topics, the reasons, and how to map a topic.

use std::path::Path;

use super::channel_table::Entry;
use super::sources::Sources;
use crate::Error;
use crate::imu::{ChannelRole, ImuConfig, Suggestion};

/// Largest number of topics listed.
const LISTED: usize = 8;

/// Error of a recording in which nothing is used.
pub(crate) fn no_imu(path: &Path, sources: &Sources, obstacles: &[String]) -> Error {
    Error::unfit(path, why_no_imu(sources, obstacles))
}

/// The existing topics, the reasons why they are not used, and how to map one, or the configured topics that are missing.
pub(crate) fn why_no_imu(sources: &Sources, obstacles: &[String]) -> String {
    let topic = |(entry, verdict): (Entry<'_>, &ChannelRole)| {
        let Entry { channel, .. } = entry;
        let kind = if entry.schema_name().is_empty() { &channel.message_encoding } else { entry.schema_name() };
        match verdict {
            ChannelRole::Skipped(why) => format!("{} ({kind}: {why})", channel.topic),
            _ => format!("{} ({kind})", channel.topic),
        }
    };
    let mut topics: Vec<_> = sources.channels().map(topic).collect();
    topics.sort();
    let further = topics.len().saturating_sub(LISTED);
    topics.truncate(LISTED);
    let listed = match (topics.as_slice(), further) {
        ([], _) if obstacles.is_empty() => {
            return "no usable IMU topic: the recording has no topics at all".to_owned();
        }
        ([], _) => {
            let why = obstacles.join("; ");
            return format!("no usable IMU topic: the recording has no topics at all that can be read: {why}");
        }
        (topics, 0) => topics.join(", "),
        (topics, further) => format!("{} and {further} more", topics.join(", ")),
    };
    let missing = sources.missing();
    if !missing.is_empty() {
        return format!("no usable IMU topic among {listed}; {}", missing.join("; "));
    }
    // Where gravity is on a topic of its own, it was mostly removed from the accelerometer.
    let is_gravity = |(entry, _): (Entry<'_>, _)| entry.channel.topic.rsplit('/').next().is_some_and(is_called_gravity);
    let suggested = suggested(sources.channels().map(|(_, verdict)| verdict));
    let suggested = suggested.filter(|_| !sources.channels().any(is_gravity));
    // What cannot be read cannot be mapped.
    let is_skipped = |(_, verdict): (Entry<'_>, &ChannelRole)| matches!(verdict, ChannelRole::Skipped(_));
    if !obstacles.is_empty() && suggested.is_none() || sources.channels().all(is_skipped) {
        let why = if obstacles.is_empty() { String::new() } else { format!(": {}", obstacles.join("; ")) };
        return format!("no usable IMU topic among {listed}{why}; see stillpoint topics");
    }
    let advice = match suggested {
        Some(imu) => format!("add --set '{}' (by its names) if it reads m/s² and rad/s", imu.setting()),
        None => r#"map one with --set 'imu=[{topic="…", accel="…", gyro="…"}]'"#.to_owned(),
    };
    format!("no usable IMU topic among {listed}; {advice}; see stillpoint topics, which also tells the units")
}

fn is_called_gravity(name: &str) -> bool {
    name.eq_ignore_ascii_case("gravity")
}

/// Suggested configuration for a recording in which nothing is used. An IMU is preferred to an accelerometer by itself,
/// one with a gyroscope to one without.
fn suggested<'a>(verdicts: impl Iterator<Item = &'a ChannelRole>) -> Option<ImuConfig> {
    let suggestions = verdicts.filter_map(|verdict| match verdict {
        ChannelRole::Other { suggestion, .. } => suggestion.as_deref(),
        _ => None,
    });
    let worth = |suggestion: &&Suggestion| match suggestion {
        Suggestion::Imu(imu) if imu.gyro.is_some() => 0,
        Suggestion::Imu(_) => 1,
        Suggestion::Accelerometer(_) => 2,
    };
    Some(suggestions.min_by_key(worth)?.config(None))
}
