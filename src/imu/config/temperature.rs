//! Place of an IMU's temperature in the messages of a topic.

use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{self, Deserialize, Deserializer, MapAccess, Visitor};
use serde::{Deserialize as DeserializeDerive, Serialize};

use crate::imu::schema::path::FieldPath;

/// Place of a temperature. Written as a path, or as a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TemperatureConfig {
    /// Topic; the accelerometer's if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Path in the message. Not needed for well-known types.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<FieldPath>,
    /// Unit of the value; °C if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<TemperatureUnit>,
}

/// Unit of a temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, DeserializeDerive)]
pub enum TemperatureUnit {
    /// °C.
    #[default]
    #[serde(rename = "degC")]
    Celsius,
    /// K.
    #[serde(rename = "K")]
    Kelvin,
}

impl TemperatureUnit {
    /// Offset to add to a value so that it is in °C.
    pub fn offset(self) -> f64 {
        match self {
            Self::Celsius => 0.0,
            Self::Kelvin => -273.15,
        }
    }
}

/// TemperatureTable form, which refuses unknown keys.
#[derive(DeserializeDerive)]
#[serde(deny_unknown_fields)]
struct TemperatureTable {
    topic: Option<String>,
    path: Option<FieldPath>,
    unit: Option<TemperatureUnit>,
}

impl<'de> Deserialize<'de> for TemperatureConfig {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TwoForms)
    }
}

/// Visitor that distinguishes the two forms by their type, so that an error inside a table is reported at its place.
struct TwoForms;

impl<'de> Visitor<'de> for TwoForms {
    type Value = TemperatureConfig;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a path to a number, or a table with topic, path, unit")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Self::Value, E> {
        let path = text.parse().map_err(E::custom)?;
        Ok(TemperatureConfig { path: Some(path), ..TemperatureConfig::default() })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let TemperatureTable { topic, path, unit } = TemperatureTable::deserialize(MapAccessDeserializer::new(map))?;
        Ok(TemperatureConfig { topic, path, unit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::ImuConfig;

    fn read(value: &str) -> Result<TemperatureConfig, String> {
        let imu = toml::from_str::<ImuConfig>(&format!("topic = '/imu'\ntemperature = {value}"));
        imu.map(|imu| *imu.temperature.unwrap_or_default()).map_err(|error| error.to_string())
    }

    #[test]
    fn both_forms_are_read_and_mistakes_are_reported_where_they_stand() {
        assert_eq!(read("'status.temperature'").unwrap().path, Some("status.temperature".parse().unwrap()));
        let table = read("{ topic = '/warmth', path = 'kelvin', unit = 'K' }").unwrap();
        assert_eq!((table.topic.as_deref(), table.unit), (Some("/warmth"), Some(TemperatureUnit::Kelvin)));
        assert!(read("{ unit = 'F' }").unwrap_err().contains("unknown variant `F`"));
        assert!(read("{ pth = 'a' }").unwrap_err().contains("unknown field `pth`"));
        assert!(read("3").unwrap_err().contains("a path to a number"));
    }

    #[test]
    fn it_reads_back_as_it_was_written() {
        for text in ["temperature = { topic = '/t', unit = 'K' }", "temperature = 't.c[2]'"] {
            let imu: ImuConfig = toml::from_str(&format!("topic = '/imu'\n{text}")).unwrap();
            assert_eq!(toml::from_str::<ImuConfig>(&toml::to_string(&imu).unwrap()).unwrap(), imu);
        }
    }
}
