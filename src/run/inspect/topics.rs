//! What the channels of a recording are, and what each would be used for. What a look at their first messages shows is
//! left to [`remarks`].

mod rate;
mod remarks;

use std::cell::Cell;
use std::collections::BTreeMap;

use self::rate::Rate;
use self::remarks::peek;
use crate::Error;
use crate::Stamp;
use crate::config::Config;
use crate::imu::{ChannelRole, ImuConfig, Layout, Sensor, header_stamp};
use crate::pipeline::channel_table::Entry;
use crate::pipeline::sources::Sources;
use crate::record::{Channel, Event, Message};
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
    /// Messages a second, by the median of their log times; `None` where there are too few to tell.
    pub hz: Option<f64>,
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
        of.hz.filter(|_| of.messages > 1)
    }
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
            glance.schemas.values().for_each(|schema| look.take(Event::Schema(schema)));
            glance.channels.values().for_each(|channel| look.take(Event::Channel(channel)));
            head(recording, watch, |event| {
                look.take(event);
                !look.sources.intake.is_untold()
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
    for used in &mut channels {
        // One that begins later, where all was read.
        used.hz = used.hz.or_else(|| look.rates.get(&used.channel.id).and_then(Rate::hz));
    }
    let notes = look.sources.missing();
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
    sources: Sources,
    rates: BTreeMap<u16, Rate>,
}

impl Look {
    fn new(config: &Config) -> Self {
        Self { sources: Sources::new(config), rates: BTreeMap::new() }
    }

    fn take(&mut self, event: Event<'_>) {
        self.sources.take(&event);
        let Event::Message(message) = event else { return };
        self.rates.entry(message.channel).or_default().push(message.log_time);
        if let Some(message) = self.sources.wanted(message) {
            self.sources.intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
        }
    }

    /// The time in the header of a message.
    fn stamp(&self, message: &Message<'_>) -> Option<Stamp> {
        let Entry { channel, schema, .. } = self.sources.table.get(message.channel)?;
        let layout = Layout::new(&channel.message_encoding, schema.as_ref()).ok();
        header_stamp(&layout.or_else(|| Layout::of_example(&channel.topic, message.data))?, message.data)
    }

    /// By topic, with what the names suggest.
    fn uses(&self, counts: &BTreeMap<u16, u64>) -> Vec<Use> {
        let primary = self.sources.channels().find(|(_, verdict)| match verdict {
            ChannelRole::Used(uses) => uses.iter().any(|part| part.sensor == Sensor::Accelerometer),
            _ => false,
        });
        let primary = primary.map(|(entry, _)| entry.channel.topic.as_str());
        let uses = self.sources.channels().map(|(entry, verdict)| Use {
            channel: entry.channel.clone(),
            schema: entry.schema_name().to_owned(),
            verdict: verdict.clone(),
            messages: counts.get(&entry.channel.id).copied().unwrap_or_default(),
            stamped: Stamped::default(),
            hz: None,
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
