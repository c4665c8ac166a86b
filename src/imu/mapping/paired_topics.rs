//! One IMU on two topics, as RealSense cameras and PX4 publish it. The two topics are matched by their types and by the
//! common part of their names.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::route::Route;
use crate::imu::config::VectorPath;

/// A channel that may be one half of an IMU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct PairedTopic {
    pub(in crate::imu) topic: String,
    pub(in crate::imu) side: Side,
    /// Common part of the topics of both halves.
    key: String,
    /// Common part of the types of both halves.
    family: String,
    /// Source of the IMU whose accelerometer it is.
    pub(in crate::imu) source: Option<usize>,
    /// Its only vector, if its type is not known.
    pub(in crate::imu) vector: Option<VectorPath>,
    /// Route that would read the gyroscope.
    pub(in crate::imu) gyro: Option<Route>,
}

/// Triad that a topic is named after.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::imu) enum Side {
    Accelerometer,
    Gyroscope,
}

impl PairedTopic {
    /// Half for a topic that is named after one of the triads; `None` for other topics.
    pub(in crate::imu) fn new(topic: &str, type_name: &str) -> Option<Self> {
        let (side, key) = parted(&topic.to_lowercase())?;
        let lower = type_name.to_lowercase();
        let family = parted(&lower).map_or(lower, |(_, family)| family);
        Some(Self { topic: topic.to_owned(), side, key, family, source: None, gyro: None, vector: None })
    }

    /// Key that both halves of an IMU share.
    fn common(&self) -> (String, String) {
        (self.key.clone(), self.family.clone())
    }

    /// Whether the two are halves of one IMU.
    pub(in crate::imu) fn fits(&self, other: &Self) -> bool {
        self.side != other.side && self.key == other.key && self.family == other.family
    }
}

/// Halves of IMUs seen so far, by their channels.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Halves {
    all: BTreeMap<u16, PairedTopic>,
    /// Channels of known types, by what both halves of an IMU share.
    known: BTreeMap<(String, String), BTreeSet<u16>>,
}

impl Halves {
    /// Adds a half of a type that is not known. Returns the other half, if it has one vector as this one has.
    pub(in crate::imu) fn add_unknown(&mut self, channel_id: u16, half: &PairedTopic) -> Option<(u16, PairedTopic)> {
        let other = self.all.iter().find(|(_, other)| half.vector.is_some() && other.fits(half));
        let other = other.map(|(&id, other)| (id, other.clone()));
        self.all.insert(channel_id, half.clone());
        other
    }

    /// Adds a half of a known type. Returns the other half, if it was added before.
    pub(in crate::imu) fn add_known(&mut self, channel_id: u16, half: &PairedTopic) -> Option<(u16, PairedTopic)> {
        let alike = self.known.entry(half.common()).or_default();
        let mut others = alike.iter().filter_map(|id| Some((*id, self.all.get(id)?)));
        let other = others.find(|(_, other)| other.fits(half)).map(|(id, other)| (id, other.clone()));
        alike.insert(channel_id);
        self.all.insert(channel_id, half.clone());
        other
    }

    /// Topics that have a gyroscope, no accelerometer and no other half.
    pub(in crate::imu) fn gyroscopes_alone(&self) -> impl Iterator<Item = &str> {
        let alone = |half: &&PairedTopic| {
            half.side == Side::Gyroscope
                && half.source.is_none()
                && (half.gyro.is_some() || half.vector.is_some())
                && !self.all.values().any(|other| other.fits(half))
        };
        self.all.values().filter(alone).map(|half| &*half.topic)
    }
}

/// Triad in a name, and the name without it; `None` if there is no triad or more than one.
fn parted(name: &str) -> Option<(Side, String)> {
    const WORDS: [(&str, Side); 16] = [
        ("accelerometer", Side::Accelerometer),
        ("gyroscope", Side::Gyroscope),
        ("accel", Side::Accelerometer),
        ("gyro", Side::Gyroscope),
        ("acceleration", Side::Accelerometer),
        ("linear_acceleration", Side::Accelerometer),
        ("linearacceleration", Side::Accelerometer),
        ("linear_accel", Side::Accelerometer),
        ("angular_velocity", Side::Gyroscope),
        ("angularvelocity", Side::Gyroscope),
        ("angular_rate", Side::Gyroscope),
        ("ang_vel", Side::Gyroscope),
        ("rotation_rate", Side::Gyroscope),
        ("rotationrate", Side::Gyroscope),
        ("acc", Side::Accelerometer),
        ("gyr", Side::Gyroscope),
    ];
    let longest = |word: &&(&str, Side)| word.0.len();
    let (word, side) = *WORDS.iter().filter(|(word, _)| name.contains(word)).max_by_key(longest)?;
    let (before, after) = name.split_once(word)?;
    let rest = format!("{before}*{after}");
    WORDS.iter().all(|(word, _)| !rest.contains(word)).then_some((side, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fits(a: (&str, &str), b: (&str, &str)) -> bool {
        let half = |(topic, kind): (&str, &str)| PairedTopic::new(topic, kind);
        half(a).zip(half(b)).is_some_and(|(a, b)| a.fits(&b) && b.fits(&a))
    }

    #[test]
    fn halves_are_known_by_their_names() {
        let imu = "sensor_msgs/Imu";
        assert!(fits(("/camera/accel/sample", imu), ("/camera/gyro/sample", imu)));
        assert!(fits(("/device_0/sensor_2/Accel_0/imu/data", imu), ("/device_0/sensor_2/Gyro_0/imu/data", imu)));
        assert!(fits(("/accelerometer", imu), ("/gyroscope", imu)));
        let (accel, gyro) = ("px4_msgs/SensorAccel", "px4_msgs/SensorGyro");
        assert!(fits(("/fmu/out/sensor_accel1", accel), ("/fmu/out/sensor_gyro1", gyro)));
        assert!(!fits(("/fmu/out/sensor_accel", accel), ("/fmu/out/sensor_gyro1", gyro)));
        assert!(!fits(("/front/accel", imu), ("/rear/gyro", imu)));
        assert!(!fits(("/accel", imu), ("/accel", imu)));
        assert!(!fits(("/accel_gyro", imu), ("/gyro_gyro", imu)));
        assert!(!fits(("/accel", imu), ("/gyro", gyro)));
        let vector = "geometry_msgs/Vector3Stamped";
        for gyro in ["/imu/angular_velocity", "/imu/angularVelocity", "/imu/angular_rate", "/imu/ang_vel", "/imu/gyro"]
        {
            for accel in
                ["/imu/linear_acceleration", "/imu/linearAcceleration", "/imu/linear_accel", "/imu/acceleration"]
            {
                assert!(fits((accel, vector), (gyro, vector)), "{accel} {gyro}");
            }
        }
    }
}
