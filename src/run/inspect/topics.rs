//! Channels of a recording and the use of each. [`remarks`] looks at their first messages.

mod remarks;
mod units;

use self::remarks::peek;
use crate::Error;
use crate::config::Config;
use crate::record::{ClosingSummary, Event};
use crate::run::input::recording::{Recording, Watch, Within};
use crate::run::input::splits::Input;
pub use crate::run::inspect::look::Use;
use crate::run::inspect::look::{ChannelLook, head};
use crate::run::inspect::rate::Rate;

/// The channels of a recording.
#[derive(Debug, Default)]
pub struct Channels {
    /// Channels by topic.
    pub channels: Vec<Use>,
    /// Parts that the configuration names and the recording lacks, one line each.
    pub notes: Vec<String>,
    /// Time from the first to the last message, in seconds.
    pub seconds: f64,
    /// Number of damaged places that were met. A long recording is not read to its end.
    pub damages: u64,
}

impl Channels {
    /// Adds the channels of the next file of the same recording.
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

    /// Message rate of a channel in Hz; `None` with too few messages.
    pub fn rate(&self, of: &Use) -> Option<f64> {
        of.hz.filter(|_| of.messages > 1)
    }
}

/// Length in bytes above which a recording with a usable summary is not read to the end (64 MiB).
const WHOLE: u64 = 64 << 20;

/// Lists the channels of a recording.
///
/// # Errors
///
/// If it cannot be read.
pub fn channels(input: &Input, config: &Config, watch: Watch<'_>) -> Result<Channels, Error> {
    let config = &*input.configured(config);
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

/// Looks through one file: reads all of it if it has at most `whole` bytes or no usable summary.
fn look_through(
    recording: &Recording,
    config: &Config,
    watch: Watch<'_>,
    whole: u64,
) -> Result<(Channels, Span), Error> {
    let (mut look, mut damages) = (ChannelLook::new(config), 0);
    let end = if recording.length() > whole { closing_summary(recording)? } else { None };
    let (counts, span) = match end {
        Some(end) => {
            end.schemas.values().for_each(|schema| look.take(Event::Schema(schema)));
            end.channels.values().for_each(|channel| look.take(Event::Channel(channel)));
            head(recording, config.limits.of_recordings(), watch, |event| {
                look.take(event);
                !look.sources.intake.is_untold()
            })?;
            (end.counts, end.span)
        }
        None => {
            let inventory = recording.scan(config.limits.of_recordings(), watch, &mut |event: Event<'_>| {
                look.take(event);
                Ok(())
            })?;
            damages = inventory.damage();
            let ids = inventory.channels().keys();
            (ids.map(|&id| (id, inventory.messages(id))).collect(), inventory.span())
        }
    };
    let mut channels = look.uses(&counts);
    let (notes, rates) = (look.sources.missing(), look.rates);
    // Before the channels are looked at once more.
    drop(look.sources);
    peek(recording, config, watch, &mut channels)?;
    for used in &mut channels {
        // Of a channel that begins later, in a file that was read completely.
        used.hz = used.hz.or_else(|| rates.get(&used.channel.id).and_then(Rate::hz));
    }
    Ok((Channels { channels, notes, seconds: seconds(span), damages }, span))
}

/// Summary at the end of a recording.
fn closing_summary(recording: &Recording) -> Result<Option<ClosingSummary>, Error> {
    // In a store, each chunk that is looked at is a request.
    let summary = match recording.source().is_object() {
        true => ClosingSummary::of_end(&mut Within(recording), recording.length()),
        false => ClosingSummary::of(&mut Within(recording), recording.length()),
    };
    summary.map_err(Error::reading(recording.path()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::imu::ChannelRole;
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

        // A truncated recording has no summary.
        std::fs::write(&path, &bytes[..bytes.len() * 3 / 4]).unwrap();
        let (cut, whole) = (looked(0), looked(u64::MAX));
        assert_eq!(format!("{cut:?}"), format!("{whole:?}"));
        assert!(cut.seconds < all.seconds);
    }
}
