//! The door of the house: channels and messages in, samples out. It knows nothing of rests; it decides what an IMU is,
//! when a sample was measured, and what is refused.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::fix::{Fix, Fixes};
use super::known::{known, suggestion};
use super::layout::Layout;
use super::lookup::nearest;
use super::route::{Route, Tap};
use super::source::Source;
use super::verdict::{Cause, Fault, Notice, Use, Verdict};
use super::{ImuConfig, ImuId, Preset, Sample, Sensor};
use crate::record;

/// Turns the messages of a recording into samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intake {
    /// The configured ones first.
    sources: Vec<Source>,
    configured: usize,
    topics: BTreeSet<String>,
    verdicts: BTreeMap<u16, Verdict>,
    routes: BTreeMap<u16, Route>,
    imus: Vec<Imu>,
    notices: Vec<Notice>,
    fixes: Fixes,
}

/// An IMU that has been seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// What its annotation topics begin with. No two IMUs share one.
    pub name: String,
    /// Topic of its accelerometer.
    pub topic: String,
    /// Coordinate frame that its readings are in, as far as the messages tell.
    pub frame_id: String,
    /// Its triads as far as channels for them have been seen or configured.
    pub triads: Vec<Triad>,
    /// By [`Sensor::index`]: whether it has read nothing but zeros so far.
    silent: Vec<bool>,
}

/// One triad of an IMU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Triad {
    /// Which one it is.
    pub sensor: Sensor,
    /// `accelerometer`, `gyroscope`, or the configured name of the secondary.
    pub name: String,
    /// Topic that its readings come from.
    pub topic: String,
    /// Which sensor it is, if the configuration says so.
    pub preset: Option<Preset>,
}

/// A topic that the configuration names and the recording lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingTopic {
    /// Its name.
    pub topic: String,
    /// The topic of the recording that is spelt most like it.
    pub nearest: Option<String>,
}

/// After so many zeros from the start, a triad is said to be absent.
const ZEROS: u64 = 100;

/// `frame_id`s on one topic beyond which they are taken for noise.
const MAX_FRAMES: usize = 16;

impl Intake {
    /// An intake for the configured IMUs, and for every topic of a well-known type that these do not mention.
    pub fn new(imus: &[ImuConfig]) -> Self {
        Self {
            sources: imus.iter().cloned().map(Source::new).collect(),
            configured: imus.len(),
            topics: BTreeSet::new(),
            verdicts: BTreeMap::new(),
            routes: BTreeMap::new(),
            imus: Vec::new(),
            notices: Vec::new(),
            fixes: Fixes::default(),
        }
    }

    /// The same, with positions from this topic alone.
    pub fn with_fix_topic(self, topic: Option<String>) -> Self {
        Self { fixes: Fixes::new(topic), ..self }
    }

    /// Learns of a channel, and says what it is used for. Repeating a channel changes nothing.
    pub fn channel(&mut self, channel: &record::Channel, schema: Option<&record::Schema>) -> &Verdict {
        if !self.verdicts.contains_key(&channel.id) {
            self.topics.insert(channel.topic.clone());
            let verdict = self.judge(channel, schema);
            self.verdicts.insert(channel.id, verdict);
        }
        self.verdicts.get(&channel.id).unwrap_or(&Verdict::Annotation)
    }

    /// Whether messages of this channel are of any use.
    pub fn wants(&self, channel_id: u16) -> bool {
        self.routes.contains_key(&channel_id) || self.fixes.wants(channel_id)
    }

    /// Takes a message, and says where the recording is made if it is the first that tells.
    pub fn fix(&mut self, channel_id: u16, data: &[u8]) -> Option<Fix> {
        self.fixes.message(channel_id, data)
    }

    /// Takes a message, and hands its samples to `sink`: those of the accelerometer last, since it is by them that an
    /// IMU's state is evaluated. Messages of channels that are not used, and readings before the first message of
    /// their IMU's accelerometer, are passed over.
    pub fn message(
        &mut self,
        channel_id: u16,
        log_time: u64,
        data: &[u8],
        sink: &mut impl FnMut(ImuId, Sensor, Sample),
    ) {
        let Self { sources, imus, notices, routes, .. } = self;
        let Some(route) = routes.get_mut(&channel_id) else { return };
        let mut notice = |topic: &str, text: String| {
            notices.push(Notice { log_time, topic: topic.to_owned(), text: format!("{topic}{text}") });
        };
        if i64::try_from(log_time).is_err() {
            if route.counts.count(Cause::LogTime) == 1 {
                notice(&route.topic, format!(": a message is refused: {}", Cause::LogTime));
            }
            return;
        }
        let (stamp, frame) = match route.read(log_time, data) {
            Ok(read) => read,
            Err(error) => {
                if route.counts.count(Cause::Malformed) == 1 {
                    notice(&route.topic, format!(": a message is refused: {error}"));
                }
                return;
            }
        };
        for i in 0..route.taps.len() {
            let Some(tap) = route.taps.get(i) else { return };
            let reading = match owner(sources, imus, route, tap, frame) {
                None => continue,
                Some(Err(cause)) => Err(cause),
                Some(Ok(id)) => route.value(tap).and_then(|value| admit(imus, id, tap.sensor, value)).map(|v| (id, v)),
            };
            match reading {
                Ok((id, value)) => sink(id, tap.sensor, Sample { stamp, log_time, value }),
                Err(cause) => {
                    let Some(tap) = route.taps.get_mut(i) else { return };
                    if tap.counts.count(cause) == (if cause == Cause::Zero { ZEROS } else { 1 }) {
                        notice(&route.topic, format!(", {}: {cause}", tap.name));
                    }
                }
            }
        }
    }

    /// The IMUs seen so far, by [`ImuId`].
    pub fn imus(&self) -> &[Imu] {
        &self.imus
    }

    /// What was refused so far, by topic.
    pub fn faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        for route in self.routes.values() {
            let whole = route.counts.iter().map(|(cause, count)| (None, cause, count));
            let parts = route
                .taps
                .iter()
                .flat_map(|tap| tap.counts.iter().map(|(cause, count)| (Some(tap.name.clone()), cause, count)));
            let parts = parts.filter(|&(_, cause, count)| cause != Cause::Zero || count >= ZEROS);
            faults.extend(whole.chain(parts).map(|(sensor, cause, count)| Fault {
                topic: route.topic.clone(),
                sensor,
                cause,
                count,
            }));
        }
        faults
    }

    /// What people should know and have not been told: each thing once, in the order in which it was seen.
    pub fn take_notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// Topics that the configuration names and no channel has had so far.
    pub fn missing_topics(&self) -> Vec<MissingTopic> {
        let configured = self.sources.iter().take(self.configured);
        let missing: BTreeSet<_> = configured
            .flat_map(Source::topics)
            .chain(self.fixes.topic())
            .filter(|&t| !self.topics.contains(t))
            .collect();
        let nearest = |topic: &str| nearest(topic, self.topics.iter().cloned());
        missing.into_iter().map(|topic| MissingTopic { topic: topic.to_owned(), nearest: nearest(topic) }).collect()
    }

    fn judge(&mut self, channel: &record::Channel, schema: Option<&record::Schema>) -> Verdict {
        if channel.topic.contains("/stillpoint/") {
            return Verdict::Annotation;
        }
        let layout = match Layout::new(&channel.message_encoding, schema) {
            Ok(layout) => layout,
            Err(error) => return Verdict::Skipped(error.to_string()),
        };
        match self.fixes.channel(channel.id, &channel.topic, &layout) {
            Ok(true) => return Verdict::Position,
            Ok(false) => {}
            Err(error) => return Verdict::Skipped(error.to_string()),
        }
        let known = known(layout.name());
        if known.is_some_and(|known| known.imu) && !self.is_mentioned(&channel.topic) {
            self.sources.push(Source::new(ImuConfig { topic: channel.topic.clone(), ..ImuConfig::default() }));
        }
        let requests = self.sources.iter().enumerate();
        let requests =
            requests.flat_map(|(i, source)| source.requests(&channel.topic, known).into_iter().map(move |r| (i, r)));
        let requests: Vec<_> = requests.collect();
        if requests.is_empty() {
            let vectors = layout.vectors();
            let suggestion = suggestion(&channel.topic, &vectors);
            return Verdict::Other { vectors, suggestion };
        }
        match Route::new(&channel.topic, &layout, &requests) {
            Err(error) => Verdict::Skipped(error.to_string()),
            Ok(route) => {
                let uses = route.taps.iter().map(|tap| Use {
                    imu: self.sources.get(tap.source).map(Source::name).unwrap_or_default(),
                    sensor: tap.sensor,
                    name: tap.name.clone(),
                    path: tap.path.clone(),
                });
                let verdict = Verdict::Used(uses.collect());
                self.routes.insert(channel.id, route);
                verdict
            }
        }
    }

    fn is_mentioned(&self, topic: &str) -> bool {
        self.sources.iter().any(|source| source.topics().any(|own| own == topic))
    }
}

/// Whose reading it is; nobody's before the IMU has been seen.
fn owner(
    sources: &mut [Source],
    imus: &mut Vec<Imu>,
    route: &Route,
    tap: &Tap,
    frame: &[u8],
) -> Option<Result<ImuId, Cause>> {
    let source = sources.get_mut(tap.source)?;
    if tap.with_accel {
        let known = source.imus.iter().find(|(own, _)| own == frame).map(|&(_, id)| id);
        let id = known.or_else(|| add(source, imus, route, tap.source, frame));
        Some(id.ok_or(Cause::TooManyFrames))
    } else if route.frame.as_deref() == Some(frame) {
        source.imus.first().map(|&(_, id)| Ok(id))
    } else {
        Some(Err(Cause::ForeignFrame))
    }
}

/// Adds the IMU of a new `frame_id`, unless there are too many already.
fn add(source: &mut Source, imus: &mut Vec<Imu>, route: &Route, index: usize, frame: &[u8]) -> Option<ImuId> {
    if source.imus.len() >= MAX_FRAMES {
        return None;
    }
    let id = ImuId(imus.len());
    let frame_id = String::from_utf8_lossy(frame).into_owned();
    let first = source.imus.is_empty();
    let gyro = route.taps.iter().any(|tap| (tap.source, tap.sensor) == (index, Sensor::Gyroscope));
    let triads = source.triads(gyro).filter(|(.., topic)| first || *topic == source.topic());
    let triad = |(sensor, name, topic): (_, &str, &str)| {
        let preset = source.preset(sensor);
        Triad { sensor, name: name.to_owned(), topic: topic.to_owned(), preset }
    };
    let triads = triads.map(triad).collect();
    let silent = vec![true; 2 + source.secondaries()];
    let name = free_name(source.name(), (!first).then_some(&frame_id), imus);
    imus.push(Imu { name, topic: source.topic().to_owned(), frame_id, triads, silent });
    source.imus.push((frame.to_vec(), id));
    Some(id)
}

/// Lets a value through, unless the triad has read nothing but zeros so far.
fn admit(imus: &mut [Imu], id: ImuId, sensor: Sensor, value: Vector3<f64>) -> Result<Vector3<f64>, Cause> {
    let silent = imus.get_mut(id.0).and_then(|imu| imu.silent.get_mut(sensor.index()));
    if let Some(silent @ true) = silent {
        *silent = value.iter().all(|&axis| axis == 0.0);
        if *silent {
            return Err(Cause::Zero);
        }
    }
    Ok(value)
}

/// A name that no IMU has yet: the base, with the frame appended if it is not the first one, and a number if need be.
fn free_name(base: String, frame: Option<&String>, imus: &[Imu]) -> String {
    let legal = |c: char| if c.is_ascii_alphanumeric() || c == '/' { c } else { '_' };
    let base = match frame {
        Some(frame) => format!("{base}/{}", frame.trim_matches('/').chars().map(legal).collect::<String>()),
        None => base,
    };
    let taken = |name: &str| imus.iter().any(|imu| imu.name == name);
    let numbered = (2..).map(|n| format!("{base}_{n}"));
    std::iter::once(base.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or(base)
}
