//! Learner: a recording's messages through intake, engines and annotator, to findings and annotations.
//!
//! [`Recording`](crate::run::input::recording::Recording) reads the messages, [`annotate`](crate::run::annotate()) writes the
//! annotations.

mod engine_setup;
mod finish;
mod imu_state;
mod learned;
mod notes;
mod publish;
mod restore;
mod use_message;

use serde::{Deserialize, Serialize};

use self::engine_setup::topic_of;
use self::imu_state::ImuState;
pub(crate) use self::learned::Learned;
pub(crate) use self::notes::{not_corrected, rounded, uncorrected};
use crate::Error;
use crate::annotate::Annotator;
use crate::config::Config;
use crate::engine;
use crate::fit::EarthLocation;
use crate::imu::{Imu, ImuId, Reading, Sensor, Timing};
use crate::messages::foxglove::log::Level;
use crate::pipeline::correction::Corrector;
use crate::pipeline::events::{Notice, Notify};
use crate::pipeline::sources::Sources;
use crate::pipeline::time_merge::{Shelf, TimeMerge};
use crate::pipeline::time_order::{Apart, TimeOrder};
use crate::record::{Block, Damage, Event, Topic};
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
    /// Merge of channels that are apart, on a second reading.
    #[serde(skip)]
    time_merge: Option<TimeMerge>,
    timing: Timing,
    /// Prefix for the damages of this split, if there are several splits.
    split: Option<String>,
    imus: Vec<ImuState>,
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
    place: Option<EarthLocation>,
    #[serde(skip)]
    readings: Vec<(ImuId, Sensor, Reading)>,
    /// Readings after the correction of their times.
    #[serde(skip)]
    timed: Vec<(ImuId, Sensor, Reading)>,
    #[serde(skip)]
    events: Vec<engine::Event>,
}

impl Learner {
    pub(crate) fn new(config: &Config) -> Self {
        Self {
            config: config.clone(),
            sources: Sources::new(config),
            time_order: TimeOrder::default(),
            time_merge: None,
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

    /// Processes messages of these channels in the order of their times, with the help of a shelf for what does not fit
    /// into memory.
    pub(crate) fn in_time_order(self, channels: Apart, shelf: Box<dyn Shelf>) -> Self {
        Self { time_merge: Some(TimeMerge::new(channels, shelf)), ..self }
    }

    /// Error of the shelf, if it failed. The results are then incomplete.
    pub(crate) fn take_failure(&mut self) -> Option<Error> {
        self.time_merge.as_mut().and_then(TimeMerge::take_failure)
    }

    /// Channels of one IMU that follow each other in the file, if any. Its results are unreliable unless they are read
    /// [in time order](Self::in_time_order).
    pub(crate) fn apart(&self) -> Option<Apart> {
        if self.time_merge.is_some() { None } else { self.time_order.apart(self.sources.intake.parts()) }
    }

    /// Whether channels of one IMU may still turn out to follow each other.
    pub(crate) fn may_be_apart(&self) -> bool {
        self.sources.intake.may_have_parts()
    }

    /// Reports the channels so far once more.
    pub(crate) fn tell_channels(&self, notify: Notify<'_>) {
        for entry in self.sources.table.iter() {
            notify(Notice::Channel { channel: entry.channel, schema: entry.schema });
        }
    }

    /// Reports the state of each IMU.
    pub(crate) fn tell_imus(&self, notify: Notify<'_>) {
        for ImuState { engine, findings, .. } in &self.imus {
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
                    notify(Notice::Channel { channel: entry.channel, schema: entry.schema });
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
                let intake = &self.sources.intake;
                match self.time_merge.as_mut().filter(|merge| merge.holds(message.channel)) {
                    Some(merge) => {
                        merge.hold(&message, || intake.stamp(message.channel, message.log_time, message.data));
                        while let Some(held) = self.time_merge.as_mut().and_then(TimeMerge::next) {
                            self.use_message(&held.message(), notify);
                        }
                    }
                    None => {
                        let sources = intake.sources_on(message.channel);
                        self.time_order.watch(sources, message.channel, message.log_time);
                        self.use_message(&message, notify);
                    }
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
        while let Some(held) = self.time_merge.as_mut().and_then(TimeMerge::pop) {
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

    /// Findings of an IMU before anything was learned.
    fn nothing_of(&self, imu: &Imu) -> Findings {
        Findings { source_type: self.source_type(&imu.topic), ..Findings::new(&imu.name, &imu.topic) }
    }

    /// Type of the messages on a topic.
    fn source_type(&self, topic: &str) -> String {
        let entry = self.sources.table.iter().find(|entry| entry.channel.topic == topic);
        entry.map(|entry| entry.schema_name().to_owned()).unwrap_or_default()
    }
}
