//! The setting `fit.temperature`.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Highest order of a polynomial over the temperature.
pub const HIGHEST: usize = 3;

/// Whether the dependence of biases on the temperature is learned: `"auto"`, `"off"`, or the highest order of its
/// polynomial. Whatever is set, it is published only where the recording has temperatures that show it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TemperatureFit {
    /// The highest order that the rests show.
    #[default]
    Auto,
    /// No: biases are those of all temperatures.
    Off,
    /// At most a polynomial of this order, 0 to 3.
    Order(u8),
}

impl TemperatureFit {
    /// Highest order of the polynomial; 0 means none.
    pub fn most(self) -> usize {
        match self {
            Self::Auto => HIGHEST,
            Self::Off => 0,
            Self::Order(order) => order.into(),
        }
    }

    /// Whether it is the default, which a configuration need not say.
    pub(in crate::fit) fn is_auto(&self) -> bool {
        *self == Self::Auto
    }
}

impl Serialize for TemperatureFit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Off => serializer.serialize_str("off"),
            Self::Order(order) => serializer.serialize_u8(*order),
        }
    }
}

impl<'de> Deserialize<'de> for TemperatureFit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// The two forms that it is written in.
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "\"auto\", \"off\" or an order from 0 to 3")]
        enum Form {
            Word(String),
            Order(u8),
        }
        match Form::deserialize(deserializer)? {
            Form::Word(word) if word == "auto" => Ok(Self::Auto),
            Form::Word(word) if word == "off" => Ok(Self::Off),
            Form::Order(order) if usize::from(order) <= HIGHEST => Ok(Self::Order(order)),
            Form::Word(word) => Err(de::Error::custom(format!("`{word}` is none of auto, off, 0, 1, 2, 3"))),
            Form::Order(order) => Err(de::Error::custom(format!("{order} is none of auto, off, 0, 1, 2, 3"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Config;

    #[test]
    fn words_and_orders_are_read_back_as_they_were_written() {
        let read = |value: &str| toml::from_str::<Config>(&format!("temperature = {value}"));
        for (text, choice, most) in [("\"off\"", TemperatureFit::Off, 0), ("2", TemperatureFit::Order(2), 2)] {
            let config = read(text).unwrap();
            assert_eq!((config.temperature, config.temperature.most()), (choice, most));
            assert_eq!(toml::from_str::<Config>(&toml::to_string(&config).unwrap()).unwrap(), config);
        }
        assert_eq!(read("\"auto\"").unwrap(), Config::default());
        assert!(!toml::to_string(&Config::default()).unwrap().contains("temperature"), "recordings keep their bytes");
        for wrong in ["4", "-1", "1.5", "\"on\"", "true"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
