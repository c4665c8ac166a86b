//! A look at the channels of a recording and at their first messages.

use std::cell::Cell;
use std::collections::BTreeMap;

use crate::config::Config;
use crate::imu::{ChannelRole, ImuConfig, Layout, Sensor, header_stamp};
use crate::pipeline::channel_table::Entry;
use crate::pipeline::sources::Sources;
use crate::record::{Channel, Event, Limits, Message};
use crate::run::input::recording::{Recording, Watch};
use crate::run::inspect::rate::Rate;
use crate::{Error, Stamp};

/// Leading bytes of a recording in which first messages are searched (32 MiB).
const HEAD: u64 = 32 << 20;

/// One channel and its use.
#[derive(Debug)]
pub struct Use {
    /// Its record.
    pub channel: Channel,
    /// Name of its schema; empty without one.
    pub schema: String,
    /// Role of the channel.
    pub verdict: ChannelRole,
    /// Number of its messages.
    pub messages: u64,
    /// Stamps that are times of the recording.
    pub stamped: Stamped,
    /// Message rate in Hz, by the median interval of the log times; `None` with too few messages.
    pub hz: Option<f64>,
    /// Observations on its first messages, one line each.
    pub remarks: Vec<String>,
    /// Configuration that would map it, or map it better.
    pub configuration: Option<ImuConfig>,
}

/// Kinds of stamps that lie within an hour of the log time, so that viewers can plot by them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamped {
    /// Stamps of the samples, and so of the annotations.
    pub samples: bool,
    /// `header.stamp` of the messages themselves.
    pub messages: bool,
}

/// Reads a recording from its start until `each` returns `true`, at most `HEAD` bytes.
pub(super) fn head(
    recording: &Recording,
    limits: Limits,
    watch: Watch<'_>,
    mut each: impl FnMut(Event<'_>) -> bool,
) -> Result<(), Error> {
    let enough = Cell::new(false);
    let stop = |enough: &Cell<bool>| {
        enough.set(true);
        Err(Error::Stopped)
    };
    let watch = |done: u64| {
        watch(done)?;
        if done > HEAD { stop(&enough) } else { Ok(()) }
    };
    let mut listener = |event: Event<'_>| if each(event) { stop(&enough) } else { Ok(()) };
    match recording.scan(limits, &watch, &mut listener) {
        Err(Error::Stopped) if enough.get() => Ok(()),
        scanned => scanned.map(drop),
    }
}

/// Channels with their roles and rates, collected from events.
pub(super) struct ChannelLook {
    pub(super) sources: Sources,
    pub(super) rates: BTreeMap<u16, Rate>,
}

impl ChannelLook {
    pub(super) fn new(config: &Config) -> Self {
        Self { sources: Sources::new(config), rates: BTreeMap::new() }
    }

    pub(super) fn take(&mut self, event: Event<'_>) {
        self.sources.take(&event);
        let Event::Message(message) = event else { return };
        self.rates.entry(message.channel).or_default().push(message.log_time);
        if let Some(message) = self.sources.wanted(message) {
            self.sources.intake.message(message.channel, message.log_time, message.data, &mut |_, _, _| {});
        }
    }

    /// The time in a message's header.
    pub(super) fn stamp(&self, message: &Message<'_>) -> Option<Stamp> {
        let Entry { channel, schema } = self.sources.table.get(message.channel)?;
        let layout = Layout::new(&channel.message_encoding, schema).ok();
        header_stamp(&layout.or_else(|| Layout::of_example(&channel.topic, message.data))?, message.data)
    }

    /// Channels by topic, with suggestions made from their names.
    pub(super) fn uses(&self, counts: &BTreeMap<u16, u64>) -> Vec<Use> {
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
