//! Entry point of this module: channels and messages in, samples out.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::imu::config::{HeadingConfig, ImuConfig};
use crate::imu::mapping::assignment::Assignment;
use crate::imu::mapping::channel_role::ChannelRole;
use crate::imu::mapping::heading::{Heading, HeadingSearch};
use crate::imu::mapping::obstacles::MissingTopic;
use crate::imu::mapping::position::{Position, PositionSearch};
use crate::imu::mapping::refusal::{Cause, Notice, RefusalCount, ZEROS};
use crate::imu::mapping::registry::{Imu, admit, is_zero, owner, warmed};
use crate::imu::mapping::route::Route;
use crate::imu::sample::{ImuId, Reading, Sample, Sensor};
use crate::record;

/// Converts the messages of a recording to samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intake {
    channels: Assignment,
    notices: Vec<Notice>,
    /// Temperatures of the last messages, °C, until they are taken.
    #[serde(skip)]
    temperatures: Vec<(ImuId, f64)>,
    /// Latest temperature of each IMU that has one, °C.
    latest_temperatures: BTreeMap<ImuId, f64>,
}

impl Intake {
    /// Intake for the configured IMUs, and for every topic of a well-known type that they do not mention.
    pub fn new(imus: &[ImuConfig]) -> Self {
        Self {
            channels: Assignment::new(imus),
            notices: Vec::new(),
            temperatures: Vec::new(),
            latest_temperatures: BTreeMap::new(),
        }
    }

    /// Whether the fields of a JSON channel are still unknown, until its first message.
    pub fn is_untold(&self) -> bool {
        self.channels.is_untold()
    }

    /// Limits the IMUs that no configuration names, each of which takes memory.
    pub fn with_most(mut self, imus: usize) -> Self {
        self.channels.most = imus;
        self
    }

    /// Restricts positions to this topic.
    pub fn with_fix_topic(mut self, topic: Option<String>) -> Self {
        self.channels.positions = PositionSearch::new(topic);
        self
    }

    /// Reads headings from the topic of this reference.
    pub fn with_heading(mut self, heading: Option<HeadingConfig>) -> Self {
        self.channels.headings = HeadingSearch::new(heading);
        self
    }

    /// Adds a channel and returns its role, as far as it is known. Repeating a channel changes nothing.
    pub fn channel(&mut self, channel: &record::Channel, schema: Option<&record::Schema>) -> &ChannelRole {
        self.channels.channel(channel, schema)
    }

    /// Role of a channel. It may change with later channels, or with its first message.
    pub fn verdict(&self, channel_id: u16) -> &ChannelRole {
        self.channels.role(channel_id)
    }

    /// Whether messages of this channel are needed.
    pub fn wants(&self, channel_id: u16) -> bool {
        self.channels.wants(channel_id)
    }

    /// Whether an IMU has its sensors on several channels, or a gyroscope on another one may yet appear.
    pub fn may_have_parts(&self) -> bool {
        self.channels.may_have_parts()
    }

    /// Channels of each IMU that has its sensors on several.
    pub fn parts(&self) -> impl Iterator<Item = BTreeSet<u16>> {
        self.channels.parts()
    }

    /// Stamp of the last message of a channel; `None` where messages hold several readings.
    pub fn last_stamp(&self, channel_id: u16) -> Option<Stamp> {
        self.channels.routes.get(&channel_id)?.first().filter(|route| !route.has_batches())?.stamp
    }

    /// Stamp of a message that was not added yet.
    pub fn stamp(&self, channel_id: u16, log_time: u64, data: &[u8]) -> Option<Stamp> {
        self.channels.routes.get(&channel_id)?.first()?.stamp_of(data, log_time)
    }

    /// Indices of the requested IMUs that read a channel.
    pub fn sources_on(&self, channel_id: u16) -> impl Iterator<Item = usize> {
        self.channels.routes.get(&channel_id).into_iter().flatten().map(|route| route.source)
    }

    /// Adds a message. Returns the position of the recording, if this message is the first with a valid one.
    pub fn fix(&mut self, channel_id: u16, data: &[u8]) -> Option<Position> {
        self.channels.positions.message(channel_id, data)
    }

    /// Heading in a message, if it is one of the heading reference.
    pub fn heading(&mut self, channel_id: u16, log_time: u64, data: &[u8]) -> Option<Heading> {
        self.channels.headings.message(channel_id, log_time, data)
    }

    /// Reason why a topic that an IMU is read from is no heading reference.
    pub fn heading_fault(&self) -> Option<String> {
        self.channels.headings.fault()
    }

    /// Note that no message of the heading reference had a heading, once all are read.
    pub fn heading_unread(&self) -> Option<String> {
        self.channels.headings.unread()
    }

    /// Adds a message and passes its readings to `sink`. Those of the accelerometer come last, since they trigger the
    /// evaluation of an IMU's state. Messages of unused channels are skipped, and readings before the first one of
    /// their IMU's accelerometer.
    pub fn message(
        &mut self,
        channel_id: u16,
        log_time: u64,
        data: &[u8],
        sink: &mut impl FnMut(ImuId, Sensor, Reading),
    ) {
        self.channels.assign_by_message(channel_id, data);
        self.temperatures.clear();
        let Self { channels: Assignment { sources, imus, routes, .. }, notices, temperatures, latest_temperatures } =
            self;
        for route in routes.get_mut(&channel_id).into_iter().flatten() {
            let Some(source) = sources.get_mut(route.source) else { continue };
            let mut notice = |topic: &str, text: String| {
                notices.push(Notice { log_time, topic: topic.to_owned(), text: format!("{topic}{text}") });
            };
            if i64::try_from(log_time).is_err() {
                if route.counts.count(Cause::LogTime) == 1 {
                    notice(&route.topic, format!(": a message is refused: {}", Cause::LogTime));
                }
                continue;
            }
            route.taps.iter_mut().for_each(|tap| tap.last = None);
            let (frame, readings) = match route.read(data) {
                Ok(read) => read,
                Err(error) => {
                    if route.counts.count(Cause::Malformed) == 1 {
                        notice(&route.topic, format!(": a message is refused: {error}"));
                        route.malformed = Some(error.to_string());
                    }
                    continue;
                }
            };
            for reading in 0..readings {
                let stamp = route.load(reading, log_time);
                let appears = appears(route);
                for i in 0..route.taps.len() {
                    let owner = owner(source, imus, route, i, &frame, appears);
                    let Some(tap) = route.taps.get(i) else { continue };
                    let value = route.value(tap);
                    let clipped = route.is_clipped(tap);
                    let (sensor, value) = (
                        tap.sensor,
                        match owner {
                            Ok(Some(id)) => value
                                .and_then(|value| admit(imus, id, tap.sensor, value))
                                .map(|value| Some((id, value))),
                            Ok(None) => {
                                value.and_then(|value| if is_zero(&value) { Err(Cause::Zero) } else { Ok(None) })
                            }
                            Err(cause) => Err(cause),
                        },
                    );
                    // Of several readings one may be refused.
                    if let (Some(tap), Ok(Some((id, _)))) = (route.taps.get_mut(i), &value) {
                        tap.last = Some(*id);
                    }
                    match value {
                        Ok(Some((id, value))) => {
                            if route.begins_round(i) {
                                sink(id, sensor, Reading::NewRound { stamp, log_time });
                            }
                            if clipped {
                                sink(id, sensor, Reading::Clipped(stamp));
                            }
                            sink(id, sensor, Reading::Sample(Sample { stamp, log_time, value }));
                        }
                        Ok(None) => {}
                        Err(cause) => {
                            let Some(tap) = route.taps.get_mut(i) else { continue };
                            if tap.counts.count(cause) == (if cause == Cause::Zero { ZEROS } else { 1 }) {
                                notice(&route.topic, format!(", {}: {cause}", tap.name));
                            }
                        }
                    }
                }
            }
            if let Some(celsius) = route.temperature()
                && let Some(id) = warmed(source, route, &frame)
            {
                temperatures.push((id, celsius));
                latest_temperatures.insert(id, celsius);
            }
        }
    }

    /// Takes the temperatures in the last message, °C, each with its IMU.
    pub fn take_temperatures(&mut self) -> impl Iterator<Item = (ImuId, f64)> {
        self.temperatures.drain(..)
    }

    /// Latest temperature of an IMU, °C, if it has had one.
    pub fn temperature(&self, imu: ImuId) -> Option<f64> {
        self.latest_temperatures.get(&imu).copied()
    }

    /// Rewrites the last message with other readings: for each IMU that reads it, the name that its topics begin with,
    /// and the bytes. `change` maps readings to their replacements, in m/s² or rad/s; a message may hold several, counted
    /// from 0. Nothing is returned if it changes none, or if a number cannot hold the result. Integers are rounded.
    pub fn rewrite(
        &self,
        channel_id: u16,
        data: &[u8],
        mut change: impl FnMut(ImuId, Sensor, usize, Vector3<f64>) -> Option<Vector3<f64>>,
    ) -> Vec<(&str, Vec<u8>)> {
        let mut rewritten: Vec<(&str, Vec<u8>)> = Vec::new();
        for route in self.channels.routes.get(&channel_id).into_iter().flatten() {
            let name = self.name_of(route);
            let data = route.rewrite(data, |tap, reading, value| change(tap.last?, tap.sensor, reading, value));
            // A topic that several IMUs share is rewritten only for the first of the same name.
            rewritten
                .extend(data.filter(|_| rewritten.iter().all(|(known, _)| *known != name)).map(|data| (name, data)));
        }
        rewritten
    }

    /// Steps to which readings are rounded that [`rewrite`](Self::rewrite) puts in the place of integers: by the name that
    /// their topics begin with, the name of the triad and its largest step, in m/s² or rad/s.
    pub fn rounding(&self) -> BTreeMap<(&str, &str), (Sensor, f64)> {
        let mut steps: BTreeMap<(&str, &str), (Sensor, f64)> = BTreeMap::new();
        for route in self.channels.routes.values().flatten() {
            for tap in route.taps.iter().filter(|tap| !matches!(tap.sensor, Sensor::Reference(_))) {
                let Some(step) = route.step(tap) else { continue };
                let (_, largest) = steps.entry((self.name_of(route), &*tap.name)).or_insert((tap.sensor, step));
                *largest = largest.max(step);
            }
        }
        steps
    }

    /// Name that the topics of rewritten messages begin with.
    fn name_of<'a>(&'a self, route: &'a Route) -> &'a str {
        let accel = route.taps.iter().find(|tap| tap.sensor == Sensor::Accelerometer);
        let imu = accel.and_then(|tap| self.channels.imus.get(tap.last?.index()));
        imu.map_or(route.topic.as_str(), |imu| &imu.name)
    }

    /// IMUs seen so far, by [`ImuId`].
    pub fn imus(&self) -> &[Imu] {
        &self.channels.imus
    }

    /// Refusals so far, by topic.
    pub fn faults(&self) -> Vec<RefusalCount> {
        self.channels.faults()
    }

    /// Reasons why topics that might be IMUs are none so far, one line each.
    pub fn obstacles(&self) -> Vec<String> {
        self.channels.obstacles()
    }

    /// Takes the notices since the last call: each once, in the order of their occurrence.
    pub fn take_notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Topics that the configuration names and no channel has had so far.
    pub fn missing_topics(&self) -> Vec<MissingTopic> {
        self.channels.missing_topics()
    }
}

/// Whether the last message shows that its accelerometer exists.
fn appears(route: &Route) -> bool {
    let accel = route.taps.iter().find(|tap| tap.sensor == Sensor::Accelerometer);
    accel.is_some_and(|tap| route.value(tap).is_ok_and(|value| !is_zero(&value)))
}
