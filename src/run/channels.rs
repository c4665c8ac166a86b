//! What the channels of a recording are, what each would be used for, and what a look at their first messages shows.

use std::cell::Cell;
use std::collections::BTreeMap;

use super::glance::Glance;
use super::input::Input;
use super::recording::{Recording, Watch};
use crate::Error;
use crate::config::Config;
use crate::imu::{AccelUnit, ImuConfig, Intake, Looks, Peek, Reading, Relation, Sensor, Suggestion, Verdict};
use crate::record::{Channel, Event, Schema};

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
    pub verdict: Verdict,
    /// Messages on it.
    pub messages: u64,
    /// What its first messages show, one line each.
    pub remarks: Vec<String>,
    /// What would map it, or map it better.
    pub configuration: Option<ImuConfig>,
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
                !look.channels.iter().any(|channel| look.intake.verdict(channel.id) == &Verdict::Untold)
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
    let notes = super::learn::missing(&look.intake);
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

    /// By topic, with what the names suggest.
    fn uses(&self, counts: &BTreeMap<u16, u64>) -> Vec<Use> {
        let verdicts = self.channels.iter().map(|channel| (channel, self.intake.verdict(channel.id)));
        let primary = verdicts.clone().find(|(_, verdict)| match verdict {
            Verdict::Used(uses) => uses.iter().any(|part| part.sensor == Sensor::Accelerometer),
            _ => false,
        });
        let primary = primary.map(|(channel, _)| channel.topic.as_str());
        let uses = verdicts.map(|(channel, verdict)| Use {
            channel: channel.clone(),
            schema: self.schemas.get(&channel.schema_id).map(|schema| schema.name.clone()).unwrap_or_default(),
            verdict: verdict.clone(),
            messages: counts.get(&channel.id).copied().unwrap_or_default(),
            remarks: Vec::new(),
            configuration: match verdict {
                Verdict::Other { suggestion: Some(suggestion), .. } => Some(suggestion.config(primary)),
                _ => None,
            },
        });
        let mut uses: Vec<_> = uses.collect();
        uses.sort_by(|a, b| (&a.channel.topic, a.channel.id).cmp(&(&b.channel.topic, b.channel.id)));
        uses
    }
}

/// The first readings of one triad.
struct Peeked {
    topic: String,
    imu: usize,
    sensor: Sensor,
    peek: Peek,
}

/// Looks at the first messages, those of suggested topics as if they were mapped, and remarks on what they show.
fn peek(recording: &Recording, config: &Config, watch: Watch<'_>, channels: &mut [Use]) -> Result<(), Error> {
    let suggested = channels.iter().filter_map(|used| used.configuration.clone());
    let imus: Vec<_> = config.imu.iter().cloned().chain(suggested).collect();
    let mut look = Look::new(&Config { imu: imus, ..config.clone() });
    let mut peeks: BTreeMap<(usize, usize), (Sensor, Peek)> = BTreeMap::new();
    head(recording, watch, |event| {
        let Event::Message(message) = event else {
            look.take(event);
            return false;
        };
        look.intake.message(message.channel, message.log_time, message.data, &mut |imu, sensor, reading| {
            if let Reading::Sample(sample) = reading {
                peeks.entry((imu.index(), sensor.index())).or_insert((sensor, Peek::default())).1.push(sample);
            }
        });
        // A topic that begins later is not waited for.
        !peeks.is_empty() && peeks.values().all(|(_, peek)| !peek.wants_more())
    })?;
    let named = peeks.into_iter().filter_map(|((imu, _), (sensor, peek))| {
        let triads = &look.intake.imus().get(imu)?.triads;
        let topic = triads.iter().find(|triad| triad.sensor == sensor)?.topic.clone();
        Some(Peeked { topic, imu, sensor, peek })
    });
    let peeks: Vec<_> = named.collect();
    peeks.iter().for_each(|peeked| remark_on_unit(peeked, config, channels));
    let accelerometers = peeks.iter().filter(|peeked| peeked.sensor == Sensor::Accelerometer);
    for (i, one) in accelerometers.clone().enumerate() {
        for other in accelerometers.clone().skip(i + 1).filter(|other| other.imu != one.imu) {
            if let Some(relation) = one.peek.relation(&other.peek) {
                remark_on_twins(&one.topic, &other.topic, relation, channels);
            }
        }
    }
    Ok(())
}

/// Says in which unit a triad seems to be, and puts it into the configuration that is offered.
fn remark_on_unit(Peeked { topic, sensor, peek, .. }: &Peeked, config: &Config, channels: &mut [Use]) {
    let Some(rest) = peek.at_rest() else { return };
    let Some(used) = channels.iter_mut().find(|used| used.channel.topic == *topic) else { return };
    let name = if *sensor == Sensor::Gyroscope { "gyroscope" } else { "accelerometer" };
    let offered = used.configuration.is_some();
    let says = |text: String| format!("{name}: {text}");
    if peek.alternates() {
        let turns = "each reading is far from the one before and near the one before that: two sensors take turns; give them topics, or frame_ids, of their own";
        used.remarks.push(says(turns.to_owned()));
    }
    let remark = match peek.looks(*sensor) {
        Looks::Right if offered => says(format!("reads {rest:.2} m/s² at rest, as it should")),
        Looks::Right => return,
        Looks::Accel(unit) => {
            let unit_name = if unit == AccelUnit::StandardGravity { "g" } else { "m/s^2" };
            set_unit(used, config, |imu| imu.accel.get_or_insert_default().unit = unit);
            says(format!(
                "reads {rest:.2} at rest: not m/s² but g, or the other way round; the lines below say {unit_name}"
            ))
        }
        Looks::Rate(unit) => {
            set_unit(used, config, |imu| imu.gyro.get_or_insert_default().unit = unit);
            says(format!("reads {rest:.2} at rest: too much for rad/s; the lines below say deg/s"))
        }
        Looks::Thousandths(unit) => {
            let unit = if unit == AccelUnit::StandardGravity { "g" } else { "m/s²" };
            says(format!(
                "reads {rest:.0} at rest: thousandths of {unit}, which no setting converts; record it in m/s² or g"
            ))
        }
        Looks::Unknown if *sensor == Sensor::Gyroscope => return,
        Looks::Unknown => says(format!(
            "reads {rest:.2} where it is quietest, which is no unit of gravity: moving all the time, or gravity removed?"
        )),
    };
    used.remarks.push(remark);
}

/// Changes the configuration that is offered, that which is there, or that of a topic that has needed none.
fn set_unit(used: &mut Use, config: &Config, change: impl FnOnce(&mut ImuConfig)) {
    let topic = &used.channel.topic;
    let present = config.imu.iter().find(|imu| imu.topic == *topic).cloned();
    let imu = used
        .configuration
        .get_or_insert_with(|| present.unwrap_or_else(|| ImuConfig { topic: topic.clone(), ..ImuConfig::default() }));
    change(imu);
}

/// Says which of two topics of one sensor to use.
fn remark_on_twins(one: &str, other: &str, relation: Relation, channels: &mut [Use]) {
    let is_raw = |topic: &str| topic.to_lowercase().contains("raw");
    let is_corrected = |topic: &str| ["correct", "calib"].iter().any(|word| topic.to_lowercase().contains(word));
    let corrects = |twin: &str, raw: &str| is_raw(raw) && !is_raw(twin) || is_corrected(twin) && !is_corrected(raw);
    let (raw, twin) = if corrects(one, other) { (other, one) } else { (one, other) };
    let known = corrects(twin, raw) && !corrects(raw, twin);
    let (of_raw, of_twin) = match (relation, known) {
        (Relation::Same, true) => (
            format!("{twin} repeats it, value for value: use this one"),
            format!("repeats {raw}, value for value: use {raw}"),
        ),
        (Relation::Same, false) => (
            format!("{twin} repeats it, value for value: one of them suffices"),
            format!("repeats {raw}, value for value: one of them suffices"),
        ),
        (Relation::Affine, true) => (
            format!("the raw readings of {twin}: use this one, its calibration is the sensor's"),
            format!("{raw} corrected (same stamps, a matrix and an offset apart): use {raw}"),
        ),
        (Relation::Affine, false) => (
            format!("the same sensor as {twin}, a matrix and an offset apart: use the one that is not corrected"),
            format!("the same sensor as {raw}, a matrix and an offset apart: use the one that is not corrected"),
        ),
    };
    for used in channels {
        if used.channel.topic == raw {
            used.remarks.push(of_raw.clone());
        } else if used.channel.topic == twin {
            used.remarks.push(of_twin.clone());
        }
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
        assert!(all.channels.iter().any(|used| used.messages > 100 && matches!(used.verdict, Verdict::Used(_))));

        // What is cut off says nothing at its end.
        std::fs::write(&path, &bytes[..bytes.len() * 3 / 4]).unwrap();
        let (cut, whole) = (looked(0), looked(u64::MAX));
        assert_eq!(format!("{cut:?}"), format!("{whole:?}"));
        assert!(cut.seconds < all.seconds);
    }
}
