//! Assignment of channels to IMUs: which source reads which channel, and what the other channels are.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::channel_role::ChannelRole;
use super::heading::HeadingSearch;
use super::known_types::{KnownType, known};
use super::paired_topics::{Halves, PairedTopic, Side};
use super::position::PositionSearch;
use super::registry::{Imu, Triad};
use super::request::Request;
use super::route::Route;
use super::source::Source;
use super::suggestion::{Suggestion, puzzle};
use crate::imu::config::ImuConfig;
use crate::imu::sample::Sensor;
use crate::imu::schema::layout::{Layout, SchemaError};
use crate::record;
use crate::topic;

/// Channels seen so far with their roles, and the IMUs whose readings come from them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Assignment {
    /// Sources, the configured ones first.
    pub(in crate::imu) sources: Vec<Source>,
    pub(in crate::imu) configured: usize,
    pub(in crate::imu) topics: BTreeSet<String>,
    roles: BTreeMap<u16, ChannelRole>,
    /// Routes by channel: one for each source that reads it.
    pub(in crate::imu) routes: BTreeMap<u16, Vec<Route>>,
    /// JSON channels whose first message will show their fields.
    untold: BTreeMap<u16, record::Channel>,
    /// Sources that read a topic.
    readers: BTreeMap<String, Vec<usize>>,
    pub(in crate::imu) halves: Halves,
    pub(in crate::imu) imus: Vec<Imu>,
    /// Schemas read so far, by name and length, and the bytes of those that were read again for another channel.
    read: BTreeSet<(String, usize)>,
    again: usize,
    /// Most IMUs that no configuration names.
    pub(in crate::imu) most: usize,
    pub(in crate::imu) positions: PositionSearch,
    pub(in crate::imu) headings: HeadingSearch,
}

/// Longest topic that is read, bytes: it is part of the name of each annotation topic.
const LONGEST_TOPIC: usize = 4096;
/// Most bytes of schemas that are read again for a further channel that has them (8 MiB): that of an IMU for 10,000 of them.
const AGAIN: usize = 8 << 20;
/// Most numbers that are listed of a message without vectors.
const NUMBERS: usize = 12;

impl Assignment {
    /// Assignment for the configured IMUs, and for every topic of a well-known type that they do not mention.
    pub(in crate::imu) fn new(imus: &[ImuConfig]) -> Self {
        let mut assignment = Self {
            sources: Vec::new(),
            configured: imus.len(),
            topics: BTreeSet::new(),
            roles: BTreeMap::new(),
            routes: BTreeMap::new(),
            untold: BTreeMap::new(),
            readers: BTreeMap::new(),
            halves: Halves::default(),
            imus: Vec::new(),
            read: BTreeSet::new(),
            again: 0,
            most: usize::MAX,
            positions: PositionSearch::default(),
            headings: HeadingSearch::default(),
        };
        imus.iter().for_each(|imu| assignment.add(Source::new(imu.clone())));
        assignment
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
    pub(in crate::imu) fn is_untold(&self) -> bool {
        !self.untold.is_empty()
    }

    /// Adds a channel and returns its role, as far as it is known. Repeating a channel changes nothing.
    pub(in crate::imu) fn channel(
        &mut self,
        channel: &record::Channel,
        schema: Option<&record::Schema>,
    ) -> &ChannelRole {
        if !self.roles.contains_key(&channel.id) {
            self.topics.insert(channel.topic.clone());
            let role = match self.layout(channel, schema) {
                _ if channel.topic.len() > LONGEST_TOPIC => ChannelRole::Skipped(format!(
                    "its topic has {} bytes, {LONGEST_TOPIC} at most are read",
                    channel.topic.len()
                )),
                _ if topic::is_annotation(&channel.topic) => ChannelRole::Annotation,
                Ok(layout) => self.assign(channel.id, &channel.topic, &layout),
                Err(SchemaError::Untold) => {
                    self.untold.insert(channel.id, channel.clone());
                    ChannelRole::Untold
                }
                Err(error) => ChannelRole::Skipped(error.to_string()),
            };
            self.roles.insert(channel.id, role);
        }
        self.role(channel.id)
    }

    /// Layout of a channel's messages. Reading it takes its time, so of the channels that share a schema only so many are
    /// looked at, and those that the configuration names.
    fn layout(&mut self, channel: &record::Channel, schema: Option<&record::Schema>) -> Result<Layout, SchemaError> {
        if let Some(schema) = schema
            && !self.read.insert((schema.name.clone(), schema.data.len()))
        {
            self.again = self.again.saturating_add(schema.data.len());
            let named = [self.positions.topic(), self.headings.topic()].contains(&Some(&*channel.topic));
            if self.again > AGAIN && !named && !self.is_mentioned(&channel.topic) {
                return Err(SchemaError::Again);
            }
        }
        Layout::new(&channel.message_encoding, schema)
    }

    /// Role of a channel. It may change with later channels, or with its first message.
    pub(in crate::imu) fn role(&self, channel_id: u16) -> &ChannelRole {
        self.roles.get(&channel_id).unwrap_or(&ChannelRole::Annotation)
    }

    /// Whether messages of this channel are needed.
    pub(in crate::imu) fn wants(&self, channel_id: u16) -> bool {
        self.routes.contains_key(&channel_id)
            || self.untold.contains_key(&channel_id)
            || self.positions.wants(channel_id)
            || self.headings.wants(channel_id)
    }

    /// Whether an IMU has its sensors on several channels, or a gyroscope on another one may yet appear.
    pub(in crate::imu) fn may_have_parts(&self) -> bool {
        let mut channels: BTreeMap<usize, u16> = BTreeMap::new();
        let mut routes = self.routes.iter().flat_map(|(id, routes)| routes.iter().map(|route| (route.source, *id)));
        let silent = |imu: &Imu| imu.silent.get(Sensor::Gyroscope.index()) != Some(&false);
        self.imus.is_empty()
            || self.imus.iter().any(silent)
            || routes.any(|(source, id)| *channels.entry(source).or_insert(id) != id)
    }

    /// Channels of each IMU that has its sensors on several.
    pub(in crate::imu) fn parts(&self) -> impl Iterator<Item = BTreeSet<u16>> {
        let mut channels: BTreeMap<usize, BTreeSet<u16>> = BTreeMap::new();
        for (&id, routes) in &self.routes {
            routes.iter().for_each(|route| _ = channels.entry(route.source).or_default().insert(id));
        }
        channels.into_values().filter(|channels| channels.len() > 1)
    }

    /// Determines the role of a JSON channel without schema by its first message.
    pub(in crate::imu) fn assign_by_message(&mut self, channel_id: u16, data: &[u8]) {
        let Some(channel) = self.untold.get(&channel_id) else { return };
        let Some(layout) = Layout::of_example("the message", data) else { return };
        let topic = channel.topic.clone();
        self.untold.remove(&channel_id);
        let role = self.assign(channel_id, &topic, &layout);
        self.roles.insert(channel_id, role);
    }

    fn assign(&mut self, channel_id: u16, topic: &str, layout: &Layout) -> ChannelRole {
        // A message may hold a heading and a position, or be that of an IMU.
        let heading = self.headings.channel(channel_id, topic, layout);
        let position = match self.positions.channel(channel_id, topic, layout) {
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
        match (heading, self.assign_readings(channel_id, topic, layout)) {
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
    fn assign_readings(&mut self, channel_id: u16, topic: &str, layout: &Layout) -> ChannelRole {
        let known = known(layout);
        let imus: Vec<_> = known.iter().filter(|known| known.imu).collect();
        let by_itself = !self.is_mentioned(topic);
        if by_itself && !imus.is_empty() && self.sources.len() - self.configured + imus.len() > self.most {
            return ChannelRole::Skipped(format!(
                "one of more than {} IMUs, which limits.imus allows; an [[imu]] of the configuration names one that matters",
                self.most
            ));
        }
        if by_itself {
            imus.iter().for_each(|known| self.add(Source::found(topic, known, imus.len() == 1)));
        }
        let (mut uses, mut temperature) = (Vec::new(), None);
        let mut fault = None;
        for &i in self.readers.get(topic).into_iter().flatten() {
            let Some(source) = self.sources.get(i) else { continue };
            let known = source.known(&known);
            let (requests, temperature_request) = (source.requests(topic, known), source.temperature(topic, known));
            if requests.is_empty() && temperature_request.is_none() {
                continue;
            }
            match Route::new(topic, layout, known, i, &requests, temperature_request) {
                Ok(route) => {
                    let path = route.temperature_path().map(str::to_owned);
                    temperature = temperature.or(path.map(|path| (source.name(), path)));
                    uses.extend(route.taps.iter().map(|tap| tap.used_by(source.name())));
                    self.routes.entry(channel_id).or_default().push(route);
                }
                Err(error) => fault = fault.or(Some(error.to_string())),
            }
        }
        let role = match (uses.is_empty(), fault, temperature) {
            (false, ..) => ChannelRole::Used(uses),
            (true, Some(fault), _) => ChannelRole::Skipped(fault),
            (true, None, Some((imu, path))) => ChannelRole::Temperature { imu, path },
            (true, None, None) => other(topic, layout),
        };
        let half = if by_itself { PairedTopic::new(topic, layout.name()) } else { None };
        match (half, known.as_slice()) {
            (Some(half), [known]) => self.pair(channel_id, half, layout, known, role),
            (Some(half), []) => self.offer_pair(channel_id, half, layout, role),
            _ => role,
        }
    }

    /// Suggests two halves of an IMU together if their types are not known.
    fn offer_pair(
        &mut self,
        channel_id: u16,
        mut half: PairedTopic,
        layout: &Layout,
        mut role: ChannelRole,
    ) -> ChannelRole {
        half.vector = Suggestion::only_vector(layout);
        let Some((other_id, other)) = self.halves.add_unknown(channel_id, &half) else { return role };
        let (Some(own), Some(others)) = (half.vector.clone(), other.vector.clone()) else { return role };
        let (own, others) = ((&*half.topic, own), (&*other.topic, others));
        let (offering, offered) = match half.side {
            Side::Accelerometer => (Some(&mut role), Suggestion::of_vectors(own, others)),
            Side::Gyroscope => (self.roles.get_mut(&other_id), Suggestion::of_vectors(others, own)),
        };
        if let Some(ChannelRole::Other { suggestion, .. }) = offering {
            *suggestion = Some(Box::new(offered));
        }
        role
    }

    /// Joins two halves of an IMU once both are known.
    fn pair(
        &mut self,
        channel_id: u16,
        mut half: PairedTopic,
        layout: &Layout,
        known: &KnownType,
        role: ChannelRole,
    ) -> ChannelRole {
        let route = self.routes.get(&channel_id).and_then(|routes| routes.first());
        half.source = route.map(|route| route.source);
        if half.side == Side::Gyroscope {
            let request = known.gyro.as_ref().map(Request::other_half);
            half.gyro =
                request.and_then(|request| Route::new(&half.topic, layout, Some(known), 0, &[request], None).ok());
        }
        let Some((other_id, other)) = self.halves.add_known(channel_id, &half) else { return role };
        self.roles.insert(channel_id, role);
        match half.side {
            Side::Accelerometer => self.join((channel_id, &half), (other_id, &other)),
            Side::Gyroscope => self.join((other_id, &other), (channel_id, &half)),
        }
        self.roles.get(&channel_id).cloned().unwrap_or(ChannelRole::Annotation)
    }

    /// Assigns the gyroscope of one channel to the accelerometer of another, unless either is already an IMU. For types
    /// that are not an IMU by themselves this is only suggested.
    fn join(&mut self, (accel_id, accel): (u16, &PairedTopic), (gyro_id, gyro): (u16, &PairedTopic)) {
        let Some(mut route) = gyro.gyro.clone() else { return };
        let Some(source) = accel.source else {
            let suggestion = Suggestion::of_halves(&accel.topic, &gyro.topic);
            if let Some(ChannelRole::Other { suggestion: offered, .. }) = self.roles.get_mut(&accel_id) {
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
        self.roles.insert(gyro_id, ChannelRole::Used(uses));
        self.routes.insert(gyro_id, vec![route]);
        if let Some(ChannelRole::Used(uses)) = self.roles.get_mut(&accel_id) {
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
