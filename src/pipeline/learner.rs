//! Learner: a recording's messages through intake, engines and annotator, to findings and annotations.
//!
//! Reading the messages is left to [`Recording`](crate::run::input::recording::Recording), writing the annotations to
//! [`annotate`](crate::run::annotate()).

mod engine_setup;
mod notes;
mod restore;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use self::engine_setup::{engine_config, is_called, topic_of};
pub(crate) use self::notes::{not_corrected, rounded, uncorrected};
use crate::Stamp;
use crate::annotate::{Annotator, Corrected, Corrections, is_only_partial};
use crate::config::Config;
use crate::engine::{self, Engine, Message};
use crate::fit::{Gravity, Place, Source};
use crate::imu::{ChannelRole, Imu, ImuId, Position, Reading, Sensor, Timing};
use crate::messages::foxglove::Log;
use crate::messages::foxglove::log::Level;
use crate::pipeline::correction::Corrector;
use crate::pipeline::events::{Notice, Notify};
use crate::pipeline::sources::Sources;
use crate::pipeline::time_order::TimeOrder;
use crate::printable;
use crate::record::{Annotation, Block, Channel, Damage, Event, Message as Recorded, Topic};
use crate::report::Findings;

/// Number of damages that are kept one by one. Further ones are only counted.
const DAMAGES: usize = 100;

/// Learns from the events of a scan. It can be saved and resumed.
#[derive(Serialize, Deserialize)]
pub(crate) struct Learner {
    /// Configuration, constant for a recording.
    #[serde(skip)]
    config: Config,
    sources: Sources,
    time_order: TimeOrder,
    timing: Timing,
    /// Prefix for the damages of this split, if there are several splits.
    split: Option<String>,
    imus: Vec<Learning>,
    annotator: Annotator,
    begun: bool,
    closed: bool,
    #[serde(skip)]
    blocks: Vec<Block>,
    corrector: Corrector,
    damage: Vec<Damage>,
    damages: u64,
    /// Log time of the last message that is used, or of the first one until then, in nanoseconds.
    log_time: u64,
    /// Place of the recording, once known.
    place: Option<Place>,
    #[serde(skip)]
    readings: Vec<(ImuId, Sensor, Reading)>,
    /// Readings after the correction of their times.
    #[serde(skip)]
    timed: Vec<(ImuId, Sensor, Reading)>,
    #[serde(skip)]
    events: Vec<engine::Event>,
}

/// State of one IMU.
#[derive(Serialize, Deserialize)]
struct Learning {
    engine: Engine,
    /// Not saved, since the annotations contain the same.
    #[serde(skip)]
    findings: Findings,
    /// Corrections by the calibration in force.
    corrections: Option<Corrections>,
}

/// Results of a recording.
#[derive(Debug)]
pub(crate) struct Learned {
    pub(crate) imus: Vec<Findings>,
    /// All channels, and their roles.
    pub(crate) channels: Vec<(Channel, ChannelRole)>,
    /// Refusals and missing inputs, one line each.
    pub(crate) notes: Vec<String>,
    /// Whether an IMU's channels follow each other in the file and were not read in time order.
    pub(crate) apart: bool,
    /// First damages.
    pub(crate) damage: Vec<Damage>,
    pub(crate) damages: u64,
    /// Annotator with all topics, which can continue.
    pub(crate) annotator: Annotator,
}

impl Learner {
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            config: config.clone(),
            sources: Sources::new(config),
            time_order: TimeOrder::default(),
            timing: Timing::new(config.still.late_s),
            split: None,
            begun: false,
            closed: false,
            imus: Vec::new(),
            annotator: Annotator::new(config.output.encoding.in_profile("")),
            blocks: Vec::new(),
            corrector: Corrector::default(),
            damage: Vec::new(),
            damages: 0,
            log_time: 0,
            place: None,
            readings: Vec::new(),
            timed: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Processes messages of these channels in the order of their log times.
    pub(crate) fn in_time_order(self, channels: BTreeSet<u16>) -> Self {
        Self { time_order: TimeOrder::merging(channels), ..self }
    }

    /// Channels of one IMU that follow each other in the file, if any. Its results are unreliable unless they are read
    /// [in time order](Self::in_time_order).
    pub(crate) fn apart(&self) -> Option<BTreeSet<u16>> {
        self.time_order.apart()
    }

    /// Whether channels of one IMU may still turn out to follow each other.
    pub(crate) fn may_be_apart(&self) -> bool {
        self.sources.intake.may_have_parts()
    }

    /// Reports the channels so far once more.
    pub(crate) fn tell_channels(&self, notify: Notify<'_>) {
        for entry in self.sources.table.iter() {
            notify(Notice::Channel { channel: &entry.channel, schema: entry.schema.as_ref() });
        }
    }

    /// Reports the state of each IMU.
    pub(crate) fn tell_imus(&self, notify: Notify<'_>) {
        for Learning { engine, findings, .. } in &self.imus {
            notify(Notice::Imu { findings, status: engine.status() });
        }
    }

    /// Processes an event of the scan, and reports news.
    pub(crate) fn take(&mut self, event: Event<'_>, notify: Notify<'_>) {
        match event {
            Event::Header { profile, .. } if !self.begun => {
                self.begun = true;
                self.annotator = Annotator::new(self.config.output.encoding.in_profile(profile));
            }
            Event::Schema(_) | Event::Channel(_) => {
                if let Some(entry) = self.sources.take(&event) {
                    notify(Notice::Channel { channel: &entry.channel, schema: entry.schema.as_ref() });
                    for (imu, learning) in self.sources.intake.imus().iter().zip(&mut self.imus) {
                        learning.engine.gyroscope_on(topic_of(imu, Sensor::Gyroscope));
                    }
                }
            }
            Event::Message(message) => {
                // Later messages that are not used count for nothing: whether they are read at all must make no difference.
                if self.log_time == 0 {
                    self.log_time = message.log_time;
                }
                let Some(message) = self.sources.wanted(message) else { return };
                if self.time_order.holds(message.channel) {
                    self.time_order.hold(&message);
                    while let Some(held) = self.time_order.next() {
                        self.use_message(&held.message(), notify);
                    }
                } else {
                    let sources = self.sources.intake.sources_on(message.channel);
                    self.time_order.watch(sources, message.channel, message.log_time);
                    self.use_message(&message, notify);
                }
            }
            Event::ChunkEnd => {
                let block = self.annotator.input_chunk_ended();
                self.blocks.extend(block);
            }
            Event::Damage(mut damage) => {
                if let Some(split) = &self.split {
                    damage.what = format!("{split}: {}", damage.what);
                }
                self.log(Level::Warning, damage.to_string(), notify);
                notify(Notice::Damage(&damage));
                self.damages += 1;
                if self.damage.len() < DAMAGES {
                    self.damage.push(damage);
                }
            }
            Event::Header { .. } | Event::Read { .. } | Event::Chunk { .. } | Event::Wait | Event::End => {}
        }
    }

    /// Whether messages on these channels are not used.
    pub(crate) fn is_useless(&self, channels: &[u16]) -> bool {
        self.sources.is_useless(channels)
    }

    /// Takes the blocks closed since the last call, so that they do not pile up.
    pub(crate) fn take_blocks(&mut self) -> impl Iterator<Item = Block> {
        self.blocks.drain(..)
    }

    /// Whether there are blocks that were not taken yet.
    pub(crate) fn has_blocks(&self) -> bool {
        !self.blocks.is_empty()
    }

    /// Topics of the annotations so far.
    pub(crate) fn topics(&self) -> &[Topic] {
        self.annotator.topics()
    }

    /// Begins a split. It has a name if there are several.
    pub(crate) fn begin_split(&mut self, name: Option<String>, is_first: bool) {
        self.split = name;
        if !is_first {
            self.sources.begin_split();
        }
    }

    /// Ends a split: no block extends into the next.
    pub(crate) fn end_split(&mut self) {
        let last = self.annotator.finish();
        self.blocks.extend(last);
    }

    /// Whether an IMU has been seen.
    pub(crate) fn has_imu(&self) -> bool {
        !self.imus.is_empty()
    }

    /// Sources so far.
    pub(crate) fn sources(&self) -> &Sources {
        &self.sources
    }

    /// Reasons why topics that might be IMUs are none so far, and the first damage, one line each.
    pub(crate) fn obstacles(&self) -> Vec<String> {
        let mut obstacles = self.sources.intake.obstacles();
        obstacles.extend(self.damage.first().map(ToString::to_string));
        obstacles
    }

    /// Ends the recording after its last split.
    pub(crate) fn close(&mut self, notify: Notify<'_>) {
        self.closed = true;
        while let Some(held) = self.time_order.pop() {
            self.use_message(&held.message(), notify);
        }
        let Self { timing, timed, .. } = self;
        timing.finish(&mut |read| timed.push(read));
        self.push_timed(notify);
        for remark in self.timing_remarks() {
            self.log(Level::Warning, remark, notify);
        }
        for i in 0..self.imus.len() {
            if let Some(imu) = self.imus.get_mut(i) {
                imu.engine.finish(&mut self.events);
            }
            self.publish(i, notify);
        }
        self.end_split();
    }

    /// Results of the recording.
    pub(crate) fn finish(mut self, notify: Notify<'_>) -> Learned {
        if !self.closed {
            self.close(notify);
        }
        let faults = self.sources.intake.faults().into_iter().map(|fault| fault.to_string());
        let causal = self.config.output.corrected == Corrected::Causal;
        let stuck = self.imus.iter().filter(|imu| causal && imu.corrections.is_some()).map(|imu| &imu.findings);
        let stuck = stuck.filter(|imu| !self.corrector.has_written(&imu.name)).map(not_corrected);
        let stuck = stuck.chain(rounded(&self.sources.intake, &self.corrector));
        let apart = self.apart().is_some();
        let notes = faults.chain(self.timing_remarks()).chain(self.sources.missing()).chain(stuck);
        let notes = notes.chain(self.unused_rotations()).collect();
        let channels = self.sources.channels().map(|(entry, verdict)| (entry.channel.clone(), verdict.clone()));
        Learned {
            imus: self.imus.into_iter().map(|imu| imu.findings).collect(),
            channels: channels.collect(),
            notes,
            apart,
            damage: self.damage,
            damages: self.damages,
            annotator: self.annotator,
        }
    }

    /// Declared rotations that are of no use, one line each.
    fn unused_rotations(&self) -> Vec<String> {
        let imus = self.sources.intake.imus();
        let named = self.config.fit.rotations.iter().filter_map(|rotation| rotation.imu.as_ref());
        let unknown = named.filter(|name| !imus.iter().any(|imu| is_called(imu, name)));
        let unknown: BTreeSet<_> = unknown.map(|name| format!("fit.rotations: no IMU is called {name}")).collect();
        let unused = imus.iter().zip(&self.imus).flat_map(|(imu, learning)| {
            learning.engine.unused_rotations().iter().map(|text| format!("{}: {text}", imu.name))
        });
        unknown.into_iter().chain(unused).collect()
    }

    /// Corrections to the times of the readings, one line each.
    fn timing_remarks(&self) -> Vec<String> {
        let imus = self.sources.intake.imus().iter().enumerate();
        let ids = imus.map(|(i, imu)| (ImuId::of(i), imu));
        ids.flat_map(|(id, imu)| self.timing.remarks(id).into_iter().map(move |text| format!("{}: {text}", imu.name)))
            .chain(self.time_order.remark())
            .collect()
    }

    fn use_message(&mut self, message: &Recorded<'_>, notify: Notify<'_>) {
        self.log_time = message.log_time;
        self.message(message, notify);
        self.correct(message, notify);
    }

    fn message(&mut self, message: &Recorded<'_>, notify: Notify<'_>) {
        if let Some(fix) = self.sources.intake.fix(message.channel, message.data) {
            self.locate(fix, notify);
        }
        let readings = &mut self.readings;
        let mut keep = |imu, sensor, reading| readings.push((imu, sensor, reading));
        self.sources.intake.message(message.channel, message.log_time, message.data, &mut keep);
        let samples = self.readings.iter().filter(|(.., reading)| matches!(reading, Reading::Sample(_)));
        notify(Notice::Message { message, samples: samples.count() });
        for imu in self.sources.intake.imus().iter().skip(self.imus.len()) {
            let mut engine = Engine::new(engine_config(imu, &self.config));
            self.place.into_iter().for_each(|place| engine.locate(place));
            let findings = self.nothing_of(imu);
            self.imus.push(Learning { engine, findings, corrections: None });
        }
        for notice in self.sources.intake.take_notices() {
            self.log(Level::Warning, notice.text, notify);
        }
        for (imu, celsius) in self.sources.intake.take_temperatures() {
            self.imus.get_mut(imu.index()).into_iter().for_each(|learning| learning.engine.warm(celsius));
        }
        let Self { timing, readings, timed, .. } = self;
        timing.pass(message.channel, message.log_time, readings, &mut |read| timed.push(read));
        self.readings.clear();
        self.push_timed(notify);
    }

    /// Passes the readings whose turn has come to the engines.
    fn push_timed(&mut self, notify: Notify<'_>) {
        for i in 0..self.timed.len() {
            let Some(&(imu, sensor, reading)) = self.timed.get(i) else { break };
            let imu = imu.index();
            let Some(learning) = self.imus.get_mut(imu) else { continue };
            match reading {
                Reading::Sample(sample) => {
                    learning.findings.near_misses.sample(sensor, &sample);
                    learning.engine.push(sensor, &sample, &mut self.events);
                }
                Reading::Clipped(stamp) => learning.engine.clipped(sensor, stamp),
                Reading::NewRound { stamp, log_time } => {
                    learning.engine.begin_round(sensor, stamp, log_time, &mut self.events);
                }
            }
            if !self.events.is_empty() {
                self.publish(imu, notify);
            }
        }
        self.timed.clear();
    }

    /// Writes the corrected message, by the calibrations in force.
    fn correct(&mut self, message: &Recorded<'_>, notify: Notify<'_>) {
        if self.config.output.corrected == Corrected::Causal {
            let by = |imu: ImuId| self.imus.get(imu.index()).and_then(|imu| imu.corrections.as_ref());
            let notify = |annotator: &Annotator| {
                if let Some((topic, annotation)) = last_of(annotator) {
                    notify(Notice::Corrected { topic, annotation });
                }
            };
            self.corrector.correct(message, &self.sources, by, &mut self.annotator, &mut self.blocks, notify);
        }
    }

    /// Sets the place of the recording.
    fn locate(&mut self, Position { latitude_deg, height_m }: Position, notify: Notify<'_>) {
        let place = Place { latitude_deg, height_m };
        self.place = Some(place);
        self.imus.iter_mut().for_each(|imu| imu.engine.locate(place));
        if self.config.fit.gravity.is_none() && self.config.fit.latitude_deg.is_none() {
            let gravity = Gravity::at(&place, Source::FixTopic);
            let height = height_m.map(|height| format!(" and {height:.0} m")).unwrap_or_default();
            let text =
                format!("gravity is {:.5} ± {:.4} m/s² at {latitude_deg:.3}°{height}", gravity.value, gravity.std);
            self.log(Level::Info, text, notify);
        }
    }

    /// Findings of an IMU before anything was learned.
    fn nothing_of(&self, imu: &Imu) -> Findings {
        Findings { source_type: self.source_type(&imu.topic), ..Findings::new(&imu.name, &imu.topic) }
    }

    /// Type of the messages on a topic.
    fn source_type(&self, topic: &str) -> String {
        let entry = self.sources.table.iter().find(|entry| entry.channel.topic == topic);
        entry.map(|entry| entry.schema_name().to_owned()).unwrap_or_default()
    }

    /// Writes the events of an IMU as annotations.
    fn publish(&mut self, imu: usize, notify: Notify<'_>) {
        let name = self.sources.intake.imus().get(imu).map_or("", |imu| &imu.name);
        let mut left = None;
        for event in self.events.drain(..) {
            self.blocks.extend(self.annotator.push(name, &event));
            tell_of(&self.annotator, name, &event, notify);
            let Some(learning) = self.imus.get_mut(imu) else { continue };
            learning.findings.note(&event);
            if let Message::Calibration(calibration) = &event.message
                && self.config.output.corrected == Corrected::Causal
                && (learning.corrections.is_some() || !is_only_partial(calibration))
            {
                let first = learning.corrections.is_none();
                let corrections = learning.corrections.insert(Corrections::of(calibration));
                left = left.or_else(|| uncorrected(name, corrections).filter(|_| first));
            }
        }
        if let Some(text) = left {
            self.log(Level::Info, text, notify);
        }
    }

    /// Writes a line to the recording's log.
    fn log(&mut self, level: Level, message: String, notify: Notify<'_>) {
        let timestamp = Some(Stamp::from_log_time(self.log_time).into());
        let message = printable(&message).into_owned();
        let log = Log { timestamp, level: level.into(), message, name: "stillpoint".to_owned(), ..Log::default() };
        let event = engine::Event { log_time: self.log_time, message: Message::Log(log) };
        self.blocks.extend(self.annotator.push("", &event));
        tell_of(&self.annotator, "", &event, notify);
    }
}

/// Reports the annotation that was added last.
fn tell_of(annotator: &Annotator, imu: &str, event: &engine::Event, notify: Notify<'_>) {
    if let Some((topic, annotation)) = last_of(annotator) {
        notify(Notice::Annotation { imu, topic, annotation, event });
    }
}

/// The annotation that was added last, and its topic.
fn last_of(annotator: &Annotator) -> Option<(&Topic, &Annotation)> {
    let annotation = annotator.open().last()?;
    Some((annotator.topics().get(annotation.topic)?, annotation))
}
