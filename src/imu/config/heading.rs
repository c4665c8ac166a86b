//! Heading reference: a topic that shows how the body turns about the vertical, without this IMU's gyroscope.

use serde::{Deserialize, Serialize};

use crate::imu::schema::path::FieldPath;

/// Heading reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadingConfig {
    /// Topic of the reference.
    pub topic: String,
    /// Path in its messages to an angle, or to a quaternion with `x`, `y`, `z`, `w` from the axes of the body to those of a
    /// world whose z points up. Not needed for well-known types.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<FieldPath>,
    /// Unit of an angle.
    pub unit: HeadingUnit,
    /// Whether it grows clockwise seen from above, as a compass does from north; ENU is counterclockwise.
    pub clockwise: bool,
    /// Standard deviation of the heading at a rest, degrees: as good as a mark on a table unless it is stated, which antennas
    /// a metre apart and scan matching are about as well, and motion capture is better.
    pub std_deg: f64,
}

impl Default for HeadingConfig {
    fn default() -> Self {
        Self { topic: String::new(), path: None, unit: HeadingUnit::default(), clockwise: false, std_deg: 0.5 }
    }
}

/// Unit of a heading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum HeadingUnit {
    /// rad.
    #[default]
    #[serde(rename = "rad")]
    Radians,
    /// Degrees.
    #[serde(rename = "deg")]
    Degrees,
    /// Hundredths of a degree, as in MAVLink.
    #[serde(rename = "cdeg")]
    Centidegrees,
    /// 10⁻⁵ degrees, as in UBX-NAV-RELPOSNED.
    #[serde(rename = "1e-5 deg")]
    Ubx,
}

impl HeadingUnit {
    /// Name in the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::Radians => "rad",
            Self::Degrees => "deg",
            Self::Centidegrees => "cdeg",
            Self::Ubx => "1e-5 deg",
        }
    }

    /// Factor from this unit to rad.
    pub fn factor(self) -> f64 {
        let degree = std::f64::consts::PI / 180.0;
        match self {
            Self::Radians => 1.0,
            Self::Degrees => degree,
            Self::Centidegrees => 1e-2 * degree,
            Self::Ubx => 1e-5 * degree,
        }
    }
}
