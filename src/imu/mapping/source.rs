//! Requested IMUs, by the configuration or by a known type, with the topics and vectors of their triads.

use serde::{Deserialize, Serialize};

use super::known_types::KnownType;
use super::request::Request;
use super::thermometer::TemperatureRequest;
use crate::imu::config::SecondaryModel;
use crate::imu::config::{AccelUnit, CovarianceUse, ImuConfig, RateUnit, ReferenceConfig, VectorConfig};
use crate::imu::preset::Preset;
use crate::imu::sample::{ImuId, Quantity, Sensor};
use crate::imu::schema::path::FieldPath;

/// A table of the configuration, or a topic that needs none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Source {
    config: ImuConfig,
    /// Path of the IMU's message inside those of the topic, if there are several.
    inside: Option<FieldPath>,
    /// IMUs found on its accelerometer's topic, by `frame_id`.
    pub(in crate::imu) imus: Vec<(Vec<u8>, ImuId)>,
}

impl Source {
    pub(in crate::imu) fn new(config: ImuConfig) -> Self {
        Self { config, inside: None, imus: Vec::new() }
    }

    /// Source for a topic that needs no configuration, or for one of several IMUs in its messages.
    pub(in crate::imu) fn found(topic: &str, known: &KnownType, alone: bool) -> Self {
        let inside = known.inside.to_string().replace('.', "/");
        let name = (!alone).then(|| format!("{topic}/{inside}"));
        let config = ImuConfig { topic: topic.to_owned(), name, ..ImuConfig::default() };
        Self { config, inside: Some(known.inside.clone()), imus: Vec::new() }
    }

    /// Sets the topic of a gyroscope that was found on a topic of its own.
    pub(in crate::imu) fn gyro_on(&mut self, topic: &str) {
        self.config.gyro = Some(VectorConfig { topic: Some(topic.to_owned()), ..VectorConfig::default() });
    }

    /// Known type of its part of a message.
    pub(in crate::imu) fn known<'a>(&self, known: &'a [KnownType]) -> Option<&'a KnownType> {
        match (&self.inside, known) {
            (Some(inside), several) => several.iter().find(|known| known.inside == *inside),
            (None, [only]) => Some(only),
            (None, _) => None,
        }
    }

    /// Sensor model of a triad, if configured.
    pub(in crate::imu) fn preset(&self, sensor: Sensor) -> Option<Preset> {
        match sensor {
            Sensor::Secondary(i) => self.config.secondary.get(i)?.preset,
            Sensor::Accelerometer | Sensor::Gyroscope => self.config.preset,
            Sensor::Reference(_) => None,
        }
    }

    /// Measurement model of a triad, if it is a secondary accelerometer.
    pub(in crate::imu) fn model(&self, sensor: Sensor) -> SecondaryModel {
        match sensor {
            Sensor::Secondary(i) => {
                self.config.secondary.get(i).and_then(|secondary| secondary.model).unwrap_or_default()
            }
            _ => SecondaryModel::default(),
        }
    }

    /// First part of the names of its annotation topics.
    pub(in crate::imu) fn name(&self) -> String {
        match &self.config.name {
            Some(name) if name.starts_with('/') => name.clone(),
            Some(name) => format!("/{name}"),
            None => self.config.topic.clone(),
        }
    }

    /// Topic of the accelerometer.
    pub(in crate::imu) fn topic(&self) -> &str {
        own_topic(&self.config.accel).unwrap_or(&self.config.topic)
    }

    /// Topics that it reads.
    pub(in crate::imu) fn topics(&self) -> impl Iterator<Item = &str> {
        let others = (0..self.config.secondary.len()).map(|i| self.secondary_topic(i));
        let reference = self.config.reference.iter().flat_map(|reference| reference.topics());
        let temperature = self.config.temperature.as_ref().and_then(|temperature| temperature.topic.as_deref());
        [self.topic(), self.gyro_topic()].into_iter().chain(others).chain(reference).chain(temperature)
    }

    /// Names and topics of its triads. A gyroscope may also be known from the type of the accelerometer's messages.
    pub(in crate::imu) fn triads(&self, known_gyro: bool) -> impl Iterator<Item = (Sensor, &str, &str)> {
        let accel = (Sensor::Accelerometer, "accelerometer", self.topic());
        let gyro = (Sensor::Gyroscope, "gyroscope", self.gyro_topic());
        let others = self.config.secondary.iter().enumerate();
        let others = others.map(|(i, s)| (Sensor::Secondary(i), s.name.as_str(), self.secondary_topic(i)));
        let gyro = (known_gyro || self.config.gyro.is_some()).then_some(gyro);
        [accel].into_iter().chain(gyro).chain(others)
    }

    /// Units of its accelerometer and gyroscope, if configured.
    pub(in crate::imu) fn units(&self) -> (Option<AccelUnit>, Option<RateUnit>) {
        let ImuConfig { accel, gyro, .. } = &self.config;
        (accel.as_ref().and_then(|accel| accel.unit), gyro.as_ref().and_then(|gyro| gyro.unit))
    }

    /// Whether it has a reference.
    pub(in crate::imu) fn has_reference(&self) -> bool {
        self.config.reference.is_some()
    }

    /// Number of its secondary accelerometers.
    pub(in crate::imu) fn secondaries(&self) -> usize {
        self.config.secondary.len()
    }

    /// Requests to a topic whose type is `known`. The accelerometer's is the last, so that the other samples of a
    /// message come before it.
    pub(in crate::imu) fn requests<'a>(&'a self, topic: &str, known: Option<&'a KnownType>) -> Vec<Request<'a>> {
        let with_accel = topic == self.topic();
        let mut requests = Vec::new();
        let ignores_covariance = self.config.covariance == Some(CovarianceUse::Ignore);
        let gyro = self.config.gyro.as_ref();
        // A type that is not an IMU has one vector, which cannot be both triads.
        let own = with_accel && gyro.is_none_or(|gyro| gyro.path.is_none());
        let known_gyro = known.filter(|known| known.imu || !own).and_then(|known| known.gyro.as_ref());
        if topic == self.gyro_topic() && (gyro.is_some() || known_gyro.is_some()) {
            requests.push(Request {
                sensor: Sensor::Gyroscope,
                key: "gyro",
                name: "gyroscope",
                path: gyro.and_then(|gyro| gyro.path.as_ref()),
                known: known_gyro,
                plus: gyro.and_then(|gyro| gyro.plus.as_ref()),
                axes: gyro.and_then(|gyro| gyro.axes).unwrap_or_default(),
                ignores_covariance,
                factor: gyro.and_then(|gyro| gyro.unit).unwrap_or_default().factor(),
                with_accel,
            });
        }
        let accel = |config: Option<&'_ VectorConfig<AccelUnit>>| config.and_then(|c| c.unit).unwrap_or_default();
        let known_accel = known.and_then(|known| known.accel.as_ref());
        for (i, secondary) in self.config.secondary.iter().enumerate() {
            if topic == self.secondary_topic(i) {
                requests.push(Request {
                    sensor: Sensor::Secondary(i),
                    key: "accel",
                    name: &secondary.name,
                    path: secondary.accel.as_ref().and_then(|accel| accel.path.as_ref()),
                    known: known_accel.filter(|_| !with_accel),
                    plus: secondary.accel.as_ref().and_then(|accel| accel.plus.as_ref()),
                    axes: secondary.accel.as_ref().and_then(|accel| accel.axes).unwrap_or_default(),
                    ignores_covariance,
                    factor: accel(secondary.accel.as_ref()).factor(),
                    with_accel,
                });
            }
        }
        if let Some(reference) = &self.config.reference {
            let [force, rate] = reference.topics();
            // One vector cannot be both.
            let known_rate = known.filter(|known| known.imu || force != rate).and_then(|known| known.gyro.as_ref());
            if topic == rate {
                requests.push(Request {
                    sensor: Sensor::Reference(Quantity::Rate),
                    key: "reference.gyro",
                    name: "reference rate",
                    path: reference.gyro.as_ref().and_then(|gyro| gyro.path.as_ref()),
                    known: known_rate,
                    plus: reference.gyro.as_ref().and_then(|gyro| gyro.plus.as_ref()),
                    axes: reference.gyro.as_ref().and_then(|gyro| gyro.axes).unwrap_or_default(),
                    ignores_covariance,
                    factor: reference.gyro.as_ref().and_then(|gyro| gyro.unit).unwrap_or_default().factor(),
                    with_accel: false,
                });
            }
            if topic == force {
                requests.push(Request {
                    sensor: Sensor::Reference(Quantity::Force),
                    key: "reference.accel",
                    name: "reference force",
                    path: reference.accel.as_ref().and_then(|accel| accel.path.as_ref()),
                    known: known_accel,
                    plus: reference.accel.as_ref().and_then(|accel| accel.plus.as_ref()),
                    axes: reference.accel.as_ref().and_then(|accel| accel.axes).unwrap_or_default(),
                    ignores_covariance,
                    factor: accel(reference.accel.as_ref()).factor(),
                    with_accel: false,
                });
            }
        }
        if with_accel {
            requests.push(Request {
                sensor: Sensor::Accelerometer,
                key: "accel",
                name: "accelerometer",
                path: self.config.accel.as_ref().and_then(|accel| accel.path.as_ref()),
                known: known_accel,
                plus: self.config.accel.as_ref().and_then(|accel| accel.plus.as_ref()),
                axes: self.config.accel.as_ref().and_then(|accel| accel.axes).unwrap_or_default(),
                ignores_covariance,
                factor: accel(self.config.accel.as_ref()).factor(),
                with_accel,
            });
        }
        requests
    }

    /// Request for the temperature, if a topic whose type is `known` has it. Without configuration it is that in the
    /// accelerometer's messages.
    pub(in crate::imu) fn temperature<'a>(
        &'a self,
        topic: &str,
        known: Option<&'a KnownType>,
    ) -> Option<TemperatureRequest<'a>> {
        let config = self.config.temperature.as_ref();
        let own = config.and_then(|config| config.topic.as_deref()).unwrap_or(self.topic());
        let known = known.and_then(|known| known.temperature.as_ref());
        (topic == own && (config.is_some() || known.is_some())).then(|| TemperatureRequest {
            path: config.and_then(|config| config.path.as_ref()),
            known,
            offset: config.and_then(|config| config.unit).unwrap_or_default().offset(),
            configured: config.is_some(),
        })
    }

    fn gyro_topic(&self) -> &str {
        own_topic(&self.config.gyro).unwrap_or(&self.config.topic)
    }

    fn secondary_topic(&self, i: usize) -> &str {
        let secondary = self.config.secondary.get(i);
        let topic = secondary.and_then(|s| own_topic(&s.accel).or(s.topic.as_deref()));
        topic.unwrap_or(self.topic())
    }
}

impl ReferenceConfig {
    /// Topics of the force and of the rate.
    fn topics(&self) -> [&str; 2] {
        [own_topic(&self.accel).unwrap_or(&self.topic), own_topic(&self.gyro).unwrap_or(&self.topic)]
    }
}

fn own_topic<Unit>(vector: &Option<VectorConfig<Unit>>) -> Option<&str> {
    vector.as_ref()?.topic.as_deref()
}
