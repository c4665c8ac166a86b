//! Recorders that are not ours: the Rust writer of the MCAP project, in the ways in which it is used, and Foxglove's SDK.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use mcap::{Compression, MessageStream, WriteOptions, Writer};
use stillpoint::simulate::{Scenario, record};

use crate::common::bag_metadata;
use crate::common::needs::data_path;

/// A session to record: messages, and when each is due.
pub struct Session {
    profile: String,
    messages: Vec<mcap::Message<'static>>,
}

/// How a recorder writes.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// By Foxglove's SDK, else by the writer itself.
    pub foxglove: bool,
    pub compression: Option<Compression>,
    pub seeking: bool,
    /// Through a buffer of 8 KiB, as most do.
    pub buffered: bool,
    /// Flushes after so many messages.
    pub flush: Option<usize>,
    pub chunk: u64,
}

impl Default for Style {
    fn default() -> Self {
        let compression = Some(Compression::Zstd);
        Self { foxglove: false, compression, seeking: true, buffered: true, flush: None, chunk: 16 << 10 }
    }
}

impl Session {
    /// The real six-face session, or where it is not there one like it: as long, at its rate.
    pub fn six_faces() -> Self {
        if let Ok(bytes) = std::fs::read(data_path("recordings/nilspod_six_face.ros2.mcap")) {
            return Self::of(&bytes);
        }
        let mut scenario = Scenario::builtin("demo").unwrap();
        scenario.pose.iter_mut().for_each(|pose| pose.rest_s = 11.0);
        let mut bytes = Vec::new();
        record(&scenario, &mut bytes).unwrap();
        Self::of(&bytes)
    }

    /// What a recording holds.
    pub fn of(bytes: &[u8]) -> Self {
        let messages = MessageStream::new(bytes).unwrap().map(|message| {
            let mcap::Message { channel, sequence, log_time, publish_time, data } = message.unwrap();
            mcap::Message { channel, sequence, log_time, publish_time, data: data.into_owned().into() }
        });
        let profile = if bytes[..60].windows(4).any(|four| four == b"ros2") { "ros2" } else { "" };
        Self { profile: profile.to_owned(), messages: messages.collect() }
    }

    pub fn len(&self) -> usize {
        self.messages.len()
    }

    /// Records to a file, so many times faster than it was.
    pub fn record(&self, path: &Path, style: Style, speed: f64) {
        let file = File::create(path).unwrap();
        match style.buffered {
            _ if style.foxglove => self.log(file, style, speed),
            true => self.write(BufWriter::new(file), style, speed, |_| true),
            false => self.write(file, style, speed, |_| true),
        }
    }

    /// The session in so many parts, one behind the other.
    pub fn parts(&self, parts: usize) -> Vec<Self> {
        let each = self.messages.len().div_ceil(parts);
        let part = |messages: &[_]| Self { profile: self.profile.clone(), messages: messages.to_vec() };
        self.messages.chunks(each).map(part).collect()
    }

    /// Records into a folder as rosbag2 does, in so many files, with `metadata.yaml` at the end.
    pub fn record_bag(&self, folder: &Path, parts: usize, style: Style, speed: f64) {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        std::fs::create_dir(folder).unwrap();
        let mut names = Vec::new();
        for (n, part) in self.parts(parts).iter().enumerate() {
            names.push(format!("{name}_{n}.mcap"));
            part.record(&folder.join(&names[n]), style, speed);
        }
        std::fs::write(folder.join("metadata.yaml"), bag_metadata(&names)).unwrap();
    }

    /// Records as long as `goes_on` with the number of messages written; one that stops never finishes.
    pub fn record_while(&self, path: &Path, style: Style, speed: f64, goes_on: impl FnMut(usize) -> bool) {
        self.write(File::create(path).unwrap(), style, speed, goes_on);
    }

    /// Records, but waits before the last third until there is room for what is to happen meanwhile.
    pub fn record_until(&self, path: &Path, style: Style, speed: f64, happened: &AtomicBool) {
        self.record_while(path, style, speed, |written| {
            while written * 3 > self.len() * 2 && !happened.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            true
        });
    }

    fn write<W: Write + Seek>(&self, file: W, style: Style, speed: f64, goes_on: impl FnMut(usize) -> bool) {
        let mut writer = Writer::with_options(file, self.options(style)).unwrap();
        let mut channels = BTreeMap::new();
        let whole = self.pace(speed, goes_on, |i, message| {
            let channel_id = *channels.entry(message.channel.id).or_insert_with(|| {
                let schema = message.channel.schema.as_ref().unwrap();
                let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
                let mcap::Channel { topic, message_encoding, metadata, .. } = &*message.channel;
                writer.add_channel(schema, topic, message_encoding, metadata).unwrap()
            });
            let (sequence, log_time, publish_time) = (message.sequence, message.log_time, message.publish_time);
            let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
            writer.write_to_known_channel(&header, &message.data).unwrap();
            if style.flush.is_some_and(|every| i % every == every - 1) {
                writer.flush().unwrap();
            }
        });
        match whole {
            true => _ = writer.finish().unwrap(),
            // A recorder that is killed does not finish.
            false => std::mem::forget(writer),
        }
    }

    /// Records as a program that logs with Foxglove's SDK does.
    fn log(&self, file: File, style: Style, speed: f64) {
        let context = foxglove::Context::new();
        let writer = foxglove::McapWriter::with_options(self.options(style)).context(&context);
        let writer = writer.create(BufWriter::new(file)).unwrap();
        let mut channels = BTreeMap::new();
        self.pace(
            speed,
            |_| true,
            |i, message| {
                let channel = channels.entry(message.channel.id).or_insert_with(|| {
                    let schema = message.channel.schema.as_ref().unwrap();
                    let schema = foxglove::Schema::new(&schema.name, &schema.encoding, schema.data.to_vec());
                    let channel =
                        foxglove::ChannelBuilder::new(&message.channel.topic).context(&context).schema(schema);
                    channel.message_encoding(&message.channel.message_encoding).build_raw().unwrap()
                });
                channel.log_with_meta(&message.data, foxglove::PartialMetadata { log_time: Some(message.log_time) });
                if style.flush.is_some_and(|every| i % every == every - 1) {
                    writer.flush().unwrap();
                }
            },
        );
        writer.close().unwrap();
    }

    fn options(&self, style: Style) -> WriteOptions {
        let options = WriteOptions::new().profile(&self.profile).compression(style.compression);
        options.chunk_size(Some(style.chunk)).disable_seeking(!style.seeking).compression_threads(0)
    }

    /// Each message when it is due, for as long as that goes on. Whether all were.
    fn pace(
        &self,
        speed: f64,
        mut goes_on: impl FnMut(usize) -> bool,
        mut each: impl FnMut(usize, &mcap::Message<'static>),
    ) -> bool {
        let (began, first) = (Instant::now(), self.messages.first().map_or(0, |message| message.log_time));
        self.messages.iter().enumerate().all(|(i, message)| {
            let due = Duration::from_nanos(((message.log_time - first) as f64 / speed) as u64);
            if let Some(early) = due.checked_sub(began.elapsed()).filter(|early| early.as_micros() > 500) {
                std::thread::sleep(early);
            }
            let goes_on = goes_on(i);
            if goes_on {
                each(i, message);
            }
            goes_on
        })
    }
}

/// So many times faster than real time.
pub fn speed() -> f64 {
    std::env::var("STILLPOINT_SPEED").map_or(200.0, |speed| speed.parse().unwrap())
}
