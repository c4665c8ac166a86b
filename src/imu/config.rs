//! The `[[imu]]` tables of the configuration: which fields of which topics are an IMU.

use serde::{Deserialize, Serialize};

/// One IMU. Topics of well-known types need no table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuConfig {
    /// Topic of the accelerometer, and of the gyroscope unless that names its own.
    pub topic: String,
    /// Replaces the topic in the names of the annotation topics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The specific force. Known types need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<VectorConfig>,
    /// The angular rate. Known types need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gyro: Option<VectorConfig>,
    /// Further accelerometers that move with this IMU.
    #[serde(default)]
    pub secondary: Vec<SecondaryConfig>,
}

/// A further accelerometer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondaryConfig {
    /// What it is called in the annotations.
    pub name: String,
    /// Its topic; the IMU's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Its specific force. Known types need none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accel: Option<VectorConfig>,
}

/// Where a vector stands in the messages of a topic.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a path, three paths, or a table of path, topic and unit")]
pub enum VectorConfig {
    /// Path to a message with `x`, `y`, `z`, or to an array of three.
    Path(String),
    /// Three paths to numbers.
    Paths([String; 3]),
    /// The same with more to say.
    Table(VectorTable),
}

/// A vector with a topic or unit of its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VectorTable {
    /// Its topic; the IMU's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Path to the vector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// Unit of the values: `m/s^2` (default), `g`, `rad/s` (default), `deg/s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}
