//! Registry of the IMUs seen so far: one for each `frame_id` on a topic, with a unique name, from the first reading of
//! its accelerometer on.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::refusal::Cause;
use super::route::{LONGEST_FRAME, Route, Tap};
use super::source::Source;
use crate::imu::config::{AccelUnit, RateUnit, SecondaryModel};
use crate::imu::preset::Preset;
use crate::imu::sample::{ImuId, Sensor};

/// An IMU that has been seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// First part of the names of its annotation topics. No two IMUs share one.
    pub name: String,
    /// Topic of its accelerometer.
    pub topic: String,
    /// Coordinate frame of its readings, if the messages state one.
    pub frame_id: String,
    /// Triads for which channels have been seen or configured.
    pub triads: Vec<Triad>,
    /// Whether it has a reference.
    pub reference: bool,
    /// Unit of its accelerometer, if configured.
    pub accel_unit: Option<AccelUnit>,
    /// Unit of its gyroscope, if configured.
    pub gyro_unit: Option<RateUnit>,
    /// Whether a triad has read only zeros so far, by [`Sensor::index`].
    pub(in crate::imu) silent: Vec<bool>,
}

/// One triad of an IMU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Triad {
    /// Sensor of the IMU.
    pub sensor: Sensor,
    /// `accelerometer`, `gyroscope`, or the configured name of the secondary.
    pub name: String,
    /// Topic of its readings.
    pub topic: String,
    /// Sensor model, if configured.
    pub preset: Option<Preset>,
    /// Measurement model, if it is a secondary accelerometer.
    pub model: SecondaryModel,
}

impl Triad {
    pub(in crate::imu) fn gyroscope(topic: &str) -> Self {
        Self {
            sensor: Sensor::Gyroscope,
            name: "gyroscope".to_owned(),
            topic: topic.to_owned(),
            preset: None,
            model: SecondaryModel::default(),
        }
    }
}

/// Largest number of `frame_id`s on one topic; more are noise.
const MAX_FRAMES: usize = 16;

/// IMU that a reading belongs to; `None` before the accelerometer of the IMU has been seen.
pub(in crate::imu) fn owner(
    source: &mut Source,
    imus: &mut Vec<Imu>,
    route: &mut Route,
    tap: usize,
    frame: &[u8],
    appears: bool,
) -> Result<Option<ImuId>, Cause> {
    if frame.len() > LONGEST_FRAME {
        return Err(Cause::LongFrame);
    }
    if route.taps.get(tap).is_some_and(|tap| tap.with_accel) {
        match source.imus.iter().find(|(own, _)| own == frame) {
            Some(&(_, id)) => Ok(Some(id)),
            None if appears => add(source, imus, route, frame).map(Some).ok_or(Cause::TooManyFrames),
            None => Ok(None),
        }
    } else if route.in_order {
        let place = route.frames.iter().position(|own| own == frame).unwrap_or(route.frames.len());
        if place == MAX_FRAMES {
            return Err(Cause::TooManyFrames);
        }
        if place == route.frames.len() {
            route.frames.push(frame.to_vec());
        }
        Ok(source.imus.get(place).map(|&(_, id)| id))
    } else if route.frames.first().is_some_and(|own| own == frame) {
        Ok(source.imus.first().map(|&(_, id)| id))
    } else {
        Err(Cause::ForeignFrame)
    }
}

/// IMU that a temperature belongs to: that of its `frame_id`, else the first one, whose sensor goes by another name.
pub(in crate::imu) fn warmed(source: &Source, route: &Route, frame: &[u8]) -> Option<ImuId> {
    let same = source.imus.iter().find(|(own, _)| own == frame);
    let is_first = || route.frames.first().is_some_and(|own| own == frame);
    same.or_else(|| source.imus.first().filter(|_| is_first())).map(|&(_, id)| id)
}

/// Adds the IMU of a new `frame_id`, unless there are too many already.
fn add(source: &mut Source, imus: &mut Vec<Imu>, route: &Route, frame: &[u8]) -> Option<ImuId> {
    if source.imus.len() >= MAX_FRAMES {
        return None;
    }
    let id = ImuId::of(imus.len());
    let frame_id = String::from_utf8_lossy(frame).into_owned();
    let first = source.imus.is_empty();
    let gyro = route.taps.iter().any(|tap: &Tap| tap.sensor == Sensor::Gyroscope);
    let triads = source.triads(gyro).filter(|(.., topic)| first || *topic == source.topic());
    let triad = |(sensor, name, topic): (_, &str, &str)| {
        let (preset, model) = (source.preset(sensor), source.model(sensor));
        Triad { sensor, name: name.to_owned(), topic: topic.to_owned(), preset, model }
    };
    let triads = triads.map(triad).collect();
    let silent = vec![true; Sensor::Secondary(source.secondaries()).index()];
    let name = free_name(source.name(), (!first).then_some(&frame_id), imus);
    let reference = source.has_reference() && first;
    let (accel_unit, gyro_unit) = source.units();
    let topic = source.topic().to_owned();
    imus.push(Imu { name, topic, frame_id, triads, reference, accel_unit, gyro_unit, silent });
    source.imus.push((frame.to_vec(), id));
    Some(id)
}

/// Accepts a value, unless the triad has read only zeros so far.
pub(in crate::imu) fn admit(
    imus: &mut [Imu],
    id: ImuId,
    sensor: Sensor,
    value: Vector3<f64>,
) -> Result<Vector3<f64>, Cause> {
    // A reference may correctly report no motion.
    if matches!(sensor, Sensor::Reference(_)) {
        return Ok(value);
    }
    let silent = imus.get_mut(id.index()).and_then(|imu| imu.silent.get_mut(sensor.index()));
    if let Some(silent @ true) = silent {
        *silent = is_zero(&value);
        if *silent {
            return Err(Cause::Zero);
        }
    }
    Ok(value)
}

/// Unused name for an IMU: the base, with the frame appended if it is not the first one, and a number if needed.
fn free_name(base: String, frame: Option<&String>, imus: &[Imu]) -> String {
    let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    // A frame without a name adds none, which no topic may have.
    let parts = frame.iter().flat_map(|frame| frame.split('/')).filter(|part| !part.is_empty());
    let base = parts.fold(base, |base, part| format!("{base}/{}", part.chars().map(legal).collect::<String>()));
    let taken = |name: &str| imus.iter().any(|imu| imu.name == name);
    let numbered = (2..).map(|n| format!("{base}_{n}"));
    std::iter::once(base.clone()).chain(numbered).find(|name| !taken(name)).unwrap_or(base)
}

pub(in crate::imu) fn is_zero(value: &Vector3<f64>) -> bool {
    value.iter().all(|&axis| axis == 0.0)
}
