//! Heading reference in the messages of a channel. Its use is left to [`engine`](crate::engine).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::time_source::{StampFields, TimeSource};
use crate::Stamp;
use crate::imu::config::HeadingConfig;
use crate::imu::decode::Decoder;
use crate::imu::schema::layout::{Layout, Place};
use crate::imu::schema::lookup::PathError;
use crate::imu::schema::path::FieldPath;

/// Heading of a body at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// Time of the message.
    pub stamp: Stamp,
    /// Angle, counterclockwise seen from above, rad; whole turns may be counted or not.
    pub angle: f64,
}

/// Channels of the heading reference.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct HeadingSearch {
    config: Option<HeadingConfig>,
    routes: BTreeMap<u16, HeadingFields>,
    /// Reason why a channel of its topic, which an IMU reads, has no heading.
    fault: Option<String>,
    /// Number of headings read.
    read: u64,
}

/// Places of a heading's numbers in the messages of a channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct HeadingFields {
    decoder: Decoder,
    clock: TimeSource,
    /// Stamp, then an angle, or x, y, z and w of a quaternion.
    numbers: Vec<f64>,
    /// Index of the first of them.
    at: usize,
    is_quaternion: bool,
    /// Factor from the angle to rad, counterclockwise.
    factor: f64,
}

/// Reason why a channel has no heading.
#[derive(Debug, thiserror::Error)]
pub(in crate::imu) enum HeadingError {
    #[error(transparent)]
    Path(#[from] PathError),
    #[error("which field is the heading? Set fit.heading.path to that of an angle, or of a quaternion with x, y, z, w")]
    NoPath,
    #[error(
        "no heading reference: the orientation in sensor_msgs/Imu is made from a gyroscope. Name a topic that knows without one, as \
         two antennas, motion capture or wheels do"
    )]
    OfGyroscope,
}

/// Quaternions of known types, which lead from the axes of the body to those of the world.
const KNOWN: [(&str, &str); 8] = [
    ("nav_msgs/Odometry", "pose.pose.orientation"),
    ("geometry_msgs/PoseStamped", "pose.orientation"),
    ("geometry_msgs/PoseWithCovarianceStamped", "pose.pose.orientation"),
    ("geometry_msgs/QuaternionStamped", "quaternion"),
    ("geometry_msgs/TransformStamped", "transform.rotation"),
    ("foxglove.PoseInFrame", "pose.orientation"),
    ("foxglove/PoseInFrame", "pose.orientation"),
    ("foxglove.FrameTransform", "rotation"),
];

impl HeadingSearch {
    pub(in crate::imu) fn new(config: Option<HeadingConfig>) -> Self {
        Self { config, ..Self::default() }
    }

    /// Configured topic.
    pub(in crate::imu) fn topic(&self) -> Option<&str> {
        self.config.as_ref().map(|config| config.topic.as_str())
    }

    /// Adds a channel. Returns the path of the heading in its messages, if it is of the configured topic.
    ///
    /// # Errors
    /// If it is, and has no heading.
    pub(in crate::imu) fn channel(
        &mut self,
        id: u16,
        topic: &str,
        layout: &Layout,
    ) -> Result<Option<String>, HeadingError> {
        let Some(config) = self.config.as_ref().filter(|config| config.topic == topic) else { return Ok(None) };
        let (path, fields) = HeadingFields::new(layout, config)?;
        self.routes.insert(id, fields);
        Ok(Some(path.to_string()))
    }

    /// Notes why a channel that is used otherwise has no heading.
    pub(in crate::imu) fn refuse(&mut self, error: &HeadingError) {
        self.fault.get_or_insert(error.to_string());
    }

    pub(in crate::imu) fn wants(&self, channel: u16) -> bool {
        self.routes.contains_key(&channel)
    }

    /// Reason why a channel of its topic has no heading, unless that is the channel's role.
    pub(in crate::imu) fn fault(&self) -> Option<String> {
        let (topic, fault) = (self.topic()?, self.fault.as_ref()?);
        Some(format!("fit.heading: {topic}: {fault}"))
    }

    /// Note that no message of its channels had a heading.
    pub(in crate::imu) fn unread(&self) -> Option<String> {
        let topic = self.topic().filter(|_| self.read == 0 && !self.routes.is_empty())?;
        Some(format!(
            "fit.heading: {topic}: no message of it had a heading while the IMU was read: there are none then (where topics stand one \
             behind the other in the file, sort it first, with `mcap sort RECORDING -o SORTED`), or NaN, or quaternions of an \
             upright x axis"
        ))
    }

    /// Reads a message of a wanted channel.
    pub(in crate::imu) fn message(&mut self, channel: u16, log_time: u64, data: &[u8]) -> Option<Heading> {
        let heading = self.routes.get_mut(&channel)?.read(log_time, data)?;
        self.read += 1;
        Some(heading)
    }
}

impl HeadingFields {
    fn new(layout: &Layout, config: &HeadingConfig) -> Result<(FieldPath, Self), HeadingError> {
        if layout.name() == "sensor_msgs/Imu" {
            return Err(HeadingError::OfGyroscope);
        }
        let known = KNOWN.iter().find(|(name, _)| *name == layout.name());
        let path = match &config.path {
            Some(path) => path.clone(),
            None => known.and_then(|(_, path)| path.parse().ok()).ok_or(HeadingError::NoPath)?,
        };
        let (is_quaternion, places) = places(layout, &path)?;
        let StampFields { clock, numbers: mut all, .. } = StampFields::nearest(layout, &path);
        let at = all.len();
        all.extend(places);
        let decoder = Decoder::new(layout, &all, None)?;
        let factor = config.unit.factor() * if config.clockwise { -1.0 } else { 1.0 };
        Ok((path, Self { decoder, clock, numbers: vec![0.0; all.len()], at, is_quaternion, factor }))
    }

    /// Heading of a message; `None` where it is marked as absent by NaN, or its x axis is upright.
    fn read(&mut self, log_time: u64, data: &[u8]) -> Option<Heading> {
        self.decoder.read(data, &mut self.numbers).ok()?;
        let stamp = self.clock.read(&self.numbers, log_time);
        let angle = match self.numbers.get(self.at..)? {
            [x, y, z, w] if self.is_quaternion => yaw([*x, *y, *z, *w])? * self.factor.signum(),
            [angle, ..] if !self.is_quaternion => angle * self.factor,
            _ => return None,
        };
        angle.is_finite().then_some(Heading { stamp, angle })
    }
}

/// Whether a path leads to a quaternion, and its numbers, or the number that it leads to.
fn places(layout: &Layout, path: &FieldPath) -> Result<(bool, Vec<Place>), PathError> {
    let parts: Option<Vec<_>> = ["x", "y", "z", "w"].iter().map(|part| layout.find_number(&path.join(part))).collect();
    match parts {
        Some(parts) => Ok((true, parts)),
        None => Ok((false, vec![layout.number(path)?])),
    }
}

/// Angle of the body's x axis in the horizontal plane, rad, by the quaternion x, y, z, w; `None` for one of no length, or
/// where the axis is steeper than 60° and its direction says little.
fn yaw([x, y, z, w]: [f64; 4]) -> Option<f64> {
    let norm = x * x + y * y + z * z + w * w;
    let (side, front) = (2.0 * (w * z + x * y), norm - 2.0 * (y * y + z * z));
    let is_level = norm > 0.0 && libm::hypot(side, front) >= 0.5 * norm;
    is_level.then(|| libm::atan2(side, front))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn yaw_is_that_of_the_x_axis_unless_it_is_upright() {
        let of = |rotation: UnitQuaternion<f64>| yaw([rotation.i, rotation.j, rotation.k, rotation.w]);
        for (roll, pitch, heading) in [(0.0, 0.0, 2.5), (0.3, -0.4, -3.0), (std::f64::consts::PI, 0.1, 1.0)] {
            let found = of(UnitQuaternion::from_euler_angles(roll, pitch, heading)).unwrap();
            assert!((found - heading).abs() < 1e-12, "{found}");
        }
        assert_eq!(of(UnitQuaternion::from_scaled_axis(Vector3::y() * -1.4)), None);
        assert_eq!((yaw([0.0; 4]), yaw([f64::NAN; 4])), (None, None));
    }
}
