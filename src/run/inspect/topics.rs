//! What the channels of a recording are, and what each would be used for. What a look at their first messages shows is
//! left to [`remarks`].

mod remarks;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::Path;

use self::remarks::peek;
use crate::Error;
use crate::Stamp;
use crate::config::Config;
use crate::imu::{ChannelRole, ImuConfig, Intake, Layout, Sensor, Suggestion, header_stamp};
use crate::record::{Channel, Event, Message, Schema};
use crate::run::input::recording::{Recording, Watch};
use crate::run::input::splits::Input;
use crate::run::inspect::closing_summary::Glance;

/// The channels of a recording.
#[derive(Debug, Default)]
pub struct Channels {
    /// By topic.
    pub channels: Vec<Use>,
    /// What the configuration names and the recording lacks, one line each.
    pub notes: Vec<String>,
    /// From the first to the last message, in seconds.
    pub seconds: f64,
    /// How many damages were met. A long recording is not read to its end.
    pub damages: u64,
}

/// One channel.
#[derive(Debug)]
pub struct Use {
    /// Its record.
    pub channel: Channel,
    /// Type of its messages; empty without schema.
    pub schema: String,
    /// What it is used for.
    pub verdict: ChannelRole,
    /// Messages on it.
    pub messages: u64,
    /// Whose stamps are times of the recording.
    pub stamped: Stamped,
    /// What its first messages show, one line each.
    pub remarks: Vec<String>,
    /// What would map it, or map it better.
    pub configuration: Option<ImuConfig>,
}

/// Which stamps are within an hour of the log time, so that viewers can plot by them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamped {
    /// Those of the samples, and so of the annotations.
    pub samples: bool,
    /// `header.stamp` of the messages themselves.
    pub messages: bool,
}

impl Channels {
    /// Those of the next file of the same recording, too.
    fn and(mut self, next: Self) -> Self {
        for used in next.channels {
            let same = |known: &&mut Use| known.channel.topic == used.channel.topic && known.schema == used.schema;
            match self.channels.iter_mut().find(same) {
                Some(known) => known.messages += used.messages,
                None => self.channels.push(used),
            }
        }
        self.channels.sort_by(|a, b| (&a.channel.topic, a.channel.id).cmp(&(&b.channel.topic, b.channel.id)));
        self.notes.retain(|note| next.notes.contains(note));
        self.damages += next.damages;
        self
    }

    /// Messages a second on a channel; `None` where there are too few to tell.
    pub fn rate(&self, of: &Use) -> Option<f64> {
        (of.messages > 1 && self.seconds > 0.0).then(|| (of.messages - 1) as f64 / self.seconds)
    }
}

/// What to add to the configuration of a recording in which nothing is used: an IMU rather than an accelerometer by
/// itself, one with a gyroscope rather than one without.
pub(crate) fn suggested<'a>(verdicts: impl Iterator<Item = &'a ChannelRole>) -> Option<ImuConfig> {
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

/// The topics there are, why they are not used, and how to map one, or which ones the configuration names in vain.
pub(crate) fn no_imu<'a>(
    path: &Path,
    missing: &[String],
    channels: impl Iterator<Item = (&'a Channel, &'a ChannelRole, &'a str)> + Clone,
) -> Error {
    const LISTED: usize = 8;
    let topic = |(channel, verdict, kind): (&Channel, &ChannelRole, &'a str)| {
        let kind = if kind.is_empty() { &channel.message_encoding } else { kind };
        match verdict {
            ChannelRole::Skipped(why) => format!("{} ({kind}: {why})", channel.topic),
            _ => format!("{} ({kind})", channel.topic),
        }
    };
    let mut topics: Vec<_> = channels.clone().map(topic).collect();
    topics.sort();
    let further = topics.len().saturating_sub(LISTED);
    topics.truncate(LISTED);
    let listed = match (topics.as_slice(), further) {
        ([], _) => return Error::unfit(path, "no usable IMU topic: the recording has no topics at all"),
        (topics, 0) => topics.join(", "),
        (topics, further) => format!("{} and {further} more", topics.join(", ")),
    };
    if !missing.is_empty() {
        return Error::unfit(path, format!("no usable IMU topic among {listed}; {}", missing.join("; ")));
    }
    let advice = match suggested(channels.map(|(_, verdict, _)| verdict)) {
        Some(imu) => format!("add --set '{}' (by its names) if it reads m/s² and rad/s", imu.setting()),
        None => r#"map one with --set 'imu=[{topic="…", accel="…", gyro="…"}]'"#.to_owned(),
    };
    Error::unfit(
        path,
        format!("no usable IMU topic among {listed}; {advice}; see stillpoint topics, which also tells the units"),
    )
}

/// Recordings of more bytes are not read to the end if they say at the end what is in them (64 MiB).
const WHOLE: u64 = 64 << 20;

/// Bytes of a recording in which the first messages are looked for (32 MiB).
const HEAD: u64 = 32 << 20;

/// Looks through a recording.
///
/// # Errors
///
/// If it cannot be read.
pub fn channels(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Channels, Error> {
    let mut all: Option<(Channels, Span)> = None;
    let mut done = 0;
    for split in &input.splits {
        let (channels, span) = look_through(split, config, &|at| watch(done + at), WHOLE)?;
        all = Some(match all {
            None => (channels, span),
            Some((before, earlier)) => (before.and(channels), earlier.into_iter().chain(span).reduce(cover)),
        });
        done += split.length();
    }
    let (mut channels, span) = all.unwrap_or_default();
    channels.seconds = seconds(span);
    Ok(channels)
}

/// First and last log time, in nanoseconds.
type Span = Option<(u64, u64)>;

fn seconds(span: Span) -> f64 {
    span.map_or(0.0, |(from, until)| (until - from) as f64 * 1e-9)
}

fn cover((from, until): (u64, u64), (start, end): (u64, u64)) -> (u64, u64) {
    (from.min(start), until.max(end))
}

/// Reads all of a file of at most `whole` bytes, or of one that does not say at its end what is in it.
fn look_through(
    recording: &Recording,
    config: &Config,
    watch: Watch<'_>,
    whole: u64,
) -> Result<(Channels, Span), Error> {
    let (mut look, mut damages) = (Look::new(config), 0);
    let glance = if recording.length() > whole { Glance::at(recording)? } else { None };
    let (counts, span) = match glance {
        Some(glance) => {
            look.schemas = glance.schemas;
            glance.channels.values().for_each(|channel| look.channel(channel));
            head(recording, watch, |event| {
                look.take(event);
                !look.channels.iter().any(|channel| look.intake.verdict(channel.id) == &ChannelRole::Untold)
            })?;
            (glance.counts, glance.span)
        }
        None => {
            let inventory = recording.scan(watch, &mut |event: Event<'_>| {
                look.take(event);
                Ok(())
            })?;
            damages = inventory.damage();
            let ids = inventory.channels().keys();
            (ids.map(|&id| (id, inventory.messages(id))).collect(), inventory.span())
        }
    };
    let mut channels = look.uses(&counts);
    peek(recording, config, watch, &mut channels)?;
    let notes = crate::pipeline::learner::missing(&look.intake);
    Ok((Channels { channels, notes, seconds: seconds(span), damages }, span))
}

/// Reads a recording from its start until `each` has seen enough, but not far.
fn head(recording: &Recording, watch: Watch<'_>, mut each: impl FnMut(Event<'_>) -> bool) -> Result<(), Error> {
    let enough = Cell::new(false);
    let stop = |enough: &Cell<bool>| {
        enough.set(true);
        Err(Error::Stopped)
    };
    let watch = |done: u64| {
        watch(done)?;
        if done > HEAD { stop(&enough) } else { Ok(()) }
    };
    match recording.scan(&watch, &mut |event: Event<'_>| if each(event) { stop(&enough) } else { Ok(()) }) {
        Err(Error::Stopped) if enough.get() => Ok(()),
        scanned => scanned.map(drop),
    }
}

/// Learns what the channels are.
struct Look {
    intake: Intake,
    schemas: BTreeMap<u16, Schema>,
    channels: Vec<Channel>,
}

impl Look {
    fn new(config: &Config) -> Self {
        let intake = Intake::new(&config.imu).with_fix_topic(config.fit.fix_topic.clone());
        Self { intake, schemas: BTreeMap::new(), channels: Vec::new() }
    }

    fn take(&mut self, event: Event<'_>) {
        match event {
            Event::Schema(schema) => {
                self.schemas.insert(schema.id, schema.clone());
            }
            Event::Channel(channel) => self.channel(channel),
            Event::Message(message) if self.intake.wants(message.channel) => {
                self.intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
            }
            _ => {}
        }
    }

    fn channel(&mut self, channel: &Channel) {
        if self.channels.iter().all(|known| known.id != channel.id) {
            self.intake.channel(channel, self.schemas.get(&channel.schema_id));
            self.channels.push(channel.clone());
        }
    }

    /// The time in the header of a message.
    fn stamp(&self, message: &Message<'_>) -> Option<Stamp> {
        let channel = self.channels.iter().find(|channel| channel.id == message.channel)?;
        let layout = Layout::new(&channel.message_encoding, self.schemas.get(&channel.schema_id)).ok();
        header_stamp(&layout.or_else(|| Layout::of_example(&channel.topic, message.data))?, message.data)
    }

    /// By topic, with what the names suggest.
    fn uses(&self, counts: &BTreeMap<u16, u64>) -> Vec<Use> {
        let verdicts = self.channels.iter().map(|channel| (channel, self.intake.verdict(channel.id)));
        let primary = verdicts.clone().find(|(_, verdict)| match verdict {
            ChannelRole::Used(uses) => uses.iter().any(|part| part.sensor == Sensor::Accelerometer),
            _ => false,
        });
        let primary = primary.map(|(channel, _)| channel.topic.as_str());
        let uses = verdicts.map(|(channel, verdict)| Use {
            channel: channel.clone(),
            schema: self.schemas.get(&channel.schema_id).map(|schema| schema.name.clone()).unwrap_or_default(),
            verdict: verdict.clone(),
            messages: counts.get(&channel.id).copied().unwrap_or_default(),
            stamped: Stamped::default(),
            remarks: Vec::new(),
            configuration: match verdict {
                ChannelRole::Other { suggestion: Some(suggestion), .. } => Some(suggestion.config(primary)),
                _ => None,
            },
        });
        let mut uses: Vec<_> = uses.collect();
        uses.sort_by(|a, b| (&a.channel.topic, a.channel.id).cmp(&(&b.channel.topic, b.channel.id)));
        uses
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::run::Access;
    use crate::simulate::{Scenario, record};

    #[test]
    fn the_end_of_a_recording_tells_as_much_as_all_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut bytes = Vec::new();
        record(&Scenario::builtin("demo").unwrap(), &mut bytes).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        let looked = |whole| {
            let recording = Recording::open_original(&path, Access::Read).unwrap();
            look_through(&recording, &Config::default(), &|_| Ok(()), whole).unwrap().0
        };
        let (end, all) = (looked(0), looked(u64::MAX));
        assert_eq!(format!("{end:?}"), format!("{all:?}"));
        assert!(all.channels.iter().any(|used| used.messages > 100 && matches!(used.verdict, ChannelRole::Used(_))));

        // What is cut off says nothing at its end.
        std::fs::write(&path, &bytes[..bytes.len() * 3 / 4]).unwrap();
        let (cut, whole) = (looked(0), looked(u64::MAX));
        assert_eq!(format!("{cut:?}"), format!("{whole:?}"));
        assert!(cut.seconds < all.seconds);
    }
}
