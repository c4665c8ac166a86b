//! Session as an MCAP recording: whole chunks, never patched, so that it can be followed while it grows.

use std::collections::BTreeMap;
use std::io;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};

use super::message::{Body, Header, Type};
use super::truth::Truth;
use super::{Compression, Encoding, Error, Reading, Scenario, samples};
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
    /// Reading of the accelerometer (or the reference) that waits for the gyroscope's reading for the same message.
    awaiting: Option<Reading>,
    shared: bool,
    copies: u8,
}

struct Topic {
    channel: u16,
    sequence: u32,
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
        let imu = topic(scenario.imu_topic(), Type::Imu)?;
        let own = scenario.gyroscope.as_ref().and_then(|gyroscope| gyroscope.topic.as_deref());
        let gyroscope = own.map(|name| topic(name, Type::Imu)).transpose()?;
        let secondary = scenario.secondary.values().filter_map(|triad| triad.topic.as_deref());
        let secondary = secondary.map(|name| topic(name, Type::Vector)).collect::<Result<_, _>>()?;
        let reference = scenario.reference.as_ref().map(|reference| topic(&reference.topic, Type::Imu)).transpose()?;
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
            awaiting: None,
            shared,
            copies: recording.copies,
        })
    }

    fn push(&mut self, reading: &Reading) -> Result<(), Error> {
        let measured = reading.measured;
        let (topic, body) = match reading.sensor {
            // Both are taken at the same instant: the gyroscope's reading comes next.
            Sensor::Accelerometer if self.shared => {
                self.awaiting = Some(*reading);
                return Ok(());
            }
            Sensor::Accelerometer => (Some(&mut self.imu), Body::Imu { accel: Some(measured), gyro: None }),
            Sensor::Gyroscope => {
                let accel = self.awaiting.take().map(|reading| reading.measured);
                let topic = self.gyroscope.as_mut().unwrap_or(&mut self.imu);
                (Some(topic), Body::Imu { accel, gyro: Some(measured) })
            }
            Sensor::Reference(Quantity::Force) => {
                self.awaiting = Some(*reading);
                return Ok(());
            }
            Sensor::Reference(Quantity::Rate) => {
                let accel = self.awaiting.take().map(|reading| reading.measured);
                (self.reference.as_mut(), Body::Imu { accel, gyro: Some(measured) })
            }
            Sensor::Secondary(index) => (self.secondary.get_mut(index), Body::Vector(measured)),
        };
        let Some(topic) = topic else { return Ok(()) };
        let log_time = reading.stamp.nanos().unsigned_abs();
        let header =
            MessageHeader { channel_id: topic.channel, sequence: topic.sequence, log_time, publish_time: log_time };
        let header_of_data = Header { sequence: topic.sequence, stamp: reading.stamp, frame_id: self.frame_id };
        topic.sequence = topic.sequence.wrapping_add(1);
        let data = self.encoding.encode(header_of_data, body);
        for _ in 0..self.copies {
            self.writer.write_to_known_channel(&header, &data)?;
        }
        Ok(())
    }
}
