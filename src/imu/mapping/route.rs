//! Route from the messages of one channel to readings of one IMU, compiled once from the channel's layout and the
//! requests.

use std::borrow::Cow;
use std::io::Write as _;
use std::ops::{Deref, Range};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::axes::{Axes, RouteError};
use super::batch::Batch;
use super::channel_role::VectorUse;
use super::known_types::KnownType;
use super::refusal::{Cause, Counts};
use super::request::Request;
use super::thermometer::{TemperatureRequest, Thermometer};
use super::time_source::{StampFields, TimeSource};
use crate::Stamp;
use crate::imu::config::AxesConfig;
use crate::imu::decode::Decoder;
use crate::imu::decode::malformed::Malformed;
use crate::imu::decode::rewrite::Change;
use crate::imu::sample::{ImuId, Sample, Sensor};
use crate::imu::schema::layout::{Layout, Place};
use crate::imu::schema::path::FieldPath;

/// A channel that provides samples of an IMU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Route {
    pub(in crate::imu) topic: String,
    /// Index of the source that requested it.
    pub(in crate::imu) source: usize,
    pub(in crate::imu) taps: Vec<Tap>,
    pub(in crate::imu) counts: Counts,
    /// Description of the first malformed message.
    pub(in crate::imu) malformed: Option<String>,
    /// Number of messages read.
    pub(in crate::imu) messages: u64,
    /// Frames met so far, the first one always.
    pub(in crate::imu) frames: Vec<Vec<u8>>,
    /// Whether the frames of this topic correspond to the frames of the accelerometer's topic in order of appearance.
    pub(in crate::imu) in_order: bool,
    decoder: Decoder,
    /// Readings of a message, if there are several.
    batch: Option<Batch>,
    clock: TimeSource,
    /// Stamp of the last reading.
    pub(in crate::imu) stamp: Option<Stamp>,
    /// Temperature of the IMU, if the messages hold it, and its path.
    thermometer: Option<(Thermometer, String)>,
    /// Index of the number that replaces the frame, if any.
    device: Option<usize>,
    /// Numbers of the last message: the stamp if there is one, then each tap's numbers.
    numbers: Vec<f64>,
}

/// A vector of a message and the related fields, as indices into the numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::imu) struct Tap {
    pub(in crate::imu) sensor: Sensor,
    pub(in crate::imu) name: String,
    pub(in crate::imu) path: String,
    pub(in crate::imu) axes: [String; 3],
    pub(in crate::imu) with_accel: bool,
    pub(in crate::imu) counts: Counts,
    factor: f64,
    /// Its axes that are the sensor's.
    order: AxesConfig,
    /// Index of its x; y and z follow.
    at: usize,
    /// Index of the x of a vector that is added; y and z follow.
    plus: Option<usize>,
    /// Index of its `covariance[0]`.
    covariance: Option<usize>,
    /// Index of the microseconds over which it is an increment.
    over: Option<usize>,
    /// Index of the factor of its counts.
    scale: Option<usize>,
    clipping: Range<usize>,
    round: Option<usize>,
    /// Calibration that the driver applied to the last reading.
    last_round: Option<u64>,
    /// IMU of the reading in the last message, if there was one.
    pub(in crate::imu) last: Option<ImuId>,
}

/// Sensor of a message, if several share a topic: its `frame_id`, or the digits of its device.
pub(in crate::imu) enum Frame<'d> {
    Text(Cow<'d, [u8]>),
    Digits { bytes: [u8; 20], len: usize },
}

/// Longest `frame_id` that is read, bytes: it is part of the name of an IMU, and each of its annotations holds it.
pub(in crate::imu) const LONGEST_FRAME: usize = 256;

impl Route {
    /// Compiles the requests of a source, of which the accelerometer's is the last.
    pub(in crate::imu) fn new(
        topic: &str,
        layout: &Layout,
        known: Option<&KnownType>,
        source: usize,
        requests: &[Request<'_>],
        temperature: Option<TemperatureRequest<'_>>,
    ) -> Result<Self, RouteError> {
        let sensed = temperature.map_or(Ok(None), |request| request.find(layout))?;
        let axes: Vec<_> = requests.iter().map(|request| Axes::of(layout, request)).collect::<Result<_, _>>()?;
        let micros = known.and_then(|known| layout.find_number(known.micros.as_ref()?)).map(StampFields::micros);
        let stamp = micros.unwrap_or_else(|| {
            let path = axes.last().map(Axes::place).or(sensed.as_ref().map(|(path, _)| path));
            StampFields::nearest(layout, &path.cloned().unwrap_or_default())
        });
        let mut numbers = stamp.numbers;
        let mut add = |place: Option<Place>| {
            numbers.extend(place);
            numbers.len() - 1
        };
        let batch = known.and_then(|known| known.batch.as_ref());
        let [count, period] = [batch.map(|batch| &batch.count), batch.map(|batch| &batch.period)]
            .map(|path| path.and_then(|path| layout.find_number(path)).map(|place| add(Some(place))));
        let device = known.and_then(|known| layout.find_number(known.device.as_ref()?)).map(|place| add(Some(place)));
        let offset = temperature.map_or(0.0, |request| request.offset);
        let thermometer = sensed.map(|(path, place)| (Thermometer::new(add(Some(place)), offset), path.to_string()));
        let mut taps = Vec::new();
        for (request, Axes { path, axes, places: [x, y, z], covariance, part }) in requests.iter().zip(axes) {
            let at = add(Some(x));
            add(Some(y));
            let after = add(Some(z)) + 1;
            let find = |path: Option<&FieldPath>| path.and_then(|path| layout.find_number(path));
            let clipping = part.iter().flat_map(|part| &part.clipping).filter_map(|path| find(Some(path)));
            let clipping = clipping.map(|place| add(Some(place))).last().map_or(after..after, |last| after..last + 1);
            let plus = match request.plus {
                None => None,
                Some(path) => {
                    let [x, y, z] = layout.vector(path)?;
                    let at = add(Some(x));
                    add(Some(y));
                    add(Some(z));
                    Some(at)
                }
            };
            taps.push(Tap {
                sensor: request.sensor,
                name: request.name.to_owned(),
                path: path.to_string(),
                axes: request.axes.in_order(&axes).map(|axis| axis.to_string()),
                with_accel: request.with_accel,
                counts: Counts::default(),
                factor: request.factor,
                order: request.axes,
                at,
                plus,
                covariance: covariance.filter(|_| !request.ignores_covariance).map(|place| add(Some(place))),
                over: find(part.and_then(|part| part.over.as_ref())).map(|place| add(Some(place))),
                scale: find(part.and_then(|part| part.scale.as_ref())).map(|place| add(Some(place))),
                clipping,
                round: find(part.and_then(|part| part.round.as_ref())).map(|place| add(Some(place))),
                last_round: None,
                last: None,
            });
        }
        Ok(Self {
            topic: topic.to_owned(),
            source,
            taps,
            counts: Counts::default(),
            malformed: None,
            messages: 0,
            frames: Vec::new(),
            in_order: false,
            decoder: Decoder::new(layout, &numbers, stamp.frame.as_ref())?,
            batch: Batch::of(&numbers, count, period),
            clock: stamp.clock,
            stamp: None,
            thermometer,
            device,
            numbers: vec![0.0; numbers.len()],
        })
    }

    /// Reads one message. Returns its sensor and the number of its readings, of which none is [loaded](Self::load) yet.
    pub(in crate::imu) fn read<'d>(&mut self, data: &'d [u8]) -> Result<(Frame<'d>, usize), Malformed> {
        let text = match &mut self.batch {
            Some(batch) => batch.read(&self.decoder, data, &mut self.numbers)?,
            None => self.decoder.read(data, &mut self.numbers)?,
        };
        self.messages += 1;
        let frame = match self.device.and_then(|at| self.numbers.get(at)) {
            Some(&device) => Frame::digits(device as u64),
            None => Frame::Text(text),
        };
        if self.frames.is_empty() && frame.len() <= LONGEST_FRAME {
            self.frames.push(frame.to_vec());
        }
        Ok((frame, self.batch.as_ref().map_or(1, Batch::readings)))
    }

    /// Makes one reading of the last message the current one. Returns its stamp.
    pub(in crate::imu) fn load(&mut self, reading: usize, log_time: u64) -> Stamp {
        if let Some(batch) = &self.batch {
            batch.load(reading, &mut self.numbers);
        }
        let stamp = self.clock.read(&self.numbers, log_time);
        let stamp = self.batch.as_ref().map_or(stamp, |batch| batch.time(reading, stamp, &self.numbers));
        self.stamp = Some(stamp);
        stamp
    }

    /// Whether a message holds several readings.
    pub(in crate::imu) fn has_batches(&self) -> bool {
        self.batch.is_some()
    }

    /// Stamp of a message that is not read yet; `None` if it holds several readings, or cannot be read.
    pub(in crate::imu) fn stamp_of(&self, data: &[u8], log_time: u64) -> Option<Stamp> {
        let mut numbers = vec![0.0; self.numbers.len()];
        self.decoder.read(data, &mut numbers).ok().filter(|_| self.batch.is_none())?;
        let mut clock = self.clock;
        Some(clock.read(&numbers, log_time))
    }

    /// Current reading of a tap, in m/s² or rad/s.
    pub(in crate::imu) fn value(&self, tap: &Tap) -> Result<Vector3<f64>, Cause> {
        tap.value(&self.numbers)
    }

    /// Whether of its triads only the gyroscope was measured: no others are there, or theirs are all marked as not
    /// measured, or zero.
    pub(in crate::imu) fn is_gyroscope_alone(&self) -> bool {
        let absent = |tap: &Tap| {
            let refused: u64 = tap.counts.iter().map(|(_, count)| count).sum();
            let is_absent = |cause| matches!(cause, Cause::NotMeasured | Cause::Zero);
            refused >= self.messages && tap.counts.iter().all(|(cause, _)| is_absent(cause))
        };
        let gyroscope = self.taps.iter().find(|tap| tap.sensor == Sensor::Gyroscope);
        let others = || self.taps.iter().filter(|tap| tap.sensor != Sensor::Gyroscope);
        gyroscope.is_some_and(|tap| others().next().is_none() || !absent(tap)) && others().all(absent)
    }

    /// Temperature in the last message, °C.
    pub(in crate::imu) fn temperature(&self) -> Option<f64> {
        self.thermometer.as_ref()?.0.read(&self.numbers)
    }

    /// Path of the temperature, if the messages hold it.
    pub(in crate::imu) fn temperature_path(&self) -> Option<&str> {
        self.thermometer.as_ref().map(|(_, path)| path.as_str())
    }

    /// Rewrites the last message, which is `data`, with other readings in m/s² or rad/s, each of them if there are several;
    /// `None` if nothing changes, or a number cannot hold the result. `change` receives the index of the reading. Integers
    /// are rounded.
    pub(in crate::imu) fn rewrite(
        &self,
        data: &[u8],
        mut change: impl FnMut(&Tap, usize, Vector3<f64>) -> Option<Vector3<f64>>,
    ) -> Option<Vec<u8>> {
        let (mut changes, mut numbers) = (Vec::new(), self.numbers.clone());
        for reading in 0..self.batch.as_ref().map_or(1, Batch::readings) {
            self.batch.iter().for_each(|batch| batch.load(reading, &mut numbers));
            for tap in &self.taps {
                let Some(value) = tap.value(&numbers).ok().and_then(|value| change(tap, reading, value)) else {
                    continue;
                };
                let own = tap.as_read(&value, &numbers);
                changes.extend(own.iter().enumerate().map(|(axis, &value)| {
                    let slot = tap.at + axis;
                    let element = self.batch.as_ref().filter(|batch| batch.is_listed(slot)).map(|_| reading);
                    let value = if self.decoder.is_integer(slot) { value.round() } else { value };
                    Change { slot, element, value }
                }));
            }
        }
        match changes.is_empty() || !changes.iter().all(|change| change.value.is_finite()) {
            true => None,
            false => self.decoder.rewrite_lists(data, self.numbers.len(), &changes),
        }
    }

    /// Largest step of the readings that are integers, in m/s² or rad/s, by the last message: what is written in their
    /// place is rounded to it.
    pub(in crate::imu) fn step(&self, tap: &Tap) -> Option<f64> {
        self.decoder.is_integer(tap.at).then(|| tap.unit(&self.numbers).ok().map(f64::abs)).flatten()
    }

    /// Whether the last message marks the reading of a tap as clipped.
    pub(in crate::imu) fn is_clipped(&self, tap: &Tap) -> bool {
        self.numbers.get(tap.clipping.clone()).unwrap_or_default().iter().any(|&count| count > 0.0)
    }

    /// Whether the last message shows that the driver began to apply another calibration.
    pub(in crate::imu) fn begins_round(&mut self, tap: usize) -> bool {
        let Some(at) = self.taps.get(tap).and_then(|tap| tap.round) else { return false };
        let round = self.number(Some(at)).map(|round| round as u64);
        let Some(tap) = self.taps.get_mut(tap) else { return false };
        let last = std::mem::replace(&mut tap.last_round, round);
        last.is_some() && last != round
    }

    /// Whether its sensors are distinguished by a device number.
    pub(in crate::imu) fn has_devices(&self) -> bool {
        self.device.is_some()
    }

    fn number(&self, at: Option<usize>) -> Option<f64> {
        self.numbers.get(at?).copied()
    }
}

impl Tap {
    /// Reading among the numbers of a message, in m/s² or rad/s.
    fn value(&self, numbers: &[f64]) -> Result<Vector3<f64>, Cause> {
        let Some(&[x, y, z]) = numbers.get(self.at..).unwrap_or_default().first_chunk() else {
            return Err(Cause::Malformed);
        };
        if number(numbers, self.covariance) == Some(-1.0) {
            return Err(Cause::NotMeasured);
        }
        let read = Vector3::new(x, y, z);
        let value = self.order.apply(&self.added(numbers).map_or(read, |added| read + added)) * self.unit(numbers)?;
        if Sample::is_reading(&value) { Ok(value) } else { Err(Cause::NotFinite) }
    }

    /// A reading in m/s² or rad/s in the units and axes of the message.
    fn as_read(&self, value: &Vector3<f64>, numbers: &[f64]) -> Vector3<f64> {
        // Without a unit there was no reading.
        let own = self.order.undo(value) / self.unit(numbers).unwrap_or(f64::NAN);
        self.added(numbers).map_or(own, |added| own - added)
    }

    /// Factor from the numbers to m/s² or rad/s.
    fn unit(&self, numbers: &[f64]) -> Result<f64, Cause> {
        let seconds = number(numbers, self.over).map_or(1.0, |micros| micros * 1e-6);
        if seconds == 0.0 {
            return Err(Cause::NoTime);
        }
        Ok(number(numbers, self.scale).map_or(self.factor, |scale| self.factor * scale) / seconds)
    }

    /// Vector added to the reading, in its unit; `None` without one, since adding zeros would change the sign of −0.
    fn added(&self, numbers: &[f64]) -> Option<Vector3<f64>> {
        let [x, y, z] = self.plus.and_then(|at| numbers.get(at..)?.first_chunk())?;
        Some(Vector3::new(*x, *y, *z))
    }

    /// Use of the tap by the IMU of this name.
    pub(in crate::imu) fn used_by(&self, imu: String) -> VectorUse {
        VectorUse {
            imu,
            sensor: self.sensor,
            name: self.name.clone(),
            path: self.path.clone(),
            axes: self.axes.clone(),
        }
    }
}

fn number(numbers: &[f64], at: Option<usize>) -> Option<f64> {
    numbers.get(at?).copied()
}

impl Frame<'_> {
    fn digits(device: u64) -> Self {
        let mut bytes = [0; 20];
        let mut rest = &mut bytes[..];
        // 20 digits are enough for any 64-bit number.
        let left = if write!(rest, "{device}").is_ok() { rest.len() } else { 20 };
        Self::Digits { bytes, len: 20 - left }
    }
}

impl Deref for Frame<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Text(text) => text,
            Self::Digits { bytes, len } => bytes.get(..*len).unwrap_or_default(),
        }
    }
}
