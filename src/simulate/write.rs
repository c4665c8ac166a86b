//! Session as an MCAP recording: whole chunks, never patched, so that it can be followed while it grows.

use std::collections::BTreeMap;
use std::io;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};

use super::message::{Body, Header, Type};
use super::sample::stream;
use super::temperature::Thermometer;
use super::truth::Truth;
use super::{Compression, Encoding, Error, Reading, Scenario, samples};
use crate::Stamp;
use crate::imu::{Quantity, Sensor};

/// Writes the recording of a scenario and returns its truth.
///
/// # Errors
/// If a value of the scenario cannot be simulated, with its key; if `out` cannot be written.
pub fn record(scenario: &Scenario, out: impl io::Write) -> Result<Truth, Error> {
    let samples = samples(scenario)?;
    let truth = Truth::new(scenario, &samples.trajectory);
    let mut recorder = Recorder::new(scenario, out)?;
    for reading in samples {
        recorder.push(&reading)?;
    }
    recorder.writer.finish()?;
    Ok(truth)
}

struct Recorder<'a, W: io::Write> {
    writer: Writer<NoSeek<W>>,
    encoding: Encoding,
    frame_id: &'a str,
    imu: Topic,
    /// Topic of the gyroscope, if it does not share the accelerometer's messages.
    gyroscope: Option<Topic>,
    secondary: Vec<Topic>,
    reference: Option<Topic>,
    /// Thermometer, and its topic if it has one.
    thermometer: Option<(Thermometer, Option<Topic>)>,
    /// Stamp of the start, ns.
    start: i64,
    /// Reading of the accelerometer (or the reference) that waits for the gyroscope's reading for the same message.
    awaiting: Option<Reading>,
    shared: bool,
    copies: u8,
}

struct Topic {
    channel: u16,
    sequence: u32,
}

impl Topic {
    /// Headers of the next message: of its record, and of its data.
    fn headers<'f>(&mut self, stamp: Stamp, frame_id: &'f str) -> (MessageHeader, Header<'f>) {
        let (log_time, sequence) = (stamp.nanos().unsigned_abs(), self.sequence);
        self.sequence = sequence.wrapping_add(1);
        let header = MessageHeader { channel_id: self.channel, sequence, log_time, publish_time: log_time };
        (header, Header { sequence, stamp, frame_id })
    }
}

impl<'a, W: io::Write> Recorder<'a, W> {
    fn new(scenario: &'a Scenario, out: W) -> Result<Self, Error> {
        let recording = &scenario.recording;
        let encoding = recording.encoding;
        let mut writer = WriteOptions::new()
            .profile(recording.profile.as_deref().unwrap_or(encoding.profile()))
            .library("stillpoint simulate")
            .compression(match recording.compression {
                Compression::None => None,
                Compression::Lz4 => Some(mcap::Compression::Lz4),
                Compression::Zstd => Some(mcap::Compression::Zstd),
            })
            .compression_threads(0)
            .chunk_size(Some(recording.chunk_bytes.into()))
            .disable_seeking(true)
            .create(NoSeek::new(out))?;
        let mut topic = |name: &str, of: Type| -> Result<Topic, Error> {
            let schema = encoding.schema(of);
            let schema = writer.add_schema(schema.name, schema.encoding, &schema.data)?;
            let channel = writer.add_channel(schema, name, encoding.message_encoding(), &BTreeMap::new())?;
            Ok(Topic { channel, sequence: 0 })
        };
        let warm = scenario.temperature.as_ref().is_some_and(|temperature| temperature.topic.is_none());
        let imu = topic(scenario.imu_topic(), if warm { Type::WarmImu } else { Type::Imu })?;
        let own = scenario.gyroscope.as_ref().and_then(|gyroscope| gyroscope.topic.as_deref());
        let gyroscope = own.map(|name| topic(name, Type::Imu)).transpose()?;
        let secondary = scenario.secondary.values().filter_map(|triad| triad.topic.as_deref());
        let secondary = secondary.map(|name| topic(name, Type::Vector)).collect::<Result<_, _>>()?;
        let reference = scenario.reference.as_ref().map(|reference| topic(&reference.topic, Type::Imu)).transpose()?;
        let thermometer = scenario.temperature.as_ref().map(|temperature| {
            let own = temperature.topic.as_deref().map(|name| topic(name, Type::Temperature)).transpose()?;
            Ok::<_, Error>((Thermometer::new(temperature.clone(), stream(scenario, u64::MAX - 2)), own))
        });
        let thermometer = thermometer.transpose()?;
        let shared = scenario.gyroscope.is_some() && own.is_none();
        let frame_id = &recording.frame_id;
        Ok(Self {
            writer,
            encoding,
            frame_id,
            imu,
            gyroscope,
            secondary,
            reference,
            thermometer,
            start: i64::from(recording.start_s) * 1_000_000_000,
            awaiting: None,
            shared,
            copies: recording.copies,
        })
    }

    fn push(&mut self, reading: &Reading) -> Result<(), Error> {
        let measured = reading.measured;
        self.warm(reading.stamp)?;
        let (topic, body) = match reading.sensor {
            // Both are taken at the same instant: the gyroscope's reading comes next.
            Sensor::Accelerometer if self.shared => {
                self.awaiting = Some(*reading);
                return Ok(());
            }
            Sensor::Accelerometer => {
                let celsius = self.celsius(reading.stamp);
                (Some(&mut self.imu), Body::Imu { accel: Some(measured), gyro: None, celsius })
            }
            Sensor::Gyroscope => {
                let accel = self.awaiting.take().map(|reading| reading.measured);
                let celsius = if accel.is_some() { self.celsius(reading.stamp) } else { None };
                let topic = self.gyroscope.as_mut().unwrap_or(&mut self.imu);
                (Some(topic), Body::Imu { accel, gyro: Some(measured), celsius })
            }
            Sensor::Reference(Quantity::Force) => {
                self.awaiting = Some(*reading);
                return Ok(());
            }
            Sensor::Reference(Quantity::Rate) => {
                let accel = self.awaiting.take().map(|reading| reading.measured);
                (self.reference.as_mut(), Body::Imu { accel, gyro: Some(measured), celsius: None })
            }
            Sensor::Secondary(index) => (self.secondary.get_mut(index), Body::Vector(measured)),
        };
        let Some(topic) = topic else { return Ok(()) };
        let (header, header_of_data) = topic.headers(reading.stamp, self.frame_id);
        let data = self.encoding.encode(header_of_data, body);
        for _ in 0..self.copies {
            self.writer.write_to_known_channel(&header, &data)?;
        }
        Ok(())
    }

    /// Writes the messages of a thermometer with a topic of its own up to a stamp.
    fn warm(&mut self, until: Stamp) -> Result<(), Error> {
        let Some((thermometer, Some(topic))) = &mut self.thermometer else { return Ok(()) };
        while self.start + thermometer.next() <= until.nanos() {
            let nanos = thermometer.next();
            let body = Body::Temperature(thermometer.measure(nanos));
            let (header, header_of_data) = topic.headers(Stamp::from_nanos(self.start + nanos), self.frame_id);
            self.writer.write_to_known_channel(&header, &self.encoding.encode(header_of_data, body))?;
        }
        Ok(())
    }

    /// Temperature for a message of the accelerometer at this stamp.
    fn celsius(&mut self, stamp: Stamp) -> Option<f64> {
        let (thermometer, None) = self.thermometer.as_mut()? else { return None };
        Some(thermometer.measure(stamp.nanos() - self.start))
    }
}
