//! The `[[imu]]` tables of the configuration: the topics and fields that form an IMU.

mod axes;
mod heading;
mod temperature;

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize as DeserializeDerive, Serialize};

pub use self::axes::AxesConfig;
pub use self::heading::{HeadingConfig, HeadingUnit};
pub use self::temperature::{TemperatureConfig, TemperatureUnit};
use crate::imu::preset::Preset;
use crate::imu::schema::path::FieldPath;

/// One IMU. Topics of well-known types need no table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, DeserializeDerive)]
#[serde(deny_unknown_fields)]
pub struct ImuConfig {
    /// Topic of the accelerometer, and of the gyroscope unless that names its own.
    pub topic: String,
    /// Name that replaces the topic in the names of the annotation topics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Specific force. Not needed for well-known types.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<VectorConfig<AccelUnit>>,
    /// Angular rate. Not needed for well-known types.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro: Option<VectorConfig<RateUnit>>,
    /// Temperature of the sensor. Not needed where a well-known type of the accelerometer has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Box<TemperatureConfig>>,
    /// Sensor model: its datasheet replaces values in `fit.bounds` and `still` that are at their defaults.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Treatment of a `covariance[0]` of −1 ("not measured") in its messages. If unset, such values are refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<CovarianceUse>,
    /// Reference for the true specific force and angular rate: a rate table, or motion capture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<Box<ReferenceConfig>>,
    /// Further accelerometers that move with this IMU.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub secondary: Vec<SecondaryConfig>,
}

/// Reference for an IMU, in the IMU's frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, DeserializeDerive)]
#[serde(deny_unknown_fields)]
pub struct ReferenceConfig {
    /// Topic of the reference.
    pub topic: String,
    /// True specific force. Not needed for well-known types.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<VectorConfig<AccelUnit>>,
    /// True angular rate. Not needed for well-known types.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro: Option<VectorConfig<RateUnit>>,
}

/// A further accelerometer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, DeserializeDerive)]
#[serde(deny_unknown_fields)]
pub struct SecondaryConfig {
    /// Name in the annotations.
    pub name: String,
    /// Topic; the IMU's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Specific force. Not needed for well-known types.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<VectorConfig<AccelUnit>>,
    /// Measurement model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<SecondaryModel>,
    /// Sensor model: its datasheet replaces values in `fit.bounds` that are at their defaults.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
}

/// Measurement model of a secondary accelerometer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, DeserializeDerive)]
#[serde(rename_all = "kebab-case")]
pub enum SecondaryModel {
    /// Bias and diagonal sensitivity.
    #[default]
    BiasScale,
    /// Bias and full sensitivity matrix, for any mounting relative to the primary one.
    CrossAxis,
}

/// Treatment of `covariance[0]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, DeserializeDerive)]
#[serde(rename_all = "lowercase")]
pub enum CovarianceUse {
    /// A value of −1 is ignored: some drivers set it although they measure.
    Ignore,
}

/// Place of a vector in the messages of a topic. Written as a path, as three paths, or as a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct VectorConfig<Unit> {
    /// Topic; the IMU's if absent. A secondary accelerometer names its topic one level up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Path in the message. Not needed for well-known types.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<VectorPath>,
    /// Path of a vector to add: the gravity that a phone removes from its acceleration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plus: Option<FieldPath>,
    /// Unit of the values; m/s² or rad/s if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Axes that are the sensor's x, y and z; those of the same names if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<AxesConfig>,
}

/// Path to a vector.
#[derive(Clone, Debug, PartialEq, Serialize, DeserializeDerive)]
#[serde(untagged, expecting = "a path to a vector, or three paths to numbers")]
pub enum VectorPath {
    /// Path to a message with `x`, `y`, `z`, or to an array of three.
    Whole(FieldPath),
    /// Paths to three numbers.
    Axes([FieldPath; 3]),
}

/// Unit of an accelerometer's values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, DeserializeDerive)]
pub enum AccelUnit {
    /// m/s².
    #[default]
    #[serde(rename = "m/s^2")]
    MetresPerSecondSquared,
    /// Standard gravity, 9.80665 m/s².
    #[serde(rename = "g")]
    StandardGravity,
}

/// Unit of a gyroscope's values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, DeserializeDerive)]
pub enum RateUnit {
    /// rad/s.
    #[default]
    #[serde(rename = "rad/s")]
    RadiansPerSecond,
    /// °/s.
    #[serde(rename = "deg/s")]
    DegreesPerSecond,
}

impl AccelUnit {
    /// Name in the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::MetresPerSecondSquared => "m/s^2",
            Self::StandardGravity => "g",
        }
    }

    /// Factor from this unit to m/s².
    pub fn factor(self) -> f64 {
        match self {
            Self::MetresPerSecondSquared => 1.0,
            Self::StandardGravity => 9.80665,
        }
    }
}

impl RateUnit {
    /// Name in the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::RadiansPerSecond => "rad/s",
            Self::DegreesPerSecond => "deg/s",
        }
    }

    /// Factor from this unit to rad/s.
    pub fn factor(self) -> f64 {
        match self {
            Self::RadiansPerSecond => 1.0,
            Self::DegreesPerSecond => std::f64::consts::PI / 180.0,
        }
    }
}

/// Table form, which refuses unknown keys.
#[derive(DeserializeDerive)]
#[serde(deny_unknown_fields)]
struct Table<Unit> {
    topic: Option<String>,
    path: Option<VectorPath>,
    plus: Option<FieldPath>,
    unit: Option<Unit>,
    axes: Option<AxesConfig>,
}

impl<'de, Unit: Deserialize<'de> + Default> Deserialize<'de> for VectorConfig<Unit> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Forms(PhantomData))
    }
}

/// Visitor that distinguishes the three forms by their type, so that an error inside a table is reported at its place.
struct Forms<Unit>(PhantomData<Unit>);

impl<'de, Unit: Deserialize<'de> + Default> Visitor<'de> for Forms<Unit> {
    type Value = VectorConfig<Unit>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a path to a vector, three paths to numbers, or a table with topic, path, plus, unit, axes")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
        let path = text.parse().map_err(E::custom)?;
        Ok(VectorConfig { path: Some(VectorPath::Whole(path)), ..VectorConfig::default() })
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        let axes = Deserialize::deserialize(SeqAccessDeserializer::new(seq))?;
        Ok(VectorConfig { path: Some(VectorPath::Axes(axes)), ..VectorConfig::default() })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let Table { topic, path, plus, unit, axes } = Table::deserialize(MapAccessDeserializer::new(map))?;
        Ok(VectorConfig { topic, path, plus, unit, axes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_forms_of_a_vector_are_read() {
        let imu: ImuConfig = toml::from_str(
            r#"
            topic = "/imu"
            accel = "accel_mps2"
            gyro = { path = "gyro_dps", unit = "deg/s" }
            [[secondary]]
            name = "highg"
            accel = ["a[0]", "a[1]", "a[2]"]
            "#,
        )
        .unwrap();
        let path = |text: &str| text.parse::<FieldPath>().unwrap();
        assert_eq!(imu.accel.unwrap().path, Some(VectorPath::Whole(path("accel_mps2"))));
        assert_eq!(imu.gyro.unwrap().unit, Some(RateUnit::DegreesPerSecond));
        let axes = VectorPath::Axes([path("a[0]"), path("a[1]"), path("a[2]")]);
        assert_eq!(imu.secondary[0].accel.as_ref().unwrap().path, Some(axes));
    }

    #[test]
    fn a_configuration_is_read_back_as_it_was_written() {
        let text = "topic = \"/imu\"\ngyro = { topic = \"/gyro\", path = [\"x\", \"y\", \"z\"], unit = \"deg/s\" }\n";
        let imu: ImuConfig = toml::from_str(text).unwrap();
        assert_eq!(toml::from_str::<ImuConfig>(&toml::to_string(&imu).unwrap()).unwrap(), imu);
    }

    #[test]
    fn mistakes_are_reported_where_they_stand() {
        let error = |text: &str| toml::from_str::<ImuConfig>(text).unwrap_err().to_string();
        assert!(error("topic = '/imu'\naccel = { unit = 'deg/s' }").contains("unknown variant `deg/s`"));
        assert!(error("topic = '/imu'\naccel = { pth = 'a' }").contains("unknown field `pth`"));
        assert!(error("topic = '/imu'\naccel = 'a..b'").contains("a..b"));
        assert!(error("topic = '/imu'\naccel = 3").contains("a path to a vector"));
    }
}
