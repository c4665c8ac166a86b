//! Entry point of this module: channels and messages in, samples out. It decides what is an IMU, when a sample was
//! measured, and what is refused.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::Stamp;
use crate::imu::config::{HeadingConfig, ImuConfig};
use crate::imu::mapping::channel_role::ChannelRole;
use crate::imu::mapping::heading::{Heading, HeadingSearch};
use crate::imu::mapping::known_types::{KnownType, known};
use crate::imu::mapping::paired_topics::{PairedTopic, Side};
use crate::imu::mapping::position::{Position, PositionSearch};
use crate::imu::mapping::refusal::{Cause, Notice, RefusalCount};
use crate::imu::mapping::registry::{Imu, Triad, admit, is_zero, owner, warmed};
use crate::imu::mapping::request::Request;
use crate::imu::mapping::route::Route;
use crate::imu::mapping::source::Source;
use crate::imu::mapping::suggestion::{Suggestion, puzzle};
use crate::imu::sample::{ImuId, Reading, Sample, Sensor};
use crate::imu::schema::layout::{Layout, SchemaError};
use crate::imu::schema::lookup::nearest;
use crate::record;
use crate::topic;

/// Converts the messages of a recording to samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intake {
    /// Sources, the configured ones first.
    sources: Vec<Source>,
    configured: usize,
    topics: BTreeSet<String>,
    verdicts: BTreeMap<u16, ChannelRole>,
    /// Routes by channel: one for each source that reads it.
    routes: BTreeMap<u16, Vec<Route>>,
    /// JSON channels whose first message will show their fields.
    untold: BTreeMap<u16, record::Channel>,
    /// Sources that read a topic.
    readers: BTreeMap<String, Vec<usize>>,
    halves: BTreeMap<u16, PairedTopic>,
    /// Halves of IMUs by their common key, see [`PairedTopic::common`].
    pairs: BTreeMap<(String, String), BTreeSet<u16>>,
    imus: Vec<Imu>,
    notices: Vec<Notice>,
    fixes: PositionSearch,
    headings: HeadingSearch,
    /// Temperatures of the last messages, °C, until they are taken.
    #[serde(skip)]
    temperatures: Vec<(ImuId, f64)>,
    /// Latest temperature of each IMU that has one, °C.
    warmth: BTreeMap<ImuId, f64>,
}

/// A topic that the configuration names and the recording lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingTopic {
    /// Name in the configuration.
    pub topic: String,
    /// Topic of the recording with the most similar spelling.
    pub nearest: Option<String>,
}

/// Most numbers that are listed of a message without vectors.
const NUMBERS: usize = 12;
/// Number of zeros from the start after which a triad is reported as absent.
const ZEROS: u64 = 100;

impl Intake {
    /// Intake for the configured IMUs, and for every topic of a well-known type that they do not mention.
    pub fn new(imus: &[ImuConfig]) -> Self {
        let mut intake = Self {
            sources: Vec::new(),
            configured: imus.len(),
            topics: BTreeSet::new(),
            verdicts: BTreeMap::new(),
            routes: BTreeMap::new(),
            untold: BTreeMap::new(),
            readers: BTreeMap::new(),
            halves: BTreeMap::new(),
            pairs: BTreeMap::new(),
            imus: Vec::new(),
            notices: Vec::new(),
            fixes: PositionSearch::default(),
            headings: HeadingSearch::default(),
            temperatures: Vec::new(),
            warmth: BTreeMap::new(),
        };
        imus.iter().for_each(|imu| intake.add(Source::new(imu.clone())));
        intake
    }

    fn add(&mut self, source: Source) {
        let place = self.sources.len();
        source.topics().for_each(|topic| self.read_by(topic.to_owned(), place));
        self.sources.push(source);
    }

    fn read_by(&mut self, topic: String, source: usize) {
        let readers = self.readers.entry(topic).or_default();
        if let Err(place) = readers.binary_search(&source) {
            readers.insert(place, source);
        }
    }

    /// Whether the fields of a JSON channel are still unknown, until its first message.
    pub fn is_untold(&self) -> bool {
        !self.untold.is_empty()
    }

    /// Restricts positions to this topic.
    pub fn with_fix_topic(self, topic: Option<String>) -> Self {
        Self { fixes: PositionSearch::new(topic), ..self }
    }

    /// Reads headings from the topic of this reference.
    pub fn with_heading(self, heading: Option<HeadingConfig>) -> Self {
        Self { headings: HeadingSearch::new(heading), ..self }
    }

    /// Adds a channel and returns its role, as far as it is known. Repeating a channel changes nothing.
    pub fn channel(&mut self, channel: &record::Channel, schema: Option<&record::Schema>) -> &ChannelRole {
        if !self.verdicts.contains_key(&channel.id) {
            self.topics.insert(channel.topic.clone());
            let verdict = match Layout::new(&channel.message_encoding, schema) {
                _ if topic::is_annotation(&channel.topic) => ChannelRole::Annotation,
                Ok(layout) => self.judge(channel.id, &channel.topic, &layout),
                Err(SchemaError::Untold) => {
                    self.untold.insert(channel.id, channel.clone());
                    ChannelRole::Untold
                }
                Err(error) => ChannelRole::Skipped(error.to_string()),
            };
            self.verdicts.insert(channel.id, verdict);
        }
        self.verdict(channel.id)
    }

    /// Role of a channel. It may change with later channels, or with its first message.
    pub fn verdict(&self, channel_id: u16) -> &ChannelRole {
        self.verdicts.get(&channel_id).unwrap_or(&ChannelRole::Annotation)
    }

    /// Whether messages of this channel are needed.
    pub fn wants(&self, channel_id: u16) -> bool {
        self.routes.contains_key(&channel_id)
            || self.untold.contains_key(&channel_id)
            || self.fixes.wants(channel_id)
            || self.headings.wants(channel_id)
    }

    /// Whether an IMU has its sensors on several channels, or a gyroscope on another one may yet appear.
    pub fn may_have_parts(&self) -> bool {
        let mut channels: BTreeMap<usize, u16> = BTreeMap::new();
        let mut routes = self.routes.iter().flat_map(|(id, routes)| routes.iter().map(|route| (route.source, *id)));
        let silent = |imu: &Imu| imu.silent.get(Sensor::Gyroscope.index()) != Some(&false);
        self.imus.is_empty()
            || self.imus.iter().any(silent)
            || routes.any(|(source, id)| *channels.entry(source).or_insert(id) != id)
    }

    /// Channels of each IMU that has its sensors on several.
    pub fn parts(&self) -> impl Iterator<Item = BTreeSet<u16>> {
        let mut channels: BTreeMap<usize, BTreeSet<u16>> = BTreeMap::new();
        for (&id, routes) in &self.routes {
            routes.iter().for_each(|route| _ = channels.entry(route.source).or_default().insert(id));
        }
        channels.into_values().filter(|channels| channels.len() > 1)
    }

    /// Stamp of the last message of a channel; `None` where messages hold several readings.
    pub fn last_stamp(&self, channel_id: u16) -> Option<Stamp> {
        self.routes.get(&channel_id)?.first().filter(|route| !route.has_batches())?.stamp
    }

    /// Stamp of a message that was not added yet.
    pub fn stamp(&self, channel_id: u16, log_time: u64, data: &[u8]) -> Option<Stamp> {
        self.routes.get(&channel_id)?.first()?.stamp_of(data, log_time)
    }

    /// Indices of the requested IMUs that read a channel.
    pub fn sources_on(&self, channel_id: u16) -> impl Iterator<Item = usize> {
        self.routes.get(&channel_id).into_iter().flatten().map(|route| route.source)
    }

    /// Adds a message. Returns the position of the recording, if this message is the first with a valid one.
    pub fn fix(&mut self, channel_id: u16, data: &[u8]) -> Option<Position> {
        self.fixes.message(channel_id, data)
    }

    /// Heading in a message, if it is one of the heading reference.
    pub fn heading(&mut self, channel_id: u16, log_time: u64, data: &[u8]) -> Option<Heading> {
        self.headings.message(channel_id, log_time, data)
    }

    /// Reason why a topic that an IMU is read from is no heading reference.
    pub fn heading_fault(&self) -> Option<String> {
        self.headings.fault()
    }

    /// Note that no message of the heading reference had a heading, once all are read.
    pub fn heading_unread(&self) -> Option<String> {
        self.headings.unread()
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
        self.listen(channel_id, data);
        self.temperatures.clear();
        let Self { sources, imus, notices, routes, temperatures, warmth, .. } = self;
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
                warmth.insert(id, celsius);
            }
        }
    }

    /// Takes the temperatures in the last message, °C, each with its IMU.
    pub fn take_temperatures(&mut self) -> impl Iterator<Item = (ImuId, f64)> {
        self.temperatures.drain(..)
    }

    /// Latest temperature of an IMU, °C, if it has had one.
    pub fn temperature(&self, imu: ImuId) -> Option<f64> {
        self.warmth.get(&imu).copied()
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
        for route in self.routes.get(&channel_id).into_iter().flatten() {
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
        for route in self.routes.values().flatten() {
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
        let imu = accel.and_then(|tap| self.imus.get(tap.last?.index()));
        imu.map_or(route.topic.as_str(), |imu| &imu.name)
    }

    /// IMUs seen so far, by [`ImuId`].
    pub fn imus(&self) -> &[Imu] {
        &self.imus
    }

    /// Refusals so far, by topic.
    pub fn faults(&self) -> Vec<RefusalCount> {
        let mut faults = Vec::new();
        for route in self.routes.values().flatten() {
            let whole = route.counts.iter().map(|(cause, count)| (None, cause, count));
            let parts = route
                .taps
                .iter()
                .flat_map(|tap| tap.counts.iter().map(|(cause, count)| (Some(tap.name.clone()), cause, count)));
            let parts = parts.filter(|&(_, cause, count)| cause != Cause::Zero || count >= ZEROS);
            faults.extend(whole.chain(parts).map(|(sensor, cause, count)| {
                let detail = route.malformed.clone().filter(|_| cause == Cause::Malformed && sensor.is_none());
                RefusalCount { topic: route.topic.clone(), sensor, cause, count, detail }
            }));
        }
        faults
    }

    /// Reasons why topics that might be IMUs are none so far, one line each.
    pub fn obstacles(&self) -> Vec<String> {
        let none_seen = |route: &&Route| self.sources.get(route.source).is_some_and(|source| source.imus.is_empty());
        let mut topics: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for route in self.routes.values().flatten().filter(none_seen) {
            let reasons = topics.entry(&route.topic).or_default();
            let refused = !route.counts.is_empty() || route.taps.iter().any(|tap| !tap.counts.is_empty());
            if route.messages == 0 && !refused {
                reasons.push("has no messages".to_owned());
            } else if route.is_gyroscope_alone() {
                reasons.push("is a gyroscope alone; an IMU needs an accelerometer".to_owned());
            }
        }
        for half in self.halves.values().filter(|half| half.side == Side::Gyroscope && half.source.is_none()) {
            let paired = self.halves.values().any(|other| other.fits(half));
            if (half.gyro.is_some() || half.vector.is_some()) && !paired {
                topics
                    .entry(&half.topic)
                    .or_default()
                    .push("is a gyroscope alone; an IMU needs an accelerometer".to_owned());
            }
        }
        let faults = self.faults();
        let refused = faults.iter().filter(|fault| topics.contains_key(&*fault.topic)).map(ToString::to_string);
        let told =
            topics.iter().flat_map(|(topic, reasons)| reasons.iter().map(move |reason| format!("{topic} {reason}")));
        told.chain(refused).collect()
    }

    /// Takes the notices since the last call: each once, in the order of their occurrence.
    pub fn take_notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Topics that the configuration names and no channel has had so far.
    pub fn missing_topics(&self) -> Vec<MissingTopic> {
        let configured = self.sources.iter().take(self.configured);
        let missing: BTreeSet<_> = configured
            .flat_map(Source::topics)
            .chain(self.fixes.topic())
            .chain(self.headings.topic())
            .filter(|&t| !self.topics.contains(t))
            .collect();
        let nearest = |topic: &str| nearest(topic, self.topics.iter().cloned());
        missing.into_iter().map(|topic| MissingTopic { topic: topic.to_owned(), nearest: nearest(topic) }).collect()
    }

    /// Determines the role of a JSON channel without schema by its first message.
    fn listen(&mut self, channel_id: u16, data: &[u8]) {
        let Some(channel) = self.untold.get(&channel_id) else { return };
        let Some(layout) = Layout::of_example("the message", data) else { return };
        let topic = channel.topic.clone();
        self.untold.remove(&channel_id);
        let verdict = self.judge(channel_id, &topic, &layout);
        self.verdicts.insert(channel_id, verdict);
    }

    fn judge(&mut self, channel_id: u16, topic: &str, layout: &Layout) -> ChannelRole {
        // A message may hold a heading and a position, or be that of an IMU.
        let heading = self.headings.channel(channel_id, topic, layout);
        let position = match self.fixes.channel(channel_id, topic, layout) {
            Ok(is_one) => is_one.then_some(ChannelRole::Position),
            Err(error) => Some(ChannelRole::Skipped(error.to_string())),
        };
        match (position, &heading) {
            (Some(ChannelRole::Skipped(_)), Ok(Some(path))) => return ChannelRole::Heading { path: path.clone() },
            (Some(role), Ok(_)) => return role,
            (Some(role), Err(error)) => {
                self.headings.refuse(error);
                return role;
            }
            (None, _) => {}
        }
        match (heading, self.judge_readings(channel_id, topic, layout)) {
            (Ok(Some(path)), ChannelRole::Other { .. }) => ChannelRole::Heading { path },
            // That it is no IMU is no fault, unless it was meant to be one.
            (Ok(Some(path)), ChannelRole::Skipped(_)) if !self.is_mentioned(topic) => ChannelRole::Heading { path },
            (Err(error), ChannelRole::Other { .. }) => ChannelRole::Skipped(error.to_string()),
            (Err(error), role) => {
                self.headings.refuse(&error);
                role
            }
            (Ok(_), role) => role,
        }
    }

    /// Role of a channel by what an IMU reads from it.
    fn judge_readings(&mut self, channel_id: u16, topic: &str, layout: &Layout) -> ChannelRole {
        let known = known(layout);
        let imus: Vec<_> = known.iter().filter(|known| known.imu).collect();
        let by_itself = !self.is_mentioned(topic);
        if by_itself {
            imus.iter().for_each(|known| self.add(Source::found(topic, known, imus.len() == 1)));
        }
        let (mut uses, mut temperature) = (Vec::new(), None);
        let mut fault = None;
        for &i in self.readers.get(topic).into_iter().flatten() {
            let Some(source) = self.sources.get(i) else { continue };
            let known = source.known(&known);
            let (requests, warmth) = (source.requests(topic, known), source.temperature(topic, known));
            if requests.is_empty() && warmth.is_none() {
                continue;
            }
            match Route::new(topic, layout, known, i, &requests, warmth) {
                Ok(route) => {
                    let path = route.temperature_path().map(str::to_owned);
                    temperature = temperature.or(path.map(|path| (source.name(), path)));
                    uses.extend(route.taps.iter().map(|tap| tap.used_by(source.name())));
                    self.routes.entry(channel_id).or_default().push(route);
                }
                Err(error) => fault = fault.or(Some(error.to_string())),
            }
        }
        let verdict = match (uses.is_empty(), fault, temperature) {
            (false, ..) => ChannelRole::Used(uses),
            (true, Some(fault), _) => ChannelRole::Skipped(fault),
            (true, None, Some((imu, path))) => ChannelRole::Temperature { imu, path },
            (true, None, None) => other(topic, layout),
        };
        let half = if by_itself { PairedTopic::new(topic, layout.name()) } else { None };
        match (half, known.as_slice()) {
            (Some(half), [known]) => self.pair(channel_id, half, layout, known, verdict),
            (Some(half), []) => self.offer_pair(channel_id, half, layout, verdict),
            _ => verdict,
        }
    }

    /// Suggests two halves of an IMU together if their types are not known.
    fn offer_pair(
        &mut self,
        channel_id: u16,
        mut half: PairedTopic,
        layout: &Layout,
        mut verdict: ChannelRole,
    ) -> ChannelRole {
        half.vector = Suggestion::only_vector(layout);
        let other = self.halves.iter().find(|(_, other)| half.vector.is_some() && other.fits(&half));
        let other = other.map(|(&id, other)| (id, other.clone()));
        self.halves.insert(channel_id, half.clone());
        let Some((other_id, other)) = other else { return verdict };
        let (Some(own), Some(others)) = (half.vector.clone(), other.vector.clone()) else { return verdict };
        let (own, others) = ((&*half.topic, own), (&*other.topic, others));
        let (role, offered) = match half.side {
            Side::Accelerometer => (Some(&mut verdict), Suggestion::of_vectors(own, others)),
            Side::Gyroscope => (self.verdicts.get_mut(&other_id), Suggestion::of_vectors(others, own)),
        };
        if let Some(ChannelRole::Other { suggestion, .. }) = role {
            *suggestion = Some(Box::new(offered));
        }
        verdict
    }

    /// Joins two halves of an IMU once both are known.
    fn pair(
        &mut self,
        channel_id: u16,
        mut half: PairedTopic,
        layout: &Layout,
        known: &KnownType,
        verdict: ChannelRole,
    ) -> ChannelRole {
        let route = self.routes.get(&channel_id).and_then(|routes| routes.first());
        half.source = route.map(|route| route.source);
        if half.side == Side::Gyroscope {
            let request = known.gyro.as_ref().map(Request::other_half);
            half.gyro =
                request.and_then(|request| Route::new(&half.topic, layout, Some(known), 0, &[request], None).ok());
        }
        let alike = self.pairs.entry(half.common()).or_default();
        let mut others = alike.iter().filter_map(|id| Some((*id, self.halves.get(id)?)));
        let other = others.find(|(_, other)| other.fits(&half)).map(|(id, other)| (id, other.clone()));
        alike.insert(channel_id);
        self.halves.insert(channel_id, half.clone());
        let Some((other_id, other)) = other else { return verdict };
        self.verdicts.insert(channel_id, verdict);
        match half.side {
            Side::Accelerometer => self.join((channel_id, &half), (other_id, &other)),
            Side::Gyroscope => self.join((other_id, &other), (channel_id, &half)),
        }
        self.verdicts.get(&channel_id).cloned().unwrap_or(ChannelRole::Annotation)
    }

    /// Assigns the gyroscope of one channel to the accelerometer of another, unless either is already an IMU. For types
    /// that are not an IMU by themselves this is only suggested.
    fn join(&mut self, (accel_id, accel): (u16, &PairedTopic), (gyro_id, gyro): (u16, &PairedTopic)) {
        let Some(mut route) = gyro.gyro.clone() else { return };
        let Some(source) = accel.source else {
            let suggestion = Suggestion::of_halves(&accel.topic, &gyro.topic);
            if let Some(ChannelRole::Other { suggestion: offered, .. }) = self.verdicts.get_mut(&accel_id) {
                *offered = Some(Box::new(suggestion));
            }
            return;
        };
        let is_imu =
            |source: Option<usize>| source.and_then(|i| self.sources.get(i)).is_some_and(|s| !s.imus.is_empty());
        let of_accel = |imu: &&mut Imu| imu.topic == accel.topic;
        let has_gyro = |imu: &Imu| imu.silent.get(Sensor::Gyroscope.index()) == Some(&false);
        if is_imu(gyro.source) || self.imus.iter().any(|imu| imu.topic == accel.topic && has_gyro(imu)) {
            return;
        }
        let Some(owner) = self.sources.get_mut(source) else { return };
        owner.gyro_on(&gyro.topic);
        let name = owner.name();
        self.read_by(gyro.topic.clone(), source);
        route.source = source;
        // The accelerometer and the gyroscope of a device have different identifiers.
        route.in_order = route.has_devices();
        for imu in self.imus.iter_mut().filter(of_accel) {
            imu.triads.retain(|triad| triad.sensor != Sensor::Gyroscope);
            imu.triads.insert(1, Triad::gyroscope(&gyro.topic));
        }
        let uses = route.taps.iter().map(|tap| tap.used_by(name.clone())).collect();
        self.verdicts.insert(gyro_id, ChannelRole::Used(uses));
        self.routes.insert(gyro_id, vec![route]);
        if let Some(ChannelRole::Used(uses)) = self.verdicts.get_mut(&accel_id) {
            uses.retain(|used| used.sensor != Sensor::Gyroscope);
        }
        for route in self.routes.get_mut(&accel_id).into_iter().flatten() {
            route.taps.retain(|tap| tap.sensor != Sensor::Gyroscope);
        }
    }

    fn is_mentioned(&self, topic: &str) -> bool {
        self.readers.contains_key(topic)
    }
}

/// Role of a channel that nothing is read from so far.
fn other(topic: &str, layout: &Layout) -> ChannelRole {
    let vectors = [layout.vectors(), layout.listed_vectors()].concat();
    let suggestion = Suggestion::of(topic, layout).map(Box::new);
    if let Some(why) = puzzle(topic, layout).filter(|_| vectors.is_empty() && suggestion.is_none()) {
        return ChannelRole::Skipped(why);
    }
    let numbers = if vectors.is_empty() { layout.floats(NUMBERS) } else { Vec::new() };
    let numbers = if numbers.len() < 3 { Vec::new() } else { numbers };
    ChannelRole::Other { vectors, numbers, suggestion }
}

/// Whether the last message shows that its accelerometer exists.
fn appears(route: &Route) -> bool {
    let accel = route.taps.iter().find(|tap| tap.sensor == Sensor::Accelerometer);
    accel.is_some_and(|tap| route.value(tap).is_ok_and(|value| !is_zero(&value)))
}
