//! The `[output]` table of the configuration.

use serde::{Deserialize, Serialize};

use super::Encoding;

/// Configuration of the output.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutputConfig {
    /// Encoding of annotations.
    pub encoding: EncodingChoice,
    /// Corrected messages to write.
    pub corrected: Corrected,
}

/// Encoding of annotations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EncodingChoice {
    /// ROS 2 messages in recordings of profile `ros2`, protobuf in all others.
    #[default]
    Auto,
    /// ROS 2 messages.
    Ros2,
    /// Protobuf.
    Protobuf,
}

impl EncodingChoice {
    /// Encoding in a recording of this profile.
    pub fn in_profile(self, profile: &str) -> Encoding {
        match self {
            Self::Auto if profile == "ros2" => Encoding::Ros2,
            Self::Auto | Self::Protobuf => Encoding::Protobuf,
            Self::Ros2 => Encoding::Ros2,
        }
    }
}

/// Corrected messages to write: those of the source, with true values instead of the measured ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Corrected {
    /// None.
    #[default]
    Off,
    /// From the first calibration on, each by the one in force.
    Causal,
    /// All, by the last calibration of the recording.
    Final,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_keeps_a_ros_2_recording_a_ros_2_recording() {
        assert_eq!(EncodingChoice::Auto.in_profile("ros2"), Encoding::Ros2);
        assert_eq!(EncodingChoice::Auto.in_profile("ros1"), Encoding::Protobuf);
        assert_eq!(EncodingChoice::Auto.in_profile(""), Encoding::Protobuf);
        assert_eq!(EncodingChoice::Protobuf.in_profile("ros2"), Encoding::Protobuf);
        assert_eq!(EncodingChoice::Ros2.in_profile(""), Encoding::Ros2);
    }

    #[test]
    fn the_default_reads_back_and_an_empty_table_means_it() {
        let written = toml::to_string(&OutputConfig::default()).unwrap_or_default();
        assert_eq!(written, "encoding = \"auto\"\ncorrected = \"off\"\n");
        assert_eq!(toml::from_str(&written), Ok(OutputConfig::default()));
        assert_eq!(toml::from_str(""), Ok(OutputConfig::default()));
    }

    #[test]
    fn what_cannot_be_written_is_refused() {
        let refusal = |text: &str| toml::from_str::<OutputConfig>(text).err().map(|error| error.to_string());
        assert_eq!(refusal("corrected = \"causal\""), None);
        assert_eq!(refusal("corrected = \"final\""), None);
        assert!(refusal("corrected = \"on\"").is_some_and(|text| text.contains("`off`, `causal`, `final`")));
        assert!(refusal("encoding = \"json\"").is_some());
        assert!(refusal("encodings = \"auto\"").is_some());
    }
}
